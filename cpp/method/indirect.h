// SPDX-License-Identifier: MIT
// What methods share that draw pages of a store by commands in a buffer: buffers that grow, and what a page's
// way to the GPU is.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>

#include "gl/buffer.h"
#include "gl/indirect.h"
#include "method/residency.h"
#include "render/pass.h"

namespace lodlab {

/// Bytes that a streaming frame may bring beside what it draws.
inline constexpr int64_t kUploadPerFrame = 8 << 20;

/// Makes room: never smaller, at least doubled, and for no more than `most` bytes. True: the buffer is
/// another.
inline bool reserve(gl::Buffer& buffer, int64_t bytes, int64_t most = std::numeric_limits<int64_t>::max()) {
  if (bytes <= buffer.bytes()) return false;
  buffer = gl::Buffer(std::clamp(2 * buffer.bytes(), bytes, std::max(bytes, most)));
  return true;
}

/// Fills a buffer from its start, with room made.
inline void send(gl::Buffer& buffer, std::span<const std::byte> bytes, render::Submitted& submitted) {
  reserve(buffer, static_cast<int64_t>(bytes.size()));
  buffer.upload(0, bytes);
  submitted.upload_bytes += static_cast<int64_t>(bytes.size());
}

/// Brings a unit to the GPU, when streaming its parents before it, and uses them; `put(upload)` stores what
/// comes. With a worth it comes from main memory only, and may drive out what is worth less. False: it is not
/// there, or this frame uses all the memory that there is.
template <class Paging, class Put>
bool bring(Paging& paging, uint32_t unit, std::optional<double> worth, const Put& put) {
  paging.touch(unit, worth.value_or(0.0));
  if (paging.offset(unit) >= 0) return true;
  if (paging.streams() && unit >= paging.roots() && !bring(paging, paging.parent(unit), worth, put))
    return false;
  const auto upload = paging.admit(unit, !worth, worth.value_or(0.0));
  if (upload) put(*upload);
  return upload.has_value();
}

}  // namespace lodlab
