// SPDX-License-Identifier: MIT
// Progress of long work. A callback may throw Interrupted; workers pass it on.
#pragma once

#include <functional>
#include <string>

namespace lodlab {

/// Called from one thread at a time with the stage's name and the share done, 0 to 1.
using Progress = std::function<void(const std::string& stage, double share)>;

}  // namespace lodlab
