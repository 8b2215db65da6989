// SPDX-License-Identifier: MIT
// Patches as squares for maps: one with more texels than a tile is cut into squares, whose sides none of its
// triangles crosses, whatever its resolutions: the same vertices and triangles.
#pragma once

#include <memory>
#include <vector>

#include "method/maps.h"
#include "methods/seamless/hierarchy.h"

namespace lodlab::seamless {

/// The smallest squares are those of the last level.
MapUser map_user(const Layout& layout);

/// Those of its store.
Maps maps_of(const Hierarchy& hierarchy);

class PatchSquares : public MapSquares {
 public:
  explicit PatchSquares(std::shared_ptr<const Hierarchy> hierarchy) : hierarchy_(std::move(hierarchy)) {}

  MapSquare whole(const CutNode& picked) const override;
  std::vector<MapSquare> parts(const MapSquare& square) const override;

 private:
  MapSquare square(int64_t row, int64_t col, int size_log2, uint32_t node, int least_log2) const;

  std::shared_ptr<const Hierarchy> hierarchy_;
};

}  // namespace lodlab::seamless
