// SPDX-License-Identifier: MIT
// From what was measured to what is kept of edges (codes.h): bounds that nest, and weights for claim 1.
//
// Bounds. Of an edge: low >= mid >= the finest one on both sides, which is the largest `low` of the child
// edges in the region of the tile, and at the last level `last_error`. So neither a split nor a refinement
// raises a bound. Each covers what was measured.
// Weights. Of the edges of a patch none is below half of another, and none of a child edge is above that of
// the edge that it lies on: what claim 1 needs. A weight is at least 2^k bound / length for every resolution.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "methods/seamless/hierarchy.h"
#include "methods/seamless/layout.h"
#include "methods/seamless/measure.h"

namespace lodlab::seamless {

/// Calls visit(edge, inner) for the edges of a patch's children that lie in the region of its tile at e: the
/// parts of e itself, and those inside. `edge` counts as Layout::edge of the next level. What lies past the
/// clamped border is not there.
template <class Visit>
void for_child_edges(const Layout& layout, const Patch& p, Edge e, const Visit& visit) {
  const int level = p.level + 1;
  const int64_t parts = int64_t{1} << layout.branch_log2();
  const int64_t across = layout.across(level), down = layout.down(level);
  const bool level_edge = e == kNorth || e == kSouth, last = e == kSouth || e == kEast;
  // i counts along e, j from e inwards.
  const int64_t along = (level_edge ? p.x : p.y) * parts;
  const int64_t line = (level_edge ? p.y : p.x) * parts + (last ? parts : 0);
  const auto horizontal = [&](int64_t y, int64_t x, bool inner) {
    if (y <= down && x < across) visit(layout.edge({level, y, x}, kNorth), inner);
  };
  const auto vertical = [&](int64_t y, int64_t x, bool inner) {
    if (y < down && x <= across) visit(layout.edge({level, y, x}, kWest), inner);
  };
  for (int64_t j = 0; j < parts / 2; ++j) {
    const int64_t inward = last ? line - j : line + j;
    for (int64_t i = j; i < parts - j; ++i) {
      if (level_edge) {
        horizontal(inward, along + i, j > 0);
      } else {
        vertical(along + i, inward, j > 0);
      }
    }
  }
  for (int64_t i = 1; i < parts; ++i) {
    for (int64_t j = 0; j < std::min(i, parts - i); ++j) {
      const int64_t inward = last ? line - 1 - j : line + j;
      if (level_edge) {
        vertical(inward, along + i, true);
      } else {
        horizontal(along + i, inward, true);
      }
    }
  }
}

/// As in the store (seamless.h).
struct Closed {
  std::vector<uint16_t> codes;
  double largest_weight = 0.0, last_error = 0.0;
  std::vector<double> typical;
};
Closed close_errors(const Layout& layout, const std::vector<Level>& levels, const PatchErrors& errors);

}  // namespace lodlab::seamless
