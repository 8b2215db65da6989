// SPDX-License-Identifier: MIT
// Build of chunked LOD (Ulrich 2002, sections 9 to 14): grid and errors, the error of each level, edge
// envelopes, chunk meshes in parallel, then bounds that nest. No GL.
#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>

#include "base/errors.h"
#include "base/parallel.h"
#include "geometry/coverage.h"
#include "methods/chunked/chunked.h"
#include "methods/chunked/hierarchy.h"
#include "methods/chunked/texture.h"

namespace lodlab::chunked {
namespace {

/// Errors double from the last level but one to the roots; the last level has finest_error. The first
/// doubling starts where a chunk has `chunk_triangles` on average, and every level keeps to that.
Levels choose_levels(const Grid& grid, double finest_error, double chunk_triangles) {
  const Layout& layout = grid.layout();
  const Quantizer& q = grid.quantizer();
  const std::vector<int64_t> above = grid.count_by_class();
  const auto limit_of = [&](double delta) {
    return static_cast<float>(std::max(0.0, delta - q.residual) / q.quantum);
  };
  Levels levels;
  levels.delta.resize(static_cast<size_t>(layout.levels));
  levels.limit.resize(levels.delta.size());
  double delta = finest_error;
  for (int level = layout.levels - 1; level >= 0; --level) {
    if (level < layout.levels - 1) {
      const double side = layout.side(level);
      const double chunks = std::ceil(layout.width / side) * std::ceil(layout.height / side);
      // A kept vertex makes about two triangles.
      const auto target = static_cast<int64_t>(0.5 * chunk_triangles * chunks);
      const auto fits = std::find_if(above.begin(), above.end(), [&](int64_t n) { return n <= target; });
      const float limit =
          least_of_class(static_cast<size_t>(std::min(fits, above.end() - 1) - above.begin()));
      const double wanted = std::max(limit, 0.25f) * q.quantum + q.residual;
      delta = std::max(2.0 * delta, wanted);
    }
    levels.delta[static_cast<size_t>(level)] = delta;
    levels.limit[static_cast<size_t>(level)] = limit_of(delta);
  }
  return levels;
}

/// The quadtree over the chunks that overlap the field, breadth first.
std::vector<Node> make_nodes(const Layout& layout) {
  std::vector<Node> nodes;
  const auto add = [&](int32_t x, int32_t y, int level, int32_t parent) {
    if (x >= layout.width || y >= layout.height) return;
    Node node{};
    node.parent = parent;
    node.row = y;
    node.col = x;
    node.level = static_cast<uint16_t>(level);
    nodes.push_back(node);
  };
  for (int32_t y = 0; y < layout.roots_y; ++y) {
    for (int32_t x = 0; x < layout.roots_x; ++x) add(x * layout.root, y * layout.root, 0, -1);
  }
  for (size_t i = 0; i < nodes.size(); ++i) {
    const int level = nodes[i].level + 1;
    if (level == layout.levels) break;
    const int32_t side = layout.side(level), row = nodes[i].row, col = nodes[i].col;
    nodes[i].first_child = static_cast<uint32_t>(nodes.size());
    for (int c = 0; c < 4; ++c)
      add(col + (c & 1) * side, row + (c >> 1) * side, level, static_cast<int32_t>(i));
    nodes[i].children = static_cast<uint16_t>(nodes.size() - nodes[i].first_child);
  }
  return nodes;
}

Box leaf_samples(const HeightField& field, int32_t x, int32_t y, int32_t side) {
  Box box;
  const int64_t x1 = std::min<int64_t>(x + side, field.cols - 1),
                y1 = std::min<int64_t>(y + side, field.rows - 1);
  for (int64_t row = y; row <= y1; ++row) {
    const auto [low, high] =
        std::minmax_element(field.heights + row * field.cols + x, field.heights + row * field.cols + x1 + 1);
    box.lo.z = std::min<double>(box.lo.z, *low);
    box.hi.z = std::max<double>(box.hi.z, *high);
  }
  return box;
}

void set_bounds(Node& node, const Box& box) {
  for (int i = 0; i < 3; ++i) {
    node.lo[i] = box.lo[i];
    node.hi[i] = box.hi[i];
  }
}

/// Bottom-up: a parent's bounds hold its children; its error is at least theirs, and at least that of
/// its own surface as its children's rounded targets draw it.
void nest(std::vector<Node>& nodes, const std::vector<uint8_t>& rounded, double quantum) {
  for (size_t i = nodes.size(); i-- > 0;) {
    Node& node = nodes[i];
    double own = node.error;
    for (uint32_t c = node.first_child; c < node.first_child + node.children; ++c) {
      const Node& child = nodes[c];
      if (rounded[c]) own = std::max(own, node.error + 0.5 * quantum);
      for (int a = 0; a < 3; ++a) {
        node.lo[a] = std::min(node.lo[a], child.lo[a]);
        node.hi[a] = std::max(node.hi[a], child.hi[a]);
      }
    }
    for (uint32_t c = node.first_child; c < node.first_child + node.children; ++c)
      own = std::max(own, nodes[c].error);
    node.error = own;
  }
  for (Node& node : nodes)
    node.parent_error = node.parent < 0 ? node.error : nodes[static_cast<size_t>(node.parent)].error;
}

}  // namespace

void build(const HeightField& field, const Options& options, StoreWriter& writer, const Progress& progress) {
  const auto leaf = static_cast<int32_t>(options.integer("leaf"));
  if ((leaf & (leaf - 1)) != 0) {
    throw InvalidInput("chunked: option leaf = " + std::to_string(leaf) + " is not a power of two");
  }
  progress("errors", 0.0);
  const Layout layout = make_layout(field.rows, field.cols, leaf);
  const Grid grid(field, layout);
  const Quantizer& q = grid.quantizer();
  const Levels levels = choose_levels(grid, options.real("finest_error"),
                                      static_cast<double>(options.integer("chunk_triangles")));
  const Envelope envelope(grid, levels);
  std::vector<Node> nodes = make_nodes(layout);
  const TexturePyramid texture(options.text("attribute"), field, layout, levels, options.real("tau_max"));

  std::vector<uint8_t> rounded(nodes.size());
  std::atomic<uint32_t> largest{0};
  const auto count = static_cast<int64_t>(nodes.size());
  Count done(progress, "chunks", count);
  parallel_for(count, std::clamp<int64_t>(count / 64, 1, 16), [&](int64_t begin, int64_t end) {
    ChunkMesher mesher(grid, levels, envelope);
    for (int64_t i = begin; i < end; ++i) {
      Node& node = nodes[static_cast<size_t>(i)];
      const int32_t side = layout.side(node.level);
      const ChunkMesh& mesh = mesher.build(node.level, node.col, node.row);
      node.vertices = static_cast<uint32_t>(mesh.vertices.size());
      node.surface_vertices = mesh.surface_vertices;
      node.indices = static_cast<uint32_t>(mesh.indices.size());
      node.surface_indices = mesh.surface_indices;
      node.error = mesh.error;
      // With colours, a chunk counts as wrong as its level: the texel rule is written in these errors.
      if (texture.active()) node.error = std::max(node.error, levels.delta[node.level]);
      rounded[static_cast<size_t>(i)] = mesh.rounded;
      Box box = node.level + 1 == layout.levels ? leaf_samples(field, node.col, node.row, side) : Box{};
      box.lo.z = std::min(box.lo.z, q.height(mesh.low));
      box.hi.z = std::max(box.hi.z, q.height(mesh.high));
      const int64_t col = std::min<int64_t>(node.col + side, layout.width),
                    row = std::min<int64_t>(node.row + side, layout.height);
      box.lo.x = field.x0 + node.col * field.dx;
      box.hi.x = field.x0 + static_cast<double>(col) * field.dx;
      box.hi.y = field.y0 - node.row * field.dy;
      box.lo.y = field.y0 - static_cast<double>(row) * field.dy;
      set_bounds(node, box);
      uint32_t seen = largest.load();
      while (seen < node.vertices && !largest.compare_exchange_weak(seen, node.vertices)) {
      }
      if (!writer.has_page(kGeometry, i)) writer.put_page(kGeometry, i, encode_page(mesh));
      if (texture.active()) {
        node.texture_side = static_cast<uint16_t>(texture.side(node.level));
        if (!writer.has_page(kTexture, i))
          writer.put_page(kTexture, i, texture.page(node.level, node.row, node.col));
      }
    }
    done(end - begin);
  });
  nest(nodes, rounded, q.quantum);
  const double quantizer[2] = {q.quantum, static_cast<double>(q.base)};
  writer.put_array("nodes", as_bytes(nodes));
  writer.put_array("delta", as_bytes(levels.delta));
  writer.put_array("quantizer", std::as_bytes(std::span(quantizer)));
  writer.put_meta("index_bytes", largest.load() > 65535 ? "4" : "2");
  writer.put_meta("root_side", std::to_string(layout.root));
  if (!writer.has_page(kCoverage, 0)) writer.put_page(kCoverage, 0, coverage_bits(field));
}

}  // namespace lodlab::chunked
