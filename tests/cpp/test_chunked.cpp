// SPDX-License-Identifier: MIT
// The chunk tree against its source, without GL: every stored mesh, as its own surface and as its parent's,
// is rasterized at the samples and held against the stored bounds; skirts against all that they must hide.
#include <doctest/doctest.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <functional>
#include <map>
#include <random>
#include <thread>

#include "base/parallel.h"
#include "common/projection.h"
#include "geometry/fractal.h"
#include "method/projector.h"
#include "methods/chunked/hierarchy.h"

using namespace lodlab;
using chunked::ChunkedHierarchy;
using chunked::Node;
using chunked::Vertex;

namespace lodlab {
const Method& chunked_method();
}

namespace {

struct Field {
  std::shared_ptr<HeightField> field = std::make_shared<HeightField>();
  std::vector<float> heights;

  Field(int rows, int cols, const std::function<float(int, int)>& height, double step = 0.0) {
    heights.resize(static_cast<size_t>(rows) * cols);
    field->rows = rows;
    field->cols = cols;
    field->dx = 20.0;
    field->dy = 30.0;
    field->height_step = step;
    field->z_min = 1e30;
    field->z_max = -1e30;
    for (int r = 0; r < rows; ++r) {
      for (int c = 0; c < cols; ++c) {
        const float h = height(r, c);
        heights[static_cast<size_t>(r) * cols + c] = h;
        field->z_min = std::min<double>(field->z_min, h);
        field->z_max = std::max<double>(field->z_max, h);
      }
    }
    field->heights = heights.data();
  }
};

std::shared_ptr<const Store> build(const Field& field, const std::map<std::string, OptionValue>& options,
                                   const Progress& progress = {}) {
  const auto path =
      (std::filesystem::temp_directory_path() / ("test_chunked_" + std::to_string(::getpid()) + ".lod"))
          .string();
  auto store = build_store(*field.field, chunked_method(), options, path, BuildMode::kForce, progress);
  std::filesystem::remove(path);  // the open file stays readable
  return store;
}

struct Mesh {
  chunked::PageHead head;
  std::vector<Vertex> vertices;
  std::vector<uint32_t> indices;
};

Mesh mesh_of(const ChunkedHierarchy& tree, size_t id) {
  const Bytes page = chunked::decode_page(tree.store->page(chunked::kGeometry, static_cast<int64_t>(id)), 4);
  Mesh mesh;
  std::memcpy(&mesh.head, page.data(), sizeof mesh.head);
  mesh.vertices.resize(mesh.head.vertices);
  mesh.indices.resize(mesh.head.indices);
  std::memcpy(mesh.vertices.data(), page.data() + sizeof mesh.head, mesh.vertices.size() * 8);
  std::memcpy(mesh.indices.data(), page.data() + sizeof mesh.head + mesh.vertices.size() * 8,
              mesh.indices.size() * 4);
  return mesh;
}

/// Surface heights at the chunk's samples, in quanta; nan where no triangle is. Edges inclusive.
std::vector<double> rasterize(const Mesh& mesh, int side, bool targets) {
  std::vector<double> z(static_cast<size_t>(side + 1) * (side + 1), std::nan(""));
  for (uint32_t i = 0; i < mesh.head.surface_indices; i += 3) {
    const Vertex &a = mesh.vertices[mesh.indices[i]], &b = mesh.vertices[mesh.indices[i + 1]],
                 &c = mesh.vertices[mesh.indices[i + 2]];
    const auto cross = [](int ax, int ay, int bx, int by) { return ax * by - ay * bx; };
    const int area = cross(b.x - a.x, b.y - a.y, c.x - a.x, c.y - a.y);
    REQUIRE(area < 0);  // counter-clockwise with rows running south
    for (int y = std::min({a.y, b.y, c.y}); y <= std::max({a.y, b.y, c.y}); ++y) {
      for (int x = std::min({a.x, b.x, c.x}); x <= std::max({a.x, b.x, c.x}); ++x) {
        const int u = cross(b.x - x, b.y - y, c.x - x, c.y - y),
                  v = cross(c.x - x, c.y - y, a.x - x, a.y - y);
        const int w = area - u - v;
        if (u > 0 || v > 0 || w > 0) continue;
        const auto h = [&](const Vertex& p) { return double{targets ? p.target * 1.0 : p.z * 1.0}; };
        z[static_cast<size_t>(y) * (side + 1) + x] = (u * h(a) + v * h(b) + w * h(c)) / area;
      }
    }
  }
  return z;
}

void check_bounds(const Field& source, const ChunkedHierarchy& tree) {
  const HeightField& field = *source.field;
  for (size_t id = 0; id < tree.node.size(); ++id) {
    const Node& node = tree.node[id];
    const int side = tree.root_side >> node.level;
    const Mesh mesh = mesh_of(tree, id);
    const auto own = rasterize(mesh, side, false), target = rasterize(mesh, side, true);
    double worst = 0.0, worst_target = 0.0, from_parent = 0.0;
    std::vector<double> parent;
    int shift = 0;
    if (node.parent >= 0) {
      const Node& p = tree.node[static_cast<size_t>(node.parent)];
      parent = rasterize(mesh_of(tree, static_cast<size_t>(node.parent)), 2 * side, false);
      shift = (node.row - p.row) * (2 * side + 1) + node.col - p.col;
      CHECK(p.error >= node.error);
      CHECK(node.parent_error == p.error);
      for (int i = 0; i < 3; ++i) {
        CHECK(p.lo[i] <= node.lo[i]);
        CHECK(p.hi[i] >= node.hi[i]);
      }
    }
    for (int y = 0; y <= side && node.row + y < field.rows; ++y) {
      for (int x = 0; x <= side && node.col + x < field.cols; ++x) {
        const size_t i = static_cast<size_t>(y) * (side + 1) + x;
        const double h = field.at(node.row + y, node.col + x);
        REQUIRE(std::isfinite(own[i]));
        worst = std::max(worst, std::abs(tree.quantizer.height(own[i]) - h));
        worst_target = std::max(worst_target, std::abs(tree.quantizer.height(target[i]) - h));
        if (!parent.empty()) {
          from_parent = std::max(
              from_parent, std::abs(target[i] - parent[static_cast<size_t>(shift + y * (2 * side + 1) + x)]));
        }
        CHECK(h >= node.lo[2]);
        CHECK(h <= node.hi[2]);
      }
    }
    CAPTURE(id);
    CHECK(worst <= node.error + 1e-9);
    CHECK(worst_target <= node.parent_error + 1e-9);
    CHECK(from_parent <= 1.0);  // both round to whole quanta at the border, targets elsewhere
  }
}

/// One straight edge of a chunk: heights of the surface and of the skirt's bottom at whole positions.
struct Edge {
  std::map<int, std::pair<double, double>> low, high;  // position -> (own, target): bottom and top
};

using EdgeKey = std::tuple<bool, int, size_t>;  // vertical, line, node

std::map<EdgeKey, Edge> edges_of(const ChunkedHierarchy& tree) {
  std::map<EdgeKey, Edge> edges;
  for (size_t id = 0; id < tree.node.size(); ++id) {
    const Node& node = tree.node[id];
    const Mesh mesh = mesh_of(tree, id);
    for (uint32_t i = mesh.head.surface_indices; i < mesh.head.indices; i += 3) {
      const Vertex* v[3];
      bool vertical = true, horizontal = true;
      for (int k = 0; k < 3; ++k) {
        v[k] = &mesh.vertices[mesh.indices[i + k]];
        vertical = vertical && v[k]->x == v[0]->x;
        horizontal = horizontal && v[k]->y == v[0]->y;
      }
      REQUIRE(vertical != horizontal);  // vertical in space: of no area seen from above
      for (int k = 0; k < 3; ++k) {
        const int line = vertical ? node.col + v[k]->x : node.row + v[k]->y;
        const int at = vertical ? node.row + v[k]->y : node.col + v[k]->x;
        Edge& edge = edges[{vertical, line, id}];
        const bool bottom = mesh.indices[i + k] >= mesh.head.surface_vertices;
        (bottom ? edge.low : edge.high)[at] = {v[k]->z, v[k]->target};
      }
    }
  }
  return edges;
}

double interpolate(const std::map<int, std::pair<double, double>>& line, int at, double morph) {
  const auto next = line.lower_bound(at);
  const auto value = [&](const std::pair<double, double>& p) {
    return p.second + morph * (p.first - p.second);
  };
  if (next->first == at) return value(next->second);
  const auto before = std::prev(next);
  const double f = static_cast<double>(at - before->first) / (next->first - before->first);
  return value(before->second) + f * (value(next->second) - value(before->second));
}

/// A skirt reaches below whatever any chunk of any level, at any morph, draws along the same line.
void check_skirts(const ChunkedHierarchy& tree) {
  const auto edges = edges_of(tree);
  for (const auto& [key, edge] : edges) {
    for (auto other = edges.lower_bound({std::get<0>(key), std::get<1>(key), 0});
         other != edges.end() && std::get<0>(other->first) == std::get<0>(key) &&
         std::get<1>(other->first) == std::get<1>(key);
         ++other) {
      const int from = std::max(edge.low.begin()->first, other->second.high.begin()->first);
      const int to = std::min(edge.low.rbegin()->first, other->second.high.rbegin()->first);
      for (int at = from; at <= to; ++at) {
        for (const double mine : {0.0, 0.4, 1.0}) {
          for (const double theirs : {0.0, 1.0}) {
            CHECK(interpolate(edge.low, at, mine) < interpolate(other->second.high, at, theirs));
          }
        }
      }
    }
  }
}

void check(const Field& field, const std::map<std::string, OptionValue>& options) {
  const ChunkedHierarchy tree(build(field, options));
  check_bounds(field, tree);
  check_skirts(tree);
}

Field fractal(int rows, int cols) {
  std::vector<float> h(static_cast<size_t>(rows) * cols);
  fractal_heights({}, 100, 200, rows, cols, h.data());
  return Field(rows, cols, [&](int r, int c) { return h[static_cast<size_t>(r) * cols + c]; });
}

}  // namespace

TEST_CASE("bounds, morph targets and skirts hold on real-looking terrain of any size") {
  for (const auto& [rows, cols] :
       {std::pair{65, 65}, {129, 129}, {100, 77}, {2, 2}, {2, 200}, {200, 2}, {131, 260}}) {
    CAPTURE(rows);
    CAPTURE(cols);
    check(fractal(rows, cols), {{"leaf", int64_t{16}}, {"chunk_triangles", int64_t{128}}});
    check(fractal(rows, cols),
          {{"leaf", int64_t{16}}, {"chunk_triangles", int64_t{128}}, {"finest_error", 5.0}});
  }
}

TEST_CASE("flat, spiky, stepped and noisy fields") {
  const std::map<std::string, OptionValue> options{{"leaf", int64_t{8}}, {"chunk_triangles", int64_t{64}}};
  check(Field(70, 50, [](int, int) { return 7.25f; }), options);
  check(Field(70, 50, [](int r, int c) { return r == 33 && c == 20 ? 5000.0f : 0.0f; }), options);
  check(Field(
            70, 50, [](int, int c) { return c < 23 ? 0.0f : 4000.0f; }, 1.0),
        options);
  std::mt19937 random(3);
  check(Field(
            70, 50, [&](int, int) { return static_cast<float>(random() % 60000); }, 1.0),
        options);
  check(Field(
            70, 50, [](int r, int c) { return static_cast<float>(2 * r - 3 * c); }, 1.0),
        options);
}

TEST_CASE("whole heights are kept exactly and finest_error 0 loses nothing") {
  std::mt19937 random(5);
  const Field field(
      90, 120, [&](int, int) { return static_cast<float>(static_cast<int>(random() % 9000) - 400); }, 1.0);
  const ChunkedHierarchy tree(build(field, {{"leaf", int64_t{16}}}));
  for (const Node& node : tree.node) {
    if (node.level + 1 == tree.levels) CHECK(node.error == 0.0);
  }
}

TEST_CASE("what fills a void does not make whole heights inexact") {
  const Field field(
      40, 50,
      [&](int r, int c) { return r == 7 && c == 9 ? 20.3f : static_cast<float>((r * 7 + c * 3) % 41); }, 1.0);
  std::vector<uint8_t> valid(40 * 50, 1);
  valid[7 * 50 + 9] = 0;
  field.field->valid = valid.data();
  const ChunkedHierarchy tree(build(field, {{"leaf", int64_t{16}}}));
  for (const Node& node : tree.node) {
    if (node.level + 1 == tree.levels) CHECK(node.error == 0.0);
  }
}

TEST_CASE("one thread or many, twice: the same content") {
  const Field field = fractal(200, 300);
  std::string hash;
  for (const int threads : {1, 2, 2}) {
    set_thread_count(threads);
    const auto store = build(field, {});
    if (!hash.empty()) CHECK(store->content_hash() == hash);
    hash = store->content_hash();
  }
  set_thread_count(0);
}

TEST_CASE("projection: an upper bound on screen movement, and its inverse") {
  std::mt19937_64 random(11);
  const auto uniform = [&](double a, double b) {
    return std::uniform_real_distribution<double>(a, b)(random);
  };
  for (int i = 0; i < 200000; ++i) {
    const double tan_h = std::tan(uniform(0.1, 1.4)), tan_v = tan_h * uniform(0.3, 1.5);
    const double s = std::sqrt(1 + tan_h * tan_h + tan_v * tan_v), K = 600.0 / tan_h, n = uniform(0.01, 2.0);
    const double z = n + std::exp(uniform(-3, 5)), x = uniform(-1, 1) * z * tan_h,
                 y = uniform(-1, 1) * z * tan_v;
    const double delta = std::exp(uniform(-4, 5));
    double d[3] = {uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)};
    const double length = std::sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
    double share = 1.0;  // of the way to the near plane
    if (z + d[2] / length * delta < n) share = (n - z) / (d[2] / length * delta);
    const double qx = x + d[0] / length * delta * share, qy = y + d[1] / length * delta * share,
                 qz = z + d[2] / length * delta * share;
    const double moved = K * std::hypot(qx / qz - x / z, qy / qz - y / z);
    const double D = std::sqrt(x * x + y * y + z * z);
    CHECK(moved <= project_strict(delta, K, D, n, s, 1.0) * (1 + 1e-9));
    const double tau = std::exp(uniform(-3, 4));
    const double star = inverse_strict(tau, K, D, n, s, 1.0);
    CHECK(project_strict(star, K, D, n, s, 1.0) == doctest::Approx(tau));
    CHECK(project_paper(inverse_paper(tau, K, D, n), K, D, n) == doctest::Approx(tau));
    // Vertical: the displacement along an up direction u, the elevation taken from it.
    const double up = uniform(-1.5, 1.5), ux = 0.0, uy = std::cos(up), uz = std::sin(up);
    const double along = y * uy + z * uz;
    const double cosine = elevation_cosine(std::sqrt(std::max(0.0, D * D - along * along)), std::abs(along));
    double part = 1.0;
    if (z + uz * delta < n) part = (n - z) / (uz * delta);
    const double vy = y + uy * delta * part, vz = z + uz * delta * part, vx = x + ux;
    CHECK(K * std::hypot(vx / vz - x / z, vy / vz - y / z) <=
          project_strict(delta, K, D, n, s, cosine) * (1 + 1e-9));
  }
}

TEST_CASE("projection: beyond its safe distance a delta is within the pixels, told by the distance alone") {
  std::mt19937_64 random(12);
  const auto uniform = [&](double a, double b) {
    return std::uniform_real_distribution<double>(a, b)(random);
  };
  for (int i = 0; i < 20000; ++i) {
    View view;
    view.target = {0.0, 100.0, 0.0};
    view.fov = uniform(10.0, 160.0);
    view.near_plane = std::exp(uniform(-4, 3));
    const double delta = std::exp(uniform(-4, 5)), tau = std::exp(uniform(-3, 4));
    for (const Projection kind : {Projection::kPaper, Projection::kStrict, Projection::kVertical}) {
      const Projector projector(kind, make_camera(view));
      const double safe = delta * projector.safe_distance(tau);
      const double away = safe * (random() % 2 == 0 ? 1.0 : uniform(1.0, 2.0));
      const Projector::Place place{away, kind == Projection::kVertical ? uniform(0.0, 1.0) : 1.0};
      CHECK(projector.project(delta, place) <= tau);
      CHECK(projector.inverse(tau, place) >= delta);
      if (kind == Projection::kStrict &&
          projector.n < 0.5 * away / projector.s)  // and it is no further than need be
        CHECK(projector.project(delta, {safe * 0.99, 1.0}) > tau * 0.99);
    }
  }
}

TEST_CASE("reports of a build on many threads come in order and end with all of it") {
  const Field field(257, 257, [](int r, int c) { return static_cast<float>((r * 31 + c * 17) % 23); });
  std::vector<double> shares;
  set_thread_count(8);
  build(field, {{"leaf", int64_t{4}}}, [&](const std::string& stage, double share) {
    if (stage == "chunks") shares.push_back(share);
    std::this_thread::sleep_for(std::chrono::microseconds(100));  // others come to wait meanwhile
  });
  set_thread_count(0);
  CHECK(shares.size() > 100);
  CHECK(std::is_sorted(shares.begin(), shares.end()));
  CHECK(shares.back() == 1.0);
}
