// SPDX-License-Identifier: MIT
// The implicit hierarchy of patches (Livny, Kogan, El-Sana, section 3): nothing is stored for a patch but
// what stands here as arithmetic. A patch of level l is a square of 2^side_log2(l) cells, aligned to sample
// (0, 0); it splits into R x R children, R = 2^(resolutions - 1). Drawn with resolution k (0: the coarsest)
// an edge has 2^(patch_log2 - (resolutions - 1 - k)) segments, so that the finest of a level has the stride
// of the level's samples, 2^stride_log2(l), and the coarsest of a child is as fine as the finest of its
// parent. Level 0 is one patch that covers the field. What lies past the last row or column is clamped onto
// it.
#pragma once

#include <algorithm>
#include <cstdint>

namespace lodlab::seamless {

/// log2 of the lattice cells a side of the least square that a patch may be cut into (squares.h): at least as
/// long as any segment of an edge, and no longer than any patch.
inline constexpr int kSquareLog2 = 2;

enum Edge { kNorth = 0, kEast = 1, kSouth = 2, kWest = 3 };

struct Patch {
  int level;
  int64_t y, x;  ///< counted in patches of this level
};

struct Layout {
  int64_t rows = 0, cols = 0;  ///< samples
  int patch_log2 = 6;          ///< segments of an edge at its finest resolution
  int resolutions = 2;         ///< 2 or 3
  int finest_log2 = 0;         ///< stride of the last level; above 0 where `finest_error` leaves samples out
  int levels = 1;

  int64_t last_row() const { return rows - 1; }
  int64_t last_col() const { return cols - 1; }
  int branch_log2() const { return resolutions - 1; }  ///< R
  int segments() const { return 1 << patch_log2; }
  int stride_log2(int level) const { return finest_log2 + (levels - 1 - level) * branch_log2(); }
  int side_log2(int level) const { return patch_log2 + stride_log2(level); }
  /// The stride that an edge of this resolution is drawn with.
  int stride_log2(int level, int resolution) const {
    return stride_log2(level) + resolutions - 1 - resolution;
  }

  /// Patches of a level that hold any cell.
  int64_t across(int level) const { return count(last_col(), side_log2(level)); }
  int64_t down(int level) const { return count(last_row(), side_log2(level)); }
  /// Ids count the levels from the root, in each row by row.
  int64_t first(int level) const {
    int64_t sum = 0;
    for (int l = 0; l < level; ++l) sum += across(l) * down(l);
    return sum;
  }
  int64_t patches() const { return first(levels); }
  int64_t id(const Patch& p) const { return first(p.level) + p.y * across(p.level) + p.x; }
  Patch at(int64_t id) const;
  Patch parent(const Patch& p) const { return {p.level - 1, p.y >> branch_log2(), p.x >> branch_log2()}; }

  /// Horizontal edges (down + 1 lines of them), then vertical ones.
  int64_t edges(int level) const {
    return across(level) * (down(level) + 1) + (across(level) + 1) * down(level);
  }
  int64_t edge(const Patch& p, Edge e) const {
    const int64_t wide = across(p.level);
    if (e == kNorth || e == kSouth) return (p.y + (e == kSouth)) * wide + p.x;
    return wide * (down(p.level) + 1) + p.y * (wide + 1) + p.x + (e == kEast);
  }
  int64_t first_edge(int level) const {
    int64_t sum = 0;
    for (int l = 0; l < level; ++l) sum += edges(l);
    return sum;
  }

  int64_t row(const Patch& p) const { return p.y << side_log2(p.level); }
  int64_t col(const Patch& p) const { return p.x << side_log2(p.level); }
  /// Past its last cells: the first row and column of the next, or the field's last.
  int64_t end_row(const Patch& p) const { return std::min((p.y + 1) << side_log2(p.level), last_row()); }
  int64_t end_col(const Patch& p) const { return std::min((p.x + 1) << side_log2(p.level), last_col()); }
  /// Lattice lines (of the level's samples) that are there: a vertex at or past this one sits on the border.
  int clip_x(const Patch& p) const { return clip(last_col() - col(p), p.level); }
  int clip_y(const Patch& p) const { return clip(last_row() - row(p), p.level); }
  /// The sample of a lattice point of a patch.
  int64_t sample_row(const Patch& p, int v) const {
    return std::min(row(p) + (int64_t{v} << stride_log2(p.level)), last_row());
  }
  int64_t sample_col(const Patch& p, int u) const {
    return std::min(col(p) + (int64_t{u} << stride_log2(p.level)), last_col());
  }

 private:
  static int64_t count(int64_t length, int step_log2) {
    return std::max<int64_t>((length + (int64_t{1} << step_log2) - 1) >> step_log2, 1);
  }
  int clip(int64_t cells, int level) const {
    return static_cast<int>(std::min<int64_t>(count(cells, stride_log2(level)), segments()));
  }
};

inline Patch Layout::at(int64_t id) const {
  int level = 0;
  for (int64_t here = across(0) * down(0); id >= here; here = across(level) * down(level)) {
    id -= here;
    ++level;
  }
  return {level, id / across(level), id % across(level)};
}

}  // namespace lodlab::seamless
