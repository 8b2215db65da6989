// SPDX-License-Identifier: MIT
// The EGL devices of this machine and the choice among them: auto, software, cuda:N or an index.
// An explicit choice never falls back to another device; auto prefers hardware.
#pragma once

#include <string>
#include <vector>

namespace lodlab::gl {

struct Device {
  int index = 0;  ///< position in EGL's list
  std::string name;
  bool software = false;
  int cuda = -1;           ///< ordinal of the CUDA device, -1: not one
  void* handle = nullptr;  ///< EGLDeviceEXT
};

/// All devices, in EGL's order. GLError when EGL is missing or cannot enumerate.
std::vector<Device> devices();

/// The devices that `choice` allows, in the order in which to try them; more than one for auto only.
/// InvalidInput when the text is no choice, GLError when no such device is here.
std::vector<Device> candidates(const std::string& choice, const std::vector<Device>& all);

}  // namespace lodlab::gl
