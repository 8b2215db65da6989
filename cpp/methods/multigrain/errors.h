// SPDX-License-Identifier: MIT
// Error bounds, kept by block (layout.h), from which those of all nodes at all resolutions follow.
//
// `own[a]`: the largest distance, over the block's samples (its border included), between source and surface
// drawn with stride 2^a whose edges are snapped to strides of at most 2^a: not at all, or from a finer
// stride. `strip(edge, a, b)`, a < b: the same within the row of cells beside this edge, drawn with stride
// 2^a and snapped along it to 2^b (to anything coarser than a and up to b), whatever the other edges do.
// Closures make them nest: both never grow when a becomes smaller, nor strip when b does;
// strip(edge, a, b) <= own[b]. Edges with nothing across are never snapped: their strips are 0.
//
// Distances are those that the instrument measures: vertical in a flat field, along the ray from the centre
// on a planet, at all samples, filled voids included. Strides beyond Layout::largest_stride_log2() are never
// drawn: their entries repeat it.
#pragma once

#include <cstdint>
#include <vector>

#include "base/progress.h"
#include "geometry/height_rows.h"
#include "methods/multigrain/layout.h"

namespace lodlab::multigrain {

struct BlockErrors {
  int strides = 0;               ///< block_log2 + 1
  std::vector<float> own;        ///< blocks x strides
  std::vector<float> strips;     ///< blocks x 4 edges x pairs (a < b), see pair()
  std::vector<float> low, high;  ///< heights of each block's samples

  /// Pairs a < b of a block with these strides, counted row by row of b.
  static int pairs(int strides) { return strides * (strides - 1) / 2; }
  static int pair(int a, int b) { return b * (b - 1) / 2 + a; }

  float own_error(int64_t block, int a) const { return own[static_cast<size_t>(block * strides + a)]; }
  float strip_error(int64_t block, int edge, int a, int b) const {
    return strips[static_cast<size_t>((block * 4 + edge) * pairs(strides) + pair(a, b))];
  }
};

enum class Bounds {
  kDrawn,     ///< of the triangles as they are drawn
  kBilinear,  ///< the paper's measure: heights against bilinear interpolation of the grid; strips are 0
};

/// For all blocks of a layout, 0 so far.
BlockErrors no_errors(const Layout& layout);

/// Measures blocks [first, end), all of whose rows, and those beyond (measure.h), are there. In parallel over
/// blocks; the same for any number of threads and any bands. Rounded up to float.
void measure_errors(const HeightRows& rows, const Layout& layout, Bounds bounds, int64_t first, int64_t end,
                    BlockErrors& out, const Progress& progress);

/// Of a field in memory.
BlockErrors measure_errors(const HeightField& field, const Layout& layout, Bounds bounds,
                           const Progress& progress);

}  // namespace lodlab::multigrain
