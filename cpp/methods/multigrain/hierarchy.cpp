// SPDX-License-Identifier: MIT
// The forest: its nodes from a layout, and the bounds of what is drawn from the errors of blocks.
#include "methods/multigrain/hierarchy.h"

#include <algorithm>

#include "base/errors.h"
#include "method/sample_code.h"
#include "methods/multigrain/lattice.h"
#include "methods/multigrain/multigrain.h"
#include "methods/multigrain/session.h"
#include "methods/multigrain/tiles.h"

namespace lodlab::multigrain {
namespace {

/// The blocks of a node, from (y0, x0) up to (y1, x1), not included.
struct BlockRange {
  int64_t y0, x0, y1, x1;

  BlockRange(const Layout& layout, const Node& n) {
    const int log2 = layout.block_log2(), side = layout.levels - 1 - n.level;
    y0 = n.row >> log2;
    x0 = n.col >> log2;
    y1 = std::min(y0 + (int64_t{1} << side), layout.blocks_y());
    x1 = std::min(x0 + (int64_t{1} << side), layout.blocks_x());
  }
};

/// Calls visit(block, edge, block across) for all blocks along the node's edges that have one across.
template <class Visit>
void for_edges(const Layout& layout, const Node& n, const Visit& visit) {
  const BlockRange r(layout, n);
  const int64_t pitch = layout.blocks_x();
  const auto look = [&](Edge edge, int64_t y, int64_t x) {
    const BlockAt beside = layout.across({static_cast<int>(x), static_cast<int>(y)}, edge);
    if (beside.x >= 0) visit(y * pitch + x, edge, beside.y * pitch + beside.x);
  };
  for (int64_t x = r.x0; x < r.x1; ++x) {
    look(kNorth, r.y0, x);
    look(kSouth, r.y1 - 1, x);
  }
  for (int64_t y = r.y0; y < r.y1; ++y) {
    look(kWest, y, r.x0);
    look(kEast, y, r.x1 - 1);
  }
}

void check_linked(const Forest& f, const std::string& path) {
  for (size_t i = 0; i < f.node.size(); ++i) {
    const Node& n = f.node[i];
    const bool linked =
        n.parent < static_cast<int32_t>(i) && n.level < f.layout.levels && n.least <= n.most &&
        n.first_resolution + size_t{n.most} - n.least < f.resolution.size() &&
        (n.children == 0 || (n.first_child > i && n.first_child + n.children <= f.node.size()));
    if (!linked)
      throw StoreError("multigrain: node " + std::to_string(i) + " of " + path + " is not a forest's");
  }
}

}  // namespace

std::vector<Node> make_nodes(const Layout& layout) {
  std::vector<Node> nodes;
  uint32_t resolutions = 0;
  const auto add = [&](int64_t row, int64_t col, int level, int32_t parent) {
    if (row >= layout.last_row() || col >= layout.last_col()) return;
    Node node{};
    node.row = static_cast<int32_t>(row);
    node.col = static_cast<int32_t>(col);
    node.parent = parent;
    node.level = static_cast<uint8_t>(level);
    node.least = static_cast<uint8_t>(layout.least_resolution(level));
    node.most = static_cast<uint8_t>(layout.most_resolution(level));
    node.first_resolution = resolutions;
    resolutions += 1u + node.most - node.least;
    nodes.push_back(node);
  };
  for (int64_t y = 0; y < layout.charts_y(); ++y) {
    for (int64_t x = 0; x < layout.charts_x(); ++x)
      add(y << layout.chart_log2, x << layout.chart_log2, 0, -1);
  }
  for (size_t i = 0; i < nodes.size(); ++i) {
    const int level = nodes[i].level + 1;
    if (level == layout.levels) break;
    const int64_t side = int64_t{1} << layout.node_log2(level), row = nodes[i].row, col = nodes[i].col;
    nodes[i].first_child = static_cast<uint32_t>(nodes.size());
    for (int c = 0; c < 4; ++c)
      add(row + (c >> 1) * side, col + (c & 1) * side, level, static_cast<int32_t>(i));
    nodes[i].children = static_cast<uint8_t>(nodes.size() - nodes[i].first_child);
  }
  return nodes;
}

int64_t triangle_count(const Layout& layout, const Node& n, int resolution) {
  const int size = layout.node_log2(n.level), a = layout.stride_log2(n.level, resolution);
  const int64_t x = layout.cells_x(n.col, size, a), y = layout.cells_y(n.row, size, a);
  const bool first = layout.pole_first && n.row == 0;
  const bool last = layout.pole_last && n.row + (int64_t{1} << size) >= layout.last_row();
  return x * (2 * y - first - last) + layout.fringe_triangles(n.row, n.col, size, a);
}

Forest::Forest(std::shared_ptr<const Store> opened)
    : store(std::move(opened)),
      frame(frame_from_json(store->meta().frame)),
      node(store->array_of<Node>("nodes")),
      resolution(store->array_of<Resolution>("resolutions")) {
  const std::vector<int32_t> shape = store->array_of<int32_t>("layout");
  if (shape.size() != 3 || node.empty()) throw StoreError("multigrain: " + store->path() + " holds no nodes");
  layout = make_layout(frame, shape[0], shape[1], shape[2]);
  errors.strides = layout.block_log2() + 1;
  errors.own = store->array_of<float>("own");
  errors.strips = store->array_of<float>("strips");
  const auto blocks = static_cast<size_t>(layout.blocks_x() * layout.blocks_y());
  const auto pairs = static_cast<size_t>(BlockErrors::pairs(errors.strides));
  if (errors.own.size() != blocks * static_cast<size_t>(errors.strides) ||
      errors.strips.size() != blocks * 4 * pairs)
    throw StoreError("multigrain: " + store->path() + " does not hold the errors of its blocks");
  check_linked(*this, store->path());
  if (frame.planet) {
    errors.high = store->array_of<float>("high");
    if (errors.high.size() != blocks)
      throw StoreError("multigrain: " + store->path() + " does not hold the heights of its blocks");
    occluder = make_occluder(*this);
    if (layout.fringe_row() >= 0) fringe = store->array_of<float>("fringe");
    if (layout.fringe_row() >= 0 && fringe.size() != static_cast<size_t>(frame.cols))
      throw StoreError("multigrain: " + store->path() + " does not hold the samples of its border row");
  }
  roots = static_cast<uint32_t>(layout.charts_x() * layout.charts_y());
}

/// A node's own edges are fewer than its children's: rows are raised to those of the children at equal
/// stride.
std::vector<NodeInfo> Forest::nodes() const {
  std::vector<NodeInfo> rows;
  rows.reserve(resolution.size());
  for (size_t i = 0; i < node.size(); ++i) {
    const Node& n = node[i];
    const Box box{{n.lo[0], n.lo[1], n.lo[2]}, {n.hi[0], n.hi[1], n.hi[2]}};
    for (int k = n.least; k <= n.most; ++k) {
      rows.push_back(
          {static_cast<int64_t>(i), n.parent, n.level, k, at(n, k).triangles, stored_error(n, k), box});
    }
  }
  for (size_t i = node.size(); i-- > 0;) {
    const Node& n = node[i];
    if (n.parent < 0) continue;
    const Node& above = node[static_cast<size_t>(n.parent)];
    for (int k = std::max<int>(above.least, n.least + 1); k <= std::min<int>(above.most, n.most + 1); ++k) {
      NodeInfo& row = rows[above.first_resolution + static_cast<uint32_t>(k - above.least)];
      row.error =
          std::max(row.error, rows[n.first_resolution + static_cast<uint32_t>(k - 1 - n.least)].error);
    }
  }
  return rows;
}

/// Of the last level at its finest; samples that two nodes share count for the eastern and southern one.
int64_t Forest::vertices() const {
  int64_t sum = 0;
  for (const Node& n : node) {
    if (n.level + 1 < layout.levels) continue;
    const int size = layout.node_log2(n.level), a = stride_log2(n, n.most);
    const int64_t side = int64_t{1} << size;
    const bool last_x = n.col + side >= layout.last_col() && !layout.wraps;
    const bool last_y = n.row + side >= layout.last_row();
    const int64_t x = layout.cells_x(n.col, size, a) + last_x, y = layout.cells_y(n.row, size, a) + last_y;
    sum += x * (y - (layout.pole_first && n.row == 0) - (layout.pole_last && last_y));
  }
  return sum + layout.pole_first + layout.pole_last;
}

double Forest::quantum() const { return frame.planet ? Lattice(frame).quantum() : 0.0; }

std::unique_ptr<Session> Forest::session(const Options& draw_options) const {
  return std::make_unique<MultigrainSession>(shared_from_this(), draw_options);
}

std::vector<float> Forest::tile(int64_t id) const {
  std::vector<float> heights(static_cast<size_t>(Tiles(layout).at(id).samples()));
  decode_samples(store->page(kHeights, id), heights.data(), static_cast<int64_t>(heights.size()));
  return heights;
}

Bytes Forest::coverage() const { return store->has_page(kCoverage, 0) ? store->page(kCoverage, 0) : Bytes(); }

double Forest::drawn_error(const Node& n, int k, const StrideMap& map) const {
  const int a = stride_log2(n, k);
  float worst = at(n, k).error;
  for_edges(layout, n, [&](int64_t block, Edge edge, int64_t across) {
    const int b = map[static_cast<size_t>(across)];
    if (b > a) worst = std::max(worst, errors.strip_error(block, edge, a, b));
  });
  return worst;
}

double Forest::stored_error(const Node& n, int k) const {
  const int a = stride_log2(n, k), b = layout.largest_stride_log2();
  float worst = at(n, k).error;
  for_edges(layout, n, [&](int64_t block, Edge edge, int64_t) {
    if (b > a) worst = std::max(worst, errors.strip_error(block, edge, a, b));
  });
  return worst;
}

void Forest::mark(const Node& n, int k, StrideMap& map) const {
  const BlockRange r(layout, n);
  const auto stride = static_cast<uint8_t>(stride_log2(n, k));
  for (int64_t y = r.y0; y < r.y1; ++y) {
    const auto line = map.begin() + y * layout.blocks_x();
    std::fill(line + r.x0, line + r.x1, stride);
  }
}

}  // namespace lodlab::multigrain
