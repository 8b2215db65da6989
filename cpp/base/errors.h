// SPDX-License-Identifier: MIT
// The typed errors of the core. Each becomes the Python class of the same name in lodlab.errors.
// A message names the operation, the value and the limit.
#pragma once

#include <stdexcept>
#include <string>

namespace lodlab {

/// The caller's mistake: a ValueError in Python.
class InvalidInput : public std::invalid_argument {
 public:
  using std::invalid_argument::invalid_argument;
};

/// A store that cannot be read, written or trusted: an OSError in Python.
class StoreError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// EGL, OpenGL or a shader failed: a RuntimeError in Python.
class GLError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// The method or the machine cannot do what was asked, by design.
class Unsupported : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// The user asked to stop (Ctrl-C): KeyboardInterrupt in Python.
class Interrupted : public std::runtime_error {
 public:
  Interrupted() : std::runtime_error("interrupted") {}
};

}  // namespace lodlab
