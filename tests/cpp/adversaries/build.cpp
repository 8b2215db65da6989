// SPDX-License-Identifier: MIT
// Meshes and bounds of the family. A bound is found by going through the samples of every triangle as it is
// drawn: the surface is linear in between, and so is the source, over parts of the same cells.
#include <algorithm>
#include <cmath>

#include "family.h"
#include "geometry/coverage.h"

namespace lodlab::adversaries {
namespace {

enum PageKind : int { kHeights = 0, kCoverage = 1 };

int64_t nodes_across(const FieldFrame& frame) { return (frame.cols - 2) / kSide + 1; }
int64_t node_count(const FieldFrame& frame) { return nodes_across(frame) * ((frame.rows - 2) / kSide + 1); }

/// The cells of a node.
struct Lattice {
  int down, across;

  /// The vertex that stands for a point: odd ones on the sides are moved, but for the last.
  uint32_t vertex(int row, int col) const {
    if ((row == 0 || row == down) && col != across) col -= col % 2;
    if ((col == 0 || col == across) && row != down) row -= row % 2;
    return static_cast<uint32_t>(row * (across + 1) + col);
  }
};

void add_triangle(Mesh& mesh, uint32_t a, uint32_t b, uint32_t c) {
  if (a != b && b != c && c != a) mesh.indices.insert(mesh.indices.end(), {a, b, c});
}

/// Twice the area of a triangle of lattice points, positive when counter-clockwise with rows downwards.
double area(const Vertex& a, const Vertex& b, const Vertex& c) {
  const auto across = [](const Vertex& p, const Vertex& q) { return double(q.col) - double(p.col); };
  const auto down = [](const Vertex& p, const Vertex& q) { return double(q.row) - double(p.row); };
  return down(a, b) * across(a, c) - across(a, b) * down(a, c);
}

/// The largest deviation of a triangle from the samples that it covers.
double deviation(const Vertex& a, const Vertex& b, const Vertex& c, const FieldFrame& frame,
                 const float* heights) {
  const double whole = area(a, b, c);
  double worst = 0.0;
  if (whole == 0.0) return worst;
  for (uint32_t row = std::min({a.row, b.row, c.row}); row <= std::max({a.row, b.row, c.row}); ++row) {
    for (uint32_t col = std::min({a.col, b.col, c.col}); col <= std::max({a.col, b.col, c.col}); ++col) {
      const Vertex at{col, row, heights[row * frame.cols + col], 0, 0};
      const double u = area(at, b, c) / whole, v = area(a, at, c) / whole, w = area(a, b, at) / whole;
      if (u < 0.0 || v < 0.0 || w < 0.0) continue;
      const double height = u * double(a.height) + v * double(b.height) + w * double(c.height);
      worst = std::max(worst, std::abs(height - double(at.height)));
    }
  }
  return worst;
}

Node make_node(const Family& method, const HeightField& field, double gap, int64_t id) {
  Node node{};
  Box box;
  for (int resolution = 0; resolution < kResolutions; ++resolution) {
    const Mesh mesh = make_mesh(method, field, field.heights, gap, id, resolution);
    double worst = 0.0;
    for (size_t i = 0; i < mesh.indices.size(); i += 3) {
      const Vertex &a = mesh.vertices[mesh.indices[i]], &b = mesh.vertices[mesh.indices[i + 1]],
                   &c = mesh.vertices[mesh.indices[i + 2]];
      ++node.triangles[resolution];
      if (a.filler) {
        ++node.fillers[resolution];
      } else {
        worst = std::max(worst, deviation(a, b, c, field, field.heights));
      }
    }
    for (const Vertex& v : mesh.vertices) {
      if (!v.filler && std::isfinite(v.height)) box.add(field.position(v.row, v.col, double(v.height)));
    }
    node.error[resolution] = method.bound(worst);
    node.triangles[resolution] = method.told(node.triangles[resolution]);
  }
  for (int i = 0; i < 3; ++i) {
    node.lo[i] = box.lo[i];
    node.hi[i] = box.hi[i];
  }
  return node;
}

MethodInfo make_info(std::string name, std::string flaw, std::vector<std::string> accepts) {
  using enum Stage;
  return {std::move(name),
          std::move(flaw),
          std::move(accepts),
          {"pixel_error", "triangles", "nodes"},
          false,
          {{"gap", 0.0, kBuild, "source units", "How far the flaw moves vertices, where it does.", {}, 0.0}}};
}

}  // namespace

Family::Family(std::string name, std::string flaw, std::vector<std::string> accepts)
    : info_(make_info(std::move(name), std::move(flaw), std::move(accepts))) {}

Mesh make_mesh(const Family& method, const FieldFrame& frame, const float* heights, double gap, int64_t node,
               int resolution) {
  const int64_t across = nodes_across(frame), first_row = node / across * kSide,
                first_col = node % across * kSide;
  const Lattice lattice{static_cast<int>(std::min<int64_t>(kSide, frame.rows - 1 - first_row)),
                        static_cast<int>(std::min<int64_t>(kSide, frame.cols - 1 - first_col))};
  Mesh mesh;
  mesh.node = node;
  mesh.resolution = resolution;
  for (int64_t row = first_row; row <= first_row + lattice.down; ++row) {
    for (int64_t col = first_col; col <= first_col + lattice.across; ++col) {
      mesh.vertices.push_back({static_cast<uint32_t>(col), static_cast<uint32_t>(row),
                               heights[row * frame.cols + col], static_cast<uint32_t>(node), 0});
    }
  }
  const int step = resolution == 0 ? 2 : 1;
  for (int row = 0; row < lattice.down; row += step) {
    for (int col = 0; col < lattice.across; col += step) {
      const int below = std::min(row + step, lattice.down), beside = std::min(col + step, lattice.across);
      const uint32_t nw = lattice.vertex(row, col), ne = lattice.vertex(row, beside),
                     sw = lattice.vertex(below, col), se = lattice.vertex(below, beside);
      if ((row + col) / step % 2 == 0) {
        add_triangle(mesh, nw, sw, se);
        add_triangle(mesh, nw, se, ne);
      } else {
        add_triangle(mesh, nw, sw, ne);
        add_triangle(mesh, ne, sw, se);
      }
    }
  }
  method.change(mesh, gap);
  return mesh;
}

void Family::build(const Source& source, const Options& options, StoreWriter& writer,
                   const Progress& progress) const {
  if (const auto* mesh = dynamic_cast<const lodlab::Mesh*>(&source))
    return build_patches(*this, *mesh, options.real("gap"), writer);
  const HeightField& field = field_in_memory(source, "build: " + info_.name);
  const std::vector<float> heights(field.heights, field.heights + field.rows * field.cols);
  if (!writer.has_page(kHeights, 0)) writer.put_page(kHeights, 0, as_bytes(heights));
  const Bytes coverage = coverage_bits(field);
  if (!coverage.empty() && !writer.has_page(kCoverage, 0)) writer.put_page(kCoverage, 0, coverage);
  std::vector<Node> nodes;
  for (int64_t id = 0; id < node_count(field); ++id) {
    nodes.push_back(make_node(*this, field, options.real("gap"), id));
    if (progress) progress("nodes", static_cast<double>(id + 1) / static_cast<double>(node_count(field)));
  }
  writer.put_array("nodes", as_bytes(nodes));
  writer.put_array("gap", as_bytes(std::vector<double>{options.real("gap")}));
}

std::shared_ptr<const Hierarchy> Family::open(std::shared_ptr<const Store> store) const {
  if (kind_of_frame(store->meta().frame) == "mesh") return open_patches(*this, *store);
  return std::make_shared<FieldHierarchy>(*this, *store);
}

FamilyHierarchy::FamilyHierarchy(const Family& family, const Store& store)
    : method(family), node(store.array_of<Node>("nodes")) {}

FieldHierarchy::FieldHierarchy(const Family& family, const Store& store)
    : FamilyHierarchy(family, store),
      frame(frame_from_json(store.meta().frame)),
      coverage(store.has_page(kCoverage, 0) ? store.page(kCoverage, 0) : Bytes()),
      gap(store.array_of<double>("gap").at(0)) {
  const Bytes bytes = store.page(kHeights, 0);
  const auto* values = reinterpret_cast<const float*>(bytes.data());
  heights.assign(values, values + bytes.size() / sizeof(float));
}

std::vector<NodeInfo> FamilyHierarchy::nodes() const {
  std::vector<NodeInfo> out;
  for (size_t id = 0; id < node.size(); ++id) {
    const Node& n = node[id];
    const Box box{{n.lo[0], n.lo[1], n.lo[2]}, {n.hi[0], n.hi[1], n.hi[2]}};
    for (int r = 0; r < kResolutions; ++r)
      out.push_back({static_cast<int64_t>(id), -1, 0, r, n.triangles[r], n.error[r], box});
  }
  return out;
}

std::unique_ptr<Session> FieldHierarchy::session(const Options&) const {
  return method.session(shared_from_this());
}

}  // namespace lodlab::adversaries
