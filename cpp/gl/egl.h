// SPDX-License-Identifier: MIT
// EGL entry points by name. libepoxy resolves extension functions only once a display exists, and some of
// them are needed before: those go through eglGetProcAddress.
#pragma once

#include <epoxy/egl.h>

#include <string>

#include "base/errors.h"

namespace lodlab::gl {

template <class Function>
Function egl_function(const char* name) {
  const auto function = reinterpret_cast<Function>(eglGetProcAddress(name));
  if (function == nullptr) throw GLError(std::string("EGL: ") + name + " is missing in this driver");
  return function;
}

}  // namespace lodlab::gl
