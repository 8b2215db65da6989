// SPDX-License-Identifier: MIT
// Ownership of one GL name: moves, never copies, is released on the right thread.
#pragma once

#include <utility>

#include "gl/context.h"

namespace lodlab::gl {

template <Kind kind>
class Handle {
 public:
  Handle() = default;
  explicit Handle(unsigned name) : name_(name) {}
  ~Handle() { release(kind, name_); }
  Handle(Handle&& other) noexcept : name_(std::exchange(other.name_, 0)) {}
  Handle& operator=(Handle&& other) noexcept {
    std::swap(name_, other.name_);
    return *this;
  }
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;

  unsigned id() const { return name_; }
  explicit operator bool() const { return name_ != 0; }

 private:
  unsigned name_ = 0;
};

}  // namespace lodlab::gl
