// SPDX-License-Identifier: MIT
#include "methods/multigrain/tile_memory.h"

#include <epoxy/gl.h>

#include <algorithm>

#include "base/errors.h"
#include "methods/multigrain/grids.h"

namespace lodlab::multigrain {

TileMemory::TileMemory(const Paging& paging) : capacity_(paging.residency().capacity()) {
  GLint64 limit = 0;
  glGetInteger64v(GL_MAX_SHADER_STORAGE_BLOCK_SIZE, &limit);
  limit = std::min<int64_t>(limit, int64_t{INT32_MAX} * static_cast<int64_t>(sizeof(float)));
  part_bytes_ = limit / paging.slot_bytes() * paging.slot_bytes();
  if (part_bytes_ == 0) {
    throw Unsupported("multigrain: tiles of " + std::to_string(paging.slot_bytes()) +
                      " bytes are above this device's limit of " + std::to_string(limit));
  }
  parts_.resize(static_cast<size_t>((capacity_ + part_bytes_ - 1) / part_bytes_));
}

void TileMemory::put(const Residency::Upload& upload, render::Submitted& submitted) {
  const int64_t index = upload.offset / part_bytes_, first = index * part_bytes_;
  gl::Buffer& part = parts_[static_cast<size_t>(index)];
  if (!part) part = gl::Buffer(std::min(part_bytes_, capacity_ - first));
  part.upload(upload.offset - first, *upload.page);
  submitted.upload_bytes += static_cast<int64_t>(upload.page->size());
}

TileMemory::Place TileMemory::place(const Paging& paging, uint32_t unit, int64_t row, int64_t col) const {
  const Tile tile = paging.tile(unit);
  const int64_t offset = paging.residency().offset(unit), index = offset / part_bytes_;
  const int64_t first = (offset - index * part_bytes_) / paging.vertex_bytes();
  const int64_t j = (row - tile.row) >> tile.stride_log2, i = (col - tile.col) >> tile.stride_log2;
  return {static_cast<size_t>(index), first + (i / kStrip * tile.rows + j) * kStripPitch + i % kStrip,
          tile.rows};
}

int64_t TileMemory::bytes() const {
  int64_t sum = 0;
  for (const gl::Buffer& part : parts_) sum += part.bytes();
  return sum;
}

}  // namespace lodlab::multigrain
