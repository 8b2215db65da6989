// SPDX-License-Identifier: MIT
#include "method/map_paging.h"

#include <algorithm>

namespace lodlab {

namespace {

constexpr int64_t kMostLayers = 2048;  // of an array texture, on any device

/// Room, in tiles, that a texture of so many layers needs with what it grew from; and the layers that a room
/// allows.
int64_t slots_of(int64_t layers) { return layers + (layers + 3) / 4; }
int64_t layers_in(int64_t slots) { return slots * 4 / 5; }

}  // namespace

std::vector<Pool> map_pools(const Maps& maps) {
  std::vector<Pool> pools;
  for (const Map& map : maps.all()) {
    pools.push_back({map.tiles.bytes(), slots_of(std::min(map.tiles.count(), kMostLayers)),
                     slots_of(map.tiles.levels())});
  }
  return pools;
}

int64_t map_bytes(const Pool& pool) { return layers_in(pool.capacity / pool.slot) * pool.slot; }

MapPaging::MapPaging(std::unique_ptr<const MapSquares> squares, Maps maps, const Residency& heights,
                     const std::vector<int64_t>& bytes, double texels_per_pixel)
    : squares_(std::move(squares)),
      maps_(std::move(maps)),
      streams_(heights.streams()),
      texels_per_pixel_(texels_per_pixel),
      wants_(maps_.all().size()) {
  for (size_t i = 0; i < maps_.all().size(); ++i) {
    Residency::Setup setup;
    for (int64_t id = tiles(i).count(); id-- > 0;) setup.units.push_back({id, tiles(i).bytes()});
    setup.roots = 1;
    setup.kind = maps_.all()[i].kind;
    setup.capacity = bytes[i];
    setup.stream = streams_;
    pools_.emplace_back(heights, std::move(setup));
  }
}

void MapPaging::next_frame() {
  for (Residency& pool : pools_) pool.next_frame();
}

const std::vector<MapPatch>& MapPaging::patches(const CutNode& picked, const Camera& camera) {
  patches_.clear();
  maps_.patches(*squares_, squares_->whole(picked), camera, texels_per_pixel_, patches_);
  return patches_;
}

/// A tile is worth the length, in pixels, that a texel would have in its place: one of the next level.
/// Whether the patch's tile is there.
bool MapPaging::need(size_t map, const MapPatch& patch) {
  Residency& pool = pools_[map];
  const uint32_t first = unit(map, patch.tile[map]);
  double worth = 2.0 / (patch.density[map] * texels_per_pixel_);
  for (uint32_t at = first; at != kRoot && !pool.touched(at, worth); at = parent(map, at), worth *= 2.0) {
    pool.touch(at, worth);
    if (!pool.resident(at)) wants_[map].push_back({at, worth});
  }
  return pool.resident(first);
}

void MapPaging::select(const Camera& camera, Claim& claim) {
  if (!streams_ || count() == 0) return;
  for (CutNode& picked : claim.nodes) {
    if (!picked.visible) continue;
    bool there = true;
    for (const MapPatch& patch : patches(picked, camera)) {
      for (size_t i = 0; i < count() && patch.tile[i] >= 0; ++i) there &= need(i, patch);
    }
    if (there || picked.missing) continue;
    picked.missing = true;
    ++claim.missing_nodes;
  }
  for (size_t i = 0; i < count(); ++i) {
    // Patches share tiles: the last of equals is the most urgent.
    std::stable_sort(wants_[i].begin(), wants_[i].end(),
                     [](const Residency::Want& a, const Residency::Want& b) {
                       return a.unit != b.unit ? a.unit < b.unit : a.priority > b.priority;
                     });
    const auto same = [](const Residency::Want& a, const Residency::Want& b) { return a.unit == b.unit; };
    wants_[i].erase(std::unique(wants_[i].begin(), wants_[i].end(), same), wants_[i].end());
    pools_[i].want(std::move(wants_[i]));
    wants_[i].clear();
  }
}

}  // namespace lodlab
