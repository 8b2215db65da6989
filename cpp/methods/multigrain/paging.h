// SPDX-License-Identifier: MIT
// What of a forest's heights is where. The unit is a tile; its parent is the one of twice the stride that
// covers it, and the roots, which are locked, are the tiles of all nodes at their least resolution. A
// resident tile's parents are resident, so a node can be drawn at every resolution up to its finest one.
#pragma once

#include <memory>
#include <vector>

#include "base/options.h"
#include "method/paging_options.h"
#include "method/residency.h"
#include "methods/multigrain/hierarchy.h"
#include "methods/multigrain/tiles.h"

namespace lodlab::multigrain {

class Paging {
 public:
  /// With the draw options stream, cpu_cache_mb, gpu_cache_mb and fetch_delay_ms. InvalidInput when a cache
  /// cannot hold the roots and, on the GPU, one path from them to a tile of stride 1, and of each map.
  Paging(const std::shared_ptr<const Forest>& forest, const Options& options);

  Residency& residency() { return residency_; }
  const Residency& residency() const { return residency_; }
  bool streams() const { return residency_.streams(); }
  const Tiles& tiles() const { return tiles_; }
  /// All tiles take the same room in the buffer, so that it can be parted anywhere between two.
  int64_t slot_bytes() const { return slot_bytes_; }
  /// Of a vertex in it: a height, on a planet a position (lattice.h).
  int64_t vertex_bytes() const { return vertex_bytes_; }

  /// Units count tiles from the last one, so that parents come first.
  uint32_t unit(const Node& n, int k) const {
    return unit_of(tiles_.id(forest_->stride_log2(n, k), n.row, n.col));
  }
  Tile tile(uint32_t unit) const { return tiles_.at(tiles_.count() - 1 - unit); }
  uint32_t roots() const { return roots_; }
  /// Of a unit that is no root.
  uint32_t parent(uint32_t unit) const { return parent_[unit]; }

  /// The finest resolution that a node can be drawn with now.
  int available(const Node& n) const {
    int k = n.most;
    while (k > n.least && !residency_.resident(unit(n, k))) --k;
    return k;
  }
  /// Marks a tile and its parents as used in this frame; its worth is the projected error that the next
  /// coarser one would have in its place.
  void touch(uint32_t unit, double worth) {
    for (; unit >= roots_ && !residency_.touched(unit, worth); unit = parent_[unit])
      residency_.touch(unit, worth);
  }
  /// Bytes of GPU memory that tiles of each map may take (method/maps.h).
  const std::vector<int64_t>& map_bytes() const { return map_bytes_; }
  /// Where a tile is in the buffer, bytes; -1: not there.
  int64_t offset(uint32_t unit) const { return residency_.offset(unit); }
  /// Makes a tile resident (Residency::admit).
  std::optional<Residency::Upload> admit(uint32_t unit, bool wait, double worth) {
    std::vector<uint32_t> dropped;  // nothing is kept of a tile but its place
    return residency_.admit(unit, wait, dropped, worth);
  }
  /// In this frame's list of what the loader is asked for, if it is not there; then used.
  void need(uint32_t unit, double priority) {
    if (residency_.resident(unit)) {
      touch(unit, priority);
    } else {
      wants_.push_back({unit, priority});
    }
  }
  /// Hands the list over.
  void ask();

 private:
  struct Plan {
    Residency::Setup setup;
    std::vector<int64_t> map_bytes;
  };
  static Plan plan(const std::shared_ptr<const Forest>& forest, const Options& options);
  Paging(const std::shared_ptr<const Forest>& forest, Plan plan);
  uint32_t unit_of(int64_t tile) const { return static_cast<uint32_t>(tiles_.count() - 1 - tile); }

  std::shared_ptr<const Forest> forest_;
  Tiles tiles_;
  int64_t slot_bytes_, vertex_bytes_;
  uint32_t roots_;
  std::vector<uint32_t> parent_;
  Residency residency_;
  std::vector<int64_t> map_bytes_;
  std::vector<Residency::Want> wants_;
};

}  // namespace lodlab::multigrain
