// SPDX-License-Identifier: MIT
// Which tiles of the maps are in GPU memory, and which to load next: by the loader, the queue and the cache
// in main memory that heights have. A tile's parent is the one of the next level that covers it; the
// coarsest, which covers all, is locked, and a resident tile's parents are resident. Until a tile is there
// the finest resident one above it stands in. No GL.
#pragma once

#include <memory>
#include <vector>

#include "method/maps.h"
#include "method/pools.h"
#include "method/residency.h"

namespace lodlab {

/// What the tiles of each map need of the GPU's memory: room for the array texture and for the one that it
/// grows from.
std::vector<Pool> map_pools(const Maps& maps);
/// Bytes of the tiles that such a pool has room for.
int64_t map_bytes(const Pool& pool);

class MapPaging {
 public:
  /// `heights` has the loader; `bytes` of GPU memory for the tiles of each map.
  MapPaging(std::unique_ptr<const MapSquares> squares, Maps maps, const Residency& heights,
            const std::vector<int64_t>& bytes, double texels_per_pixel);

  const Maps& maps() const { return maps_; }
  size_t count() const { return pools_.size(); }
  bool streams() const { return streams_; }
  double texels_per_pixel() const { return texels_per_pixel_; }
  Residency& residency(size_t map) { return pools_[map]; }
  void next_frame();
  /// While streaming: what the cut draws is used, what it would draw is asked for, and nodes for which
  /// anything stands in are marked as missing.
  void select(const Camera& camera, Claim& claim);

  /// The patches of a picked node. Valid until the next call.
  const std::vector<MapPatch>& patches(const CutNode& picked, const Camera& camera);
  /// Units count tiles from the last one, so that parents come first.
  uint32_t unit(size_t map, int64_t tile) const {
    return static_cast<uint32_t>(tiles(map).count() - 1 - tile);
  }
  int64_t tile(size_t map, uint32_t unit) const {
    return tiles(map).count() - 1 - static_cast<int64_t>(unit);
  }
  uint32_t parent(size_t map, uint32_t child) const { return unit(map, tiles(map).parent(tile(map, child))); }
  static constexpr uint32_t kRoot = 0;

 private:
  const MapTiles& tiles(size_t map) const { return maps_.all()[map].tiles; }
  bool need(size_t map, const MapPatch& patch);

  std::unique_ptr<const MapSquares> squares_;
  Maps maps_;
  bool streams_;
  double texels_per_pixel_;
  std::vector<Residency> pools_;                     ///< by map
  std::vector<std::vector<Residency::Want>> wants_;  ///< by map
  std::vector<MapPatch> patches_;
};

}  // namespace lodlab
