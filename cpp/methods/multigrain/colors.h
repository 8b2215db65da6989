// SPDX-License-Identifier: MIT
// Colours of the surface, with a resolution of their own: a pyramid of tiles that know nothing of grids.
// Level 0 has 2^finer_log2 texels a sample, each level half as many. A tile has 2^side_log2 texels a side and
// a border of kBorder around them, taken from its neighbours, so that it has kMips mip levels of its own,
// each equal to the pyramid's level so much coarser. So a picture does not show which level a tile is of, nor
// where it ends: the GPU's own choice of a mip level leads to the same texels.
//
// Texel i of level 0 covers samples from i to i + 1 in units of 2^-finer_log2, sample c being centred at c +
// 1/2.
#pragma once

#include <string>
#include <vector>

#include "base/progress.h"
#include "geometry/height_field.h"
#include "geometry/view.h"
#include "methods/multigrain/hierarchy.h"

namespace lodlab::multigrain {

class ColorTiles {
 public:
  static constexpr int kMips = 5;                       ///< of a tile, its own level included
  static constexpr int kBorder = 1 << (kMips - 1);      ///< one texel in the coarsest
  static constexpr int kLeastLog2 = 8, kMostLog2 = 10;  ///< of side_log2

  ColorTiles(const Layout& layout, int finer_log2, int side_log2);

  int levels() const { return static_cast<int>(first_.size()) - 1; }
  int64_t count() const { return first_.back(); }
  int finer_log2() const { return finer_log2_; }
  int side_log2() const { return side_log2_; }
  /// Texels a side, border included.
  int64_t pitch() const { return (int64_t{1} << side_log2_) + 2 * kBorder; }
  /// log2 of a tile's samples a side.
  int span_log2(int level) const { return side_log2_ + level - finer_log2_; }
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

 private:
  int64_t across(int level) const { return layout_.cells_x(0, kWhole, span_log2(level)); }
  int64_t down(int level) const { return layout_.cells_y(0, kWhole, span_log2(level)); }

  static constexpr int kWhole = 62;  ///< log2 of more cells than any field has
  Layout layout_;
  int finer_log2_, side_log2_;
  std::vector<int64_t> first_;  ///< id of each level's first tile; their number
};

/// Means of 2 x 2 texels, in 8 bits a channel; rows and columns are even in number.
std::vector<uint32_t> half_colors(const std::vector<uint32_t>& texels, int64_t cols, int64_t rows);

/// Reads the raster, which spans what the samples do, and writes its pyramid. InvalidInput for a file that is
/// no picture, and for one so fine that a block would need tiles of more than 2^kMostLog2 texels a side.
void put_colors(const std::string& file, const FieldFrame& frame, const Layout& layout, StoreWriter& writer,
                const Progress& progress);

/// A square of a node and its tile of colours.
struct Patch {
  int32_t row, col;  ///< its first sample
  int size_log2;
  int64_t tile;                   ///< -1: out of sight
  float u = 0, v = 0, scale = 0;  ///< in the tile, of its first sample; from one sample to the next
};

/// The colours of an opened store, and which of them a view needs.
class Colors {
 public:
  /// Whether the store has any.
  static bool in(const Store& store);
  explicit Colors(const Forest& forest);

  const ColorTiles& tiles() const { return tiles_; }
  /// The texels of a tile, row by row.
  std::vector<uint32_t> tile(int64_t id) const;

  /// The patches of a node that is drawn with this stride: as many as it takes for each to have
  /// `texels_per_pixel` texels a pixel where it is nearest, or all that there are.
  void patches(uint32_t node, int stride_log2, const Camera& camera, double texels_per_pixel,
               std::vector<Patch>& out) const;

 private:
  int wanted_level(const Node& node, const Box& box, const Camera& camera, double texels_per_pixel) const;
  Patch patch(const Node& node, int level) const;

  const Forest& forest_;
  ColorTiles tiles_;
};

}  // namespace lodlab::multigrain
