// SPDX-License-Identifier: MIT
#include "methods/multigrain/paging.h"

#include <algorithm>
#include <set>

#include "base/errors.h"
#include "method/map_paging.h"
#include "method/sample_code.h"
#include "methods/multigrain/grids.h"
#include "methods/multigrain/lattice.h"
#include "methods/multigrain/multigrain.h"
#include "methods/multigrain/squares.h"
#include "render/surface.h"

namespace lodlab::multigrain {
namespace {

/// Vertices of a tile on the GPU: whole strips (grids.h).
int64_t strip_vertices(const Tile& tile) { return strips(tile.cols) * tile.rows * kStripPitch; }

/// A tile's vertices, row by row, put into strips. What lies past the last strip's end is never drawn.
template <class Vertex>
Bytes in_strips(const Tile& tile, const std::vector<Vertex>& rows) {
  std::vector<Vertex> out(static_cast<size_t>(strip_vertices(tile)));
  auto to = out.begin();
  for (int64_t first = 0; first + 1 < tile.cols; first += kStrip) {
    const int64_t count = std::min(kStripPitch, tile.cols - first);
    for (int64_t j = 0; j < tile.rows; ++j, to += kStripPitch) {
      std::copy_n(rows.begin() + (j * tile.cols + first), count, to);
    }
  }
  const auto bytes = as_bytes(out);
  return Bytes(bytes.begin(), bytes.end());
}

/// A height, or a position on a planet's lattice.
int64_t bytes_of_vertex(const FieldFrame& frame) {
  return static_cast<int64_t>(frame.planet ? sizeof(Lattice::Position) : sizeof(float));
}

/// Places at which nodes of a level begin along one axis, one for each kind of grid that can occur there: at
/// either end, between, and where the last tile begins.
std::vector<int64_t> kinds_of_place(int64_t last, int size_log2, int tile_log2) {
  const auto begin = [&](int64_t at, int log2) { return at >> log2 << log2; };
  const int64_t size = int64_t{1} << size_log2;
  std::vector<int64_t> places{0, size, begin(begin(last - 1, tile_log2), size_log2),
                              begin(last - 1, size_log2)};
  std::erase_if(places, [&](int64_t at) { return at >= last; });
  return places;
}

/// The most that grids, instances and the map of strides can take on the GPU, and what the field does.
int64_t bytes_beside_tiles(const Forest& forest, const Tiles& tiles, size_t maps) {
  const Layout& layout = forest.layout;
  std::set<Shape> shapes;
  std::set<std::pair<int64_t, int>> fringes;
  int64_t indices = 0;
  for (int level = 0; level < layout.levels; ++level) {
    const int size = layout.node_log2(level);
    // With maps a node is drawn as patches, which are smaller than a node may be.
    for (int k = maps > 0 ? 1 : layout.least_resolution(level); k <= layout.most_resolution(level); ++k) {
      const int a = layout.stride_log2(level, k), tile_log2 = a + tiles.side_log2();
      for (const int64_t row : kinds_of_place(layout.last_row(), size, tile_log2)) {
        for (const int64_t col : kinds_of_place(layout.last_col(), size, tile_log2)) {
          const bool first = layout.pole_first && row == 0;
          const bool last = layout.pole_last && row + (int64_t{1} << size) >= layout.last_row();
          const int64_t fans = layout.fringe_triangles(row, col, size, a);
          if (fans > 0 && fringes.insert({layout.cells_x(col, size, 0), a}).second) indices += 3 * fans;
          const int64_t x = layout.cells_x(col, size, a), y = layout.cells_y(row, size, a);
          const int64_t rows = x > kStrip ? tiles.at(tiles.id(a, row, col)).rows : 0;
          if (shapes.insert({x, y, rows, first, last}).second) indices += 3 * x * (2 * y - first - last);
        }
      }
    }
  }
  const bool border = layout.fringe_row() >= 0;
  const int64_t per_node =  // instance, commands; buffers may double
      2 * ((border ? 64 : 44) + 16 * static_cast<int64_t>(maps));
  const int64_t fringe = border ? bytes_of_vertex(forest.frame) * (layout.last_col() + 1) : 0;
  return 4 * indices + fringe + per_node * static_cast<int64_t>(forest.node.size()) +
         render::Surface::bytes_of(forest.frame, !forest.coverage().empty()) +
         layout.blocks_x() * layout.blocks_y() + 3;
}

}  // namespace

Paging::Plan Paging::plan(const std::shared_ptr<const Forest>& forest, const Options& options) {
  const Tiles tiles(forest->layout);
  const Maps maps = maps_of(*forest);
  const Layout& layout = forest->layout;
  Residency::Setup setup;
  int64_t slot = 0;
  for (int64_t id = 0; id < tiles.count(); ++id) slot = std::max(slot, strip_vertices(tiles.at(id)));
  slot *= bytes_of_vertex(forest->frame);
  for (int64_t id = tiles.count(); id-- > 0;) setup.units.push_back({id, slot});
  const int path = std::max(layout.block_log2() - 1, 0);  // log2 of the finest stride that is locked
  setup.roots = static_cast<uint32_t>(tiles.count() - tiles.id(path, 0, 0));
  setup.kind = kHeights;
  const PagingOptions caches = paging_of(options);
  setup.stream = caches.stream;
  setup.cpu_bytes = caches.cpu_bytes;
  setup.fetch_delay = caches.fetch_delay;
  setup.decode = [tiles, maps, frame = forest->frame](int kind, int64_t id, Bytes stored) {
    if (auto texels = maps.decode(kind, id, stored)) return *std::move(texels);
    const Tile tile = tiles.at(id);
    std::vector<float> heights(static_cast<size_t>(tile.samples()));
    decode_samples(stored, heights.data(), static_cast<int64_t>(heights.size()));
    if (frame.planet) return in_strips(tile, Lattice(frame).positions(tiles, tile, heights));
    return in_strips(tile, heights);
  };
  const auto refuse = [](const std::string& what, const char* option, int64_t least, int64_t given) {
    throw InvalidInput("multigrain: " + what + " need " + option + " of at least " +
                       std::to_string((least + (1 << 20) - 1) >> 20) + ", not " +
                       std::to_string(given >> 20));
  };
  std::vector<Pool> pools{{slot, tiles.count(), setup.roots + int64_t{path}}};
  int64_t roots = std::max<int64_t>(setup.roots, 1) * slot;
  for (const Pool& pool : map_pools(maps)) {
    pools.push_back(pool);
    roots += pool.slot;
  }
  const std::string texels = maps.all().empty() ? "" : ", those of the maps";
  const int64_t beside = bytes_beside_tiles(*forest, tiles, maps.all().size());
  const int64_t least = beside + least_of(pools);
  if (least > caches.gpu_bytes) {
    refuse("the coarsest heights, a path to the finest" + texels + ", and the grids", "gpu_cache_mb", least,
           caches.gpu_bytes);
  }
  if (roots > setup.cpu_bytes)
    refuse("the coarsest heights" + texels, "cpu_cache_mb", roots, setup.cpu_bytes);
  part_room(caches.gpu_bytes - beside, pools);
  setup.capacity = pools[0].capacity;
  Plan plan{std::move(setup), {}};
  for (size_t i = 1; i < pools.size(); ++i) plan.map_bytes.push_back(lodlab::map_bytes(pools[i]));
  return plan;
}

Paging::Paging(const std::shared_ptr<const Forest>& forest, const Options& options)
    : Paging(forest, plan(forest, options)) {}

Paging::Paging(const std::shared_ptr<const Forest>& forest, Plan plan)
    : forest_(forest),
      tiles_(forest->layout),
      slot_bytes_(plan.setup.units[0].bytes),
      vertex_bytes_(bytes_of_vertex(forest->frame)),
      roots_(plan.setup.roots),
      parent_(plan.setup.units.size()),
      residency_(forest->store, std::move(plan.setup)),
      map_bytes_(std::move(plan.map_bytes)) {
  for (uint32_t i = roots_; i < parent_.size(); ++i) {
    const Tile fine = tile(i);
    parent_[i] = unit_of(tiles_.id(fine.stride_log2 + 1, fine.row, fine.col));
  }
}

/// Nodes share tiles: each is asked for once, as urgently as any of them needs it.
void Paging::ask() {
  std::sort(wants_.begin(), wants_.end(), [](const Residency::Want& a, const Residency::Want& b) {
    return a.unit != b.unit ? a.unit < b.unit : a.priority > b.priority;
  });
  const auto same = [](const Residency::Want& a, const Residency::Want& b) { return a.unit == b.unit; };
  wants_.erase(std::unique(wants_.begin(), wants_.end(), same), wants_.end());
  residency_.want(std::move(wants_));
  wants_.clear();
}

}  // namespace lodlab::multigrain
