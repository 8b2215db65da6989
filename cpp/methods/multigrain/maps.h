// SPDX-License-Identifier: MIT
// The maps of an opened store, colours and normals, and which of their tiles (map_tiles.h) a view needs: each
// has a resolution of its own at each node, whatever the node's grid. No GL.
#pragma once

#include <array>
#include <vector>

#include "geometry/view.h"
#include "methods/multigrain/hierarchy.h"
#include "methods/multigrain/map_tiles.h"
#include "methods/multigrain/multigrain.h"

namespace lodlab::multigrain {

constexpr size_t kMostMaps = 2;

struct Map {
  PageKind kind;
  MapTiles tiles;
};

/// A square of a node that is drawn from one tile of each map.
struct Patch {
  int32_t row, col;  ///< its first sample
  int size_log2;
  std::array<int64_t, kMostMaps> tile{-1, -1};  ///< by map; -1: out of sight
  /// Texels of the tile's level in the length of a pixel where the patch is nearest, as texels_per_pixel has
  /// it.
  std::array<double, kMostMaps> density{};
};

/// Where a patch lies in a tile (grid.vert): of its first sample; from one sample to the next.
struct MapPlace {
  float u, v, scale;
};

class Maps {
 public:
  explicit Maps(const Forest& forest);

  /// Colours, then normals, as far as the store has them.
  const std::vector<Map>& all() const { return maps_; }

  /// The patches of a node that is drawn with this stride: as many as it takes for each to have
  /// `texels_per_pixel` texels a pixel of every map where it is nearest, or all that there are. One patch,
  /// without tiles, for a node out of sight, and where there are no maps.
  void patches(uint32_t node, int stride_log2, const Camera& camera, double texels_per_pixel,
               std::vector<Patch>& out) const;
  /// `tile` covers the sample.
  MapPlace place(const Map& map, int64_t tile, int64_t row, int64_t col) const;

 private:
  const Forest& forest_;
  std::vector<Map> maps_;
};

}  // namespace lodlab::multigrain
