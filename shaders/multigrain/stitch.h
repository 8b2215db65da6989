// SPDX-License-Identifier: MIT
// Where a vertex of a node's grid lies, written once: this file compiles as C++ and as GLSL.
// A vertex is a sample (column, row), never anything between. On an edge of its node beside a coarser stride it
// moves along the edge to the nearest vertex of that stride, halves towards the nearer end of its block: two
// neighbours draw one line, whatever their strides. Corners of nodes are multiples of every stride: they stay.
// Halves go to the nearer end because of the corner cells of a planet's last, clamped nodes, whose diagonal may
// miss the corner: there a vertex that left the corner would turn a triangle over.
//
// `stride_of(block_x, block_y)` gives log2 of the stride that a block is drawn with: an argument in C++, in GLSL a
// function declared before this file is included.
#ifndef LODLAB_STITCH_H
#define LODLAB_STITCH_H

#ifdef __cplusplus
#include <algorithm>
namespace lodlab::multigrain {
#define LODLAB_FUNCTION inline
#define LODLAB_TEMPLATE template <class StrideOf>
#define LODLAB_STRIDE_OF , const StrideOf& stride_of
using std::max;
using std::min;
#else
#define LODLAB_FUNCTION
#define LODLAB_TEMPLATE
#define LODLAB_STRIDE_OF
#endif

struct StitchField {
  int last_col, last_row;    // of vertices: a planet that wraps has column 0 again as its last
  int blocks_x, block_log2;  // blocks a row; samples a side
  int wraps;                 // 1: the first blocks lie beside the last ones
  int poles;                 // 1: the first row is a pole; 2: the last one; 3: both
};

struct StitchNode {
  int col, row;                // its first sample
  int size_log2, stride_log2;  // samples a side
};

struct StitchVertex {
  int col, row;
};

/// The multiple of 2^b nearest to t, halves towards the nearer end of t's block.
LODLAB_FUNCTION int stitch_snap(int t, int b, int block_log2) {
  int up = (t >> (block_log2 - 1)) & 1;
  return ((t + (((1 << b) - 1 + up) >> 1)) >> b) << b;
}

/// A vertex at t on an edge of a grid of stride 2^a beside one of stride 2^b. The last sample is a vertex of any.
LODLAB_FUNCTION int stitch_along(int t, int last, int a, int b, int block_log2) {
  return t == last ? t : min(stitch_snap(t, max(a, b), block_log2), last);
}

/// The same down an edge between poles: none of its vertices moves onto a pole, which it would share with those of
/// the opposite edge; the grid between them would be left standing there on end.
LODLAB_FUNCTION int stitch_down(int t, int last, int a, int b, int block_log2, int poles) {
  int row = stitch_along(t, last, a, b, block_log2), c = max(a, b);
  if ((poles & 1) != 0 && row == 0 && t > 0) row = min(1 << c, last);
  if ((poles & 2) != 0 && row == last && t < last) row = ((last - 1) >> c) << c;
  return row;
}

/// Vertex (i, j) of a node's grid, i to the east, j to the south.
LODLAB_TEMPLATE LODLAB_FUNCTION StitchVertex stitch(StitchNode node, int i, int j,
                                                    StitchField field LODLAB_STRIDE_OF) {
  int a = node.stride_log2, size = 1 << node.size_log2;
  int col = min(node.col + (i << a), field.last_col), row = min(node.row + (j << a), field.last_row);
  // The column or row of blocks across the edge; -1: not on such an edge, or nothing is there.
  int across_x = -1, across_y = -1;
  if (col == node.col) across_x = col > 0 ? (col >> field.block_log2) - 1 : field.wraps * field.blocks_x - 1;
  if (col == field.last_col) across_x = field.wraps - 1;
  if (col == node.col + size && col < field.last_col) across_x = col >> field.block_log2;
  if (row == node.row) across_y = (row >> field.block_log2) - 1;
  if (row == node.row + size && row < field.last_row) across_y = row >> field.block_log2;
  if (across_y >= 0) {  // a corner looks no further: it moves along neither edge
    int b = stride_of(min(col >> field.block_log2, field.blocks_x - 1), across_y);
    col = stitch_along(col, field.last_col, a, b, field.block_log2);
  } else if (across_x >= 0) {
    int b = stride_of(across_x, min(row, field.last_row - 1) >> field.block_log2);
    row = stitch_down(row, field.last_row, a, b, field.block_log2, field.poles);
  }
#ifdef __cplusplus
  return {col, row};
#else
  return StitchVertex(col, row);
#endif
}

#ifdef __cplusplus
#undef LODLAB_FUNCTION
#undef LODLAB_TEMPLATE
#undef LODLAB_STRIDE_OF
}  // namespace lodlab::multigrain
#endif
#endif
