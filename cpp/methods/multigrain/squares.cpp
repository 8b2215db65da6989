// SPDX-License-Identifier: MIT
#include "methods/multigrain/squares.h"

namespace lodlab::multigrain {

MapUser map_user(const Layout& layout) {
  return {"multigrain", layout.block_log2(), "take more levels or smaller charts"};
}

Maps maps_of(const Forest& forest) { return {*forest.store, forest.frame, forest.layout.block_log2()}; }

MapSquare NodeSquares::square(uint32_t id, int stride_log2) const {
  const Node& n = forest_->node[id];
  const Box box{{n.lo[0], n.lo[1], n.lo[2]}, {n.hi[0], n.hi[1], n.hi[2]}};
  return {n.row, n.col, forest_->layout.node_log2(n.level), box, id, stride_log2};
}

MapSquare NodeSquares::whole(const CutNode& picked) const {
  return square(picked.node,
                forest_->stride_log2(forest_->node[picked.node], static_cast<int>(picked.resolution)));
}

/// Each has at least two cells a side, as nodes have.
std::vector<MapSquare> NodeSquares::parts(const MapSquare& whole) const {
  std::vector<MapSquare> out;
  if (whole.size_log2 - 1 <= whole.least_log2) return out;
  const Node& node = forest_->node[whole.node];
  for (uint32_t child = node.first_child; child < node.first_child + node.children; ++child)
    out.push_back(square(child, whole.least_log2));
  return out;
}

}  // namespace lodlab::multigrain
