// SPDX-License-Identifier: MIT
// Maps of attributes (colours, normals) as pyramids of tiles that know nothing of grids. Level 0 has
// 2^finer_log2 texels a sample, each level half as many. A tile has 2^side_log2 texels a side and a border of
// kBorder around them, taken from its neighbours, so that it has kMips mip levels of its own, each equal to
// the pyramid's level so much coarser. So a picture does not show which level a tile is of, nor where it
// ends: the GPU's own choice of a mip level leads to the same texels.
//
// Texel i of level 0 covers samples from i to i + 1 in units of 2^-finer_log2, sample c being centred at c +
// 1/2.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "geometry/height_field.h"
#include "store/store.h"

namespace lodlab {

/// Pages of a store that are tiles of maps: numbers that are no other pages' of a method with maps.
enum MapKind : int { kColors = 2, kNormals = 3 };

/// Who draws with maps: the least square of samples that a method may draw by itself, which lies in one tile,
/// and what its user can do where such a square has too many texels.
struct MapUser {
  std::string method;
  int piece_log2;  ///< of its side
  std::string advice;
};

class MapTiles {
 public:
  static constexpr int kMips = 5;                       ///< of a tile, its own level included
  static constexpr int kBorder = 1 << (kMips - 1);      ///< one texel in the coarsest
  static constexpr int kLeastLog2 = 8, kMostLog2 = 10;  ///< of side_log2

  MapTiles(const FieldFrame& frame, int finer_log2, int side_log2);
  /// For a map with so many texels a sample. InvalidInput, naming `what`, where a piece would need tiles of
  /// more than 2^kMostLog2 texels a side.
  static MapTiles choose(const FieldFrame& frame, const MapUser& user, int finer_log2,
                         const std::string& what);
  /// As the array `name` of a store says, whose method draws pieces of this size.
  static MapTiles stored(const Store& store, const std::string& name, const FieldFrame& frame,
                         int piece_log2);

  int levels() const { return static_cast<int>(first_.size()) - 1; }
  int64_t count() const { return first_.back(); }
  int finer_log2() const { return finer_log2_; }
  int side_log2() const { return side_log2_; }
  /// Texels a side, border included.
  int64_t pitch() const { return (int64_t{1} << side_log2_) + 2 * kBorder; }
  /// log2 of a tile's samples a side.
  int span_log2(int level) const { return side_log2_ + level - finer_log2_; }
  int64_t across(int level) const { return scaled(last_col_, -span_log2(level)); }
  int64_t down(int level) const { return scaled(last_row_, -span_log2(level)); }
  /// Ids count the tiles of level 0 row by row, then those of level 1, and so on.
  int64_t id(int level, int64_t row, int64_t col) const {
    const int log2 = span_log2(level);
    return first_[static_cast<size_t>(level)] + (row >> log2) * across(level) + (col >> log2);
  }
  struct Tile {
    int level;
    int64_t row, col;    ///< first texel of its border, in texels of the level
    int64_t rows, cols;  ///< texels that are there: pitch(), or fewer at the end of the field
  };
  Tile at(int64_t id) const;
  /// The tile of the next level that covers this one. Not for the last one, which covers all.
  int64_t parent(int64_t id) const;
  /// Bytes of a whole tile with its mip levels.
  int64_t bytes() const;
  /// ceil(count * 2^log2)
  static int64_t scaled(int64_t count, int log2) {
    return log2 >= 0 ? count << log2 : (count + (int64_t{1} << -log2) - 1) >> -log2;
  }

 private:
  int64_t last_row_, last_col_;  ///< of vertices: a planet that wraps has column 0 again
  int finer_log2_, side_log2_;
  std::vector<int64_t> first_;  ///< id of each level's first tile; their number
};

/// The mean of four texels, in 8 bits a channel.
inline uint32_t mean_texel(uint32_t a, uint32_t b, uint32_t c, uint32_t d) {
  uint32_t out = 0;
  for (int shift = 0; shift < 32; shift += 8) {
    const auto channel = [shift](uint32_t texel) { return texel >> shift & 255u; };
    out |= (channel(a) + channel(b) + channel(c) + channel(d) + 2) / 4 << shift;
  }
  return out;
}

/// A stored tile's texels and its mip levels after them, finest first, row by row.
std::vector<uint32_t> decode_map_tile(const MapTiles::Tile& tile, const Bytes& stored);

}  // namespace lodlab
