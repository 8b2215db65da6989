// SPDX-License-Identifier: MIT
// Progress of long work. A callback may throw Interrupted; workers pass it on.
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <mutex>
#include <string>

namespace lodlab {

/// Called from one thread at a time with the stage's name and the share done, 0 to 1.
using Progress = std::function<void(const std::string& stage, double share)>;

/// Tells how much of a stage is done, in order, whichever thread did it.
class Count {
 public:
  /// `progress` may be empty, and outlives this.
  Count(const Progress& progress, const char* stage, int64_t all)
      : progress_(progress), stage_(stage), all_(all) {}
  void operator()(int64_t more = 1) {
    const std::lock_guard lock(mutex_);
    done_ += more;
    if (progress_) progress_(stage_, static_cast<double>(std::min(done_, all_)) / static_cast<double>(all_));
  }

 private:
  const Progress& progress_;
  const char* stage_;
  int64_t all_, done_ = 0;
  std::mutex mutex_;
};

}  // namespace lodlab
