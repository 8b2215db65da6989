// SPDX-License-Identifier: MIT
// How a height field is cut into charts, charts into nodes, nodes into grids (Niski, Purnomo, Cohen 2007,
// sections 4 and 6). Everything is a power of two of cells, aligned to sample (0, 0); what lies past the last
// row or column is clamped onto it. A chart has a quadtree of `levels` levels; a node of level l and
// resolution k is drawn as 2^k cells a side with a stride of 2^(node_log2(l) - k) samples.
//
// Invariant (the paper's restriction, section 7.4): no stride is larger than a node of the last level, so
// that every corner of every node is a vertex of whatever lies beside it, and stitching never moves a corner.
#pragma once

#include <algorithm>
#include <cstdint>

namespace lodlab::multigrain {

enum Edge { kNorth = 0, kEast = 1, kSouth = 2, kWest = 3 };

/// Column and row among the blocks of a field; x < 0: none.
struct BlockAt {
  int x, y;
};

/// How blocks lie beside each other. stitch.h has the same for a vertex: there a call costs a tenth of a
/// frame's vertices.
struct BlockField {
  int blocks_x, blocks_y;
  bool wraps;  ///< the first blocks of a row lie beside the last ones

  BlockAt across(BlockAt b, Edge edge) const {
    if (edge == kNorth || edge == kSouth) {
      b.y += edge == kNorth ? -1 : 1;
      if (b.y < 0 || b.y == blocks_y) b.x = -1;
    } else {
      b.x += edge == kWest ? -1 : 1;
      if (b.x < 0) b.x = wraps ? blocks_x - 1 : -1;
      if (b.x == blocks_x) b.x = wraps ? 0 : -1;
    }
    return b;
  }
};

struct Layout {
  int64_t rows = 0, cols = 0;  ///< samples
  bool wraps = false;          ///< the last column is followed by the first
  bool pole_first = false, pole_last = false;
  /// A planet's border row on the equator's side of its patch: great circles between its samples bend away
  /// from it, into the patch, and leave a gap. A fringe of triangles fills it.
  bool fringe_first = false, fringe_last = false;
  int chart_log2 = 1;  ///< cells a side of a chart
  int levels = 1;
  int most_log2 = 8;  ///< cells a side of the finest grid

  int64_t last_row() const { return rows - 1; }
  /// As shaders/multigrain/stitch.h has it: 1, the first row is a pole; 2, the last one; 3, both.
  int poles() const { return (pole_first ? 1 : 0) + (pole_last ? 2 : 0); }
  /// The last column of vertices: of a planet that wraps it is column 0 come round again.
  int64_t last_col() const { return wraps ? cols : cols - 1; }

  int node_log2(int level) const { return chart_log2 - level; }
  /// The row that has a fringe; -1: none. Never both: the equator is on one side of either.
  int64_t fringe_row() const { return fringe_first ? 0 : fringe_last ? last_row() : -1; }
  /// Whether a square of 2^size_log2 cells from this row on reaches the fringe.
  bool has_fringe(int64_t row, int size_log2) const {
    return (fringe_first && row == 0) || (fringe_last && row + (int64_t{1} << size_log2) >= last_row());
  }
  /// Triangles of the fringe along such a square: a fan for each cell of the grid.
  int64_t fringe_triangles(int64_t row, int64_t col, int size_log2, int stride_log2) const {
    if (!has_fringe(row, size_log2)) return 0;
    return cells_x(col, size_log2, 0) - cells_x(col, size_log2, stride_log2);
  }
  /// Resolutions of a level: from least_resolution() to most_resolution(), both included.
  int least_resolution(int level) const { return std::max(1, levels - 1 - level); }
  int most_resolution(int level) const { return std::min(node_log2(level), most_log2); }
  int stride_log2(int level, int resolution) const { return node_log2(level) - resolution; }

  /// Blocks: nodes of the last level. Errors are kept by block; every node is made of whole ones.
  int block_log2() const { return node_log2(levels - 1); }
  /// The largest stride that anything is drawn with; every node has at least two cells a side.
  int largest_stride_log2() const { return levels == 1 ? block_log2() - 1 : block_log2(); }
  int64_t blocks_x() const { return count(last_col(), block_log2()); }
  int64_t blocks_y() const { return count(last_row(), block_log2()); }
  BlockField blocks() const { return {static_cast<int>(blocks_x()), static_cast<int>(blocks_y()), wraps}; }
  /// What lies across this edge of a block.
  BlockAt across(const BlockAt& block, Edge edge) const { return blocks().across(block, edge); }
  /// Whether a block does.
  bool meets(int64_t block_y, int64_t block_x, Edge edge) const {
    return across({static_cast<int>(block_x), static_cast<int>(block_y)}, edge).x >= 0;
  }
  int64_t charts_x() const { return count(last_col(), chart_log2); }
  int64_t charts_y() const { return count(last_row(), chart_log2); }
  /// Cells that really are there: grids are clamped at the border.
  int64_t cells_x(int64_t col, int size_log2, int stride_log2) const {
    return count(std::min(last_col() - col, int64_t{1} << size_log2), stride_log2);
  }
  int64_t cells_y(int64_t row, int size_log2, int stride_log2) const {
    return count(std::min(last_row() - row, int64_t{1} << size_log2), stride_log2);
  }

 private:
  static int64_t count(int64_t length, int step_log2) {
    return (length + (int64_t{1} << step_log2) - 1) >> step_log2;
  }
};

}  // namespace lodlab::multigrain
