// SPDX-License-Identifier: MIT
#include "method/map_tiles.h"

#include <algorithm>

#include "base/errors.h"
#include "method/sample_code.h"

namespace lodlab {

MapTiles::MapTiles(const FieldFrame& frame, int finer_log2, int side_log2)
    : last_row_(frame.rows - 1),
      last_col_(frame.wraps ? frame.cols : frame.cols - 1),
      finer_log2_(finer_log2),
      side_log2_(side_log2),
      first_{0} {
  for (int level = 0;; ++level) {
    const int64_t here = across(level) * down(level);
    first_.push_back(first_.back() + here);
    if (here == 1) return;
  }
}

MapTiles MapTiles::choose(const FieldFrame& frame, const MapUser& user, int finer_log2,
                          const std::string& what) {
  const int piece = user.piece_log2 + finer_log2;
  if (piece > kMostLog2) {
    throw InvalidInput(user.method + ": " + what + ": the least that is drawn at once has 2^" +
                       std::to_string(piece) + " texels a side, more than " + std::to_string(1 << kMostLog2) +
                       "; " + user.advice);
  }
  return {frame, finer_log2, std::max(piece, kLeastLog2)};
}

MapTiles MapTiles::stored(const Store& store, const std::string& name, const FieldFrame& frame,
                          int piece_log2) {
  const std::vector<int32_t> shape = store.array_of<int32_t>(name);
  const bool known = shape.size() == 2 && shape[1] >= kLeastLog2 && shape[1] <= kMostLog2 &&
                     piece_log2 + shape[0] <= shape[1] && shape[0] > -32;
  if (!known)
    throw StoreError(store.meta().method + ": " + store.path() + " does not say how its " + name + " lie");
  return {frame, shape[0], shape[1]};
}

MapTiles::Tile MapTiles::at(int64_t id) const {
  const auto next = std::upper_bound(first_.begin(), first_.end(), id);
  const int level = static_cast<int>(next - first_.begin()) - 1;
  const int64_t place = id - *(next - 1);
  const int64_t row = (place / across(level) << side_log2_) - kBorder,
                col = (place % across(level) << side_log2_) - kBorder;
  // As far as the last sample's texel and a border behind it, in whole texels of the coarsest mip level.
  const auto length = [&](int64_t first, int64_t last) {
    const int64_t needed = scaled(last + 1, finer_log2_ - level) + kBorder - first;
    return std::min(pitch(), (needed + kBorder - 1) / kBorder * kBorder);
  };
  return {level, row, col, length(row, last_row_), length(col, last_col_)};
}

int64_t MapTiles::parent(int64_t id) const {
  const auto next = std::upper_bound(first_.begin(), first_.end(), id);
  const int level = static_cast<int>(next - first_.begin()) - 1;
  const int64_t place = id - *(next - 1);
  return *next + place / across(level) / 2 * across(level + 1) + place % across(level) / 2;
}

int64_t MapTiles::bytes() const {
  int64_t texels = 0;
  for (int mip = 0; mip < kMips; ++mip) texels += (pitch() >> mip) * (pitch() >> mip);
  return texels * static_cast<int64_t>(sizeof(uint32_t));
}

std::vector<uint32_t> decode_map_tile(const MapTiles::Tile& tile, const Bytes& stored) {
  int64_t count = 0;
  for (int mip = 0; mip < MapTiles::kMips; ++mip) count += (tile.rows >> mip) * (tile.cols >> mip);
  std::vector<uint32_t> texels(static_cast<size_t>(count));
  decode_samples(stored, texels.data(), tile.rows * tile.cols);
  const uint32_t* finer = texels.data();
  for (int mip = 1; mip < MapTiles::kMips; ++mip) {
    const int64_t cols = tile.cols >> (mip - 1), rows = tile.rows >> (mip - 1);
    uint32_t* to = texels.data() + (finer - texels.data()) + rows * cols;
    const uint32_t* next = to;
    for (int64_t j = 0; j < rows; j += 2) {
      const uint32_t *above = finer + j * cols, *below = above + cols;
      for (int64_t i = 0; i < cols; i += 2)
        *to++ = mean_texel(above[i], above[i + 1], below[i], below[i + 1]);
    }
    finer = next;
  }
  return texels;
}

}  // namespace lodlab
