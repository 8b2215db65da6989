// SPDX-License-Identifier: MIT
// A thread as an owner of things: known by its life, since systems give the id of a thread that has ended to
// the next one.
#pragma once

#include <chrono>
#include <memory>
#include <thread>

namespace lodlab {

class ThreadKey {
 public:
  /// No thread: it has ended.
  ThreadKey() = default;
  static ThreadKey here() {
    ThreadKey key;
    key.life_ = life();
    return key;
  }

  bool is_here() const { return life_.lock() == life(); }
  /// Whether it has ended. One that lives gets 50 ms: Python's join returns while a thread is on its way out.
  bool ended() const {
    using namespace std::chrono_literals;
    for (int i = 0; i < 50 && !life_.expired() && !is_here(); ++i) std::this_thread::sleep_for(1ms);
    return life_.expired();
  }

 private:
  static const std::shared_ptr<char>& life() {
    static thread_local const std::shared_ptr<char> mine = std::make_shared<char>();
    return mine;
  }

  std::weak_ptr<char> life_;
};

}  // namespace lodlab
