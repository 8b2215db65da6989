// SPDX-License-Identifier: MIT
// A GL buffer of fixed size.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "gl/handle.h"

namespace lodlab::gl {

class Buffer {
 public:
  Buffer() = default;
  /// `data` may be null. GLError when the driver has no room.
  explicit Buffer(int64_t bytes, const void* data = nullptr);
  template <class T>
  explicit Buffer(const std::vector<T>& values)
      : Buffer(static_cast<int64_t>(values.size() * sizeof(T)), values.data()) {}

  void upload(int64_t offset, std::span<const std::byte> bytes);
  void read(int64_t offset, std::span<std::byte> bytes) const;

  unsigned id() const { return handle_.id(); }
  int64_t bytes() const { return bytes_; }
  explicit operator bool() const { return static_cast<bool>(handle_); }

 private:
  Handle<Kind::kBuffer> handle_;
  int64_t bytes_ = 0;
};

}  // namespace lodlab::gl
