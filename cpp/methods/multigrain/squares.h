// SPDX-License-Identifier: MIT
// Nodes as squares for maps: one with more texels than a tile is drawn as its children, or theirs, with the
// stride that it has: the same vertices and triangles.
#pragma once

#include <memory>
#include <vector>

#include "method/maps.h"
#include "methods/multigrain/hierarchy.h"

namespace lodlab::multigrain {

/// The smallest squares are nodes of the last level.
MapUser map_user(const Layout& layout);

/// Those of its store.
Maps maps_of(const Forest& forest);

class NodeSquares : public MapSquares {
 public:
  explicit NodeSquares(std::shared_ptr<const Forest> forest) : forest_(std::move(forest)) {}

  MapSquare whole(const CutNode& picked) const override;
  std::vector<MapSquare> parts(const MapSquare& square) const override;

 private:
  MapSquare square(uint32_t id, int stride_log2) const;

  std::shared_ptr<const Forest> forest_;
};

}  // namespace lodlab::multigrain
