// SPDX-License-Identifier: MIT
// Heights of tiles in GPU memory, where residency puts them. A part is a buffer of as many slots as a shader
// may see at once: both the vertex buffer and a storage buffer. Parts are made when something is put there.
#pragma once

#include <vector>

#include "gl/buffer.h"
#include "methods/multigrain/paging.h"
#include "render/pass.h"

namespace lodlab::multigrain {

class TileMemory {
 public:
  explicit TileMemory(const Paging& paging);

  void put(const Residency::Upload& upload, render::Submitted& submitted);
  struct Place {
    size_t part;
    int64_t height;  ///< index in the part, of the height at the sample
    int64_t tile_rows;
  };
  /// Of a sample in a resident tile.
  Place place(const Paging& paging, uint32_t unit, int64_t row, int64_t col) const;
  const gl::Buffer& part(size_t index) const { return parts_[index]; }
  int64_t bytes() const;

 private:
  int64_t capacity_, part_bytes_;
  std::vector<gl::Buffer> parts_;
};

}  // namespace lodlab::multigrain
