// SPDX-License-Identifier: MIT
// Maps on their way to the store: their finest level comes by rows, from north to south; each level keeps no
// more of its rows than the next tiles need, so that a map may be larger than memory. No GL.
#pragma once

#include <string>
#include <vector>

#include "base/progress.h"
#include "geometry/height_rows.h"
#include "geometry/normals.h"
#include "method/map_tiles.h"

namespace lodlab {

/// Box-filters rows to a pyramid and writes its tiles.
class MapWriter {
 public:
  MapWriter(MapKind kind, const FieldFrame& frame, const MapTiles& tiles, StoreWriter& writer);

  /// Texels of a row of level 0: first_col() is the first one's column. Where columns wrap, a row goes on
  /// round the planet on both sides, as far as coarser levels look.
  int64_t first_col() const { return levels_[0].first_col; }
  int64_t cols() const { return levels_[0].cols; }
  int64_t rows() const { return levels_[0].rows; }
  int64_t taken() const { return levels_[0].end; }
  /// The next rows of level 0, whole ones.
  void take(const std::vector<uint32_t>& texels) { take(0, texels); }

 private:
  struct Level {
    int64_t first_col, cols, rows;
    int64_t begin = 0, end = 0;  ///< rows that are kept
    int64_t halved = 0;          ///< rows that the next level has
    int64_t written = 0;         ///< rows of tiles
    std::vector<uint32_t> texels;

    /// Beyond a level its last texels go on.
    const uint32_t* row(int64_t at) const {
      return texels.data() + (std::clamp<int64_t>(at, 0, rows - 1) - begin) * cols;
    }
    int64_t place(int64_t col) const { return std::clamp<int64_t>(col - first_col, 0, cols - 1); }
  };
  void take(size_t level, const std::vector<uint32_t>& texels);
  std::vector<uint32_t> halve(size_t level);
  void write_row(size_t level);

  MapKind kind_;
  MapTiles tiles_;
  StoreWriter& writer_;
  std::vector<Level> levels_;
};

/// Reads the raster, which spans what the samples do, and writes its pyramid. InvalidInput for a file that is
/// no picture, and for one so fine that MapTiles::choose refuses it.
void put_colors(const std::string& file, const FieldFrame& frame, const MapUser& user, StoreWriter& writer,
                const Progress& progress);

/// The pyramid of a field's normals, from bands of its rows.
class NormalsWriter {
 public:
  NormalsWriter(const FieldFrame& frame, const MapUser& user, StoreWriter& writer);
  /// Normals of the rows that follow, up to `end`; `rows` holds what these need (Normals::first_needed).
  void take(const HeightRows& rows, int64_t end, const Progress& progress);
  const Normals& normals() const { return normals_; }

 private:
  Normals normals_;
  MapWriter map_;
};

}  // namespace lodlab
