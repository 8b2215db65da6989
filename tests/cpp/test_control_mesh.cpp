// SPDX-License-Identifier: MIT
// The control mesh of `subdivision`: what kind of surface it stays, and its rule of the half-sphere by brute
// force over the source triangles that collapsed onto each of its vertices. No GL.
#include <doctest/doctest.h>

#include <cmath>
#include <functional>
#include <glm/gtc/constants.hpp>
#include <map>
#include <random>

#include "base/errors.h"
#include "base/parallel.h"
#include "geometry/mesh_census.h"
#include "geometry/mesh_edges.h"
#include "mesh_arrays.h"
#include "methods/subdivision/control_mesh.h"

using namespace lodlab;
using testing::Arrays;
using testing::mesh_of;
using namespace lodlab::subdivision;
using doctest::Approx;

namespace {

using Place = std::function<glm::dvec3(double u, double v)>;  // of [0, 1] x [0, 1]

/// rows x cols cells, outside where u x v points. What wraps has its first vertices again at its end.
Arrays swept(uint32_t rows, uint32_t cols, const Place& at) {
  Arrays out;
  for (uint32_t row = 0; row <= rows; ++row)
    for (uint32_t col = 0; col <= cols; ++col)
      out.positions.push_back(at(double(row) / rows, double(col) / cols));
  for (uint32_t row = 0; row < rows; ++row) {
    for (uint32_t col = 0; col < cols; ++col) {
      const uint32_t a = row * (cols + 1) + col, b = a + cols + 1;
      out.faces.push_back({a, b, b + 1});
      out.faces.push_back({a, b + 1, a + 1});
    }
  }
  return out;
}

/// Sine and cosine of a share of a full turn; the same bits at 0 and 1.
glm::dvec2 turn(double share) {
  const double angle = share == 1.0 ? 0.0 : glm::two_pi<double>() * share;
  return {std::cos(angle), std::sin(angle)};
}

/// At the poles triangles name a position twice.
Arrays sphere(uint32_t n, const glm::dvec3& centre = {}) {
  return swept(n, 2 * n, [&](double u, double v) {
    const double polar = glm::pi<double>() * u;
    const double r = u == 0.0 || u == 1.0 ? 0.0 : std::sin(polar);
    return centre + glm::dvec3(r * turn(v), std::cos(polar));
  });
}

Arrays torus(uint32_t n) {
  return swept(2 * n, n, [](double u, double v) {
    const glm::dvec2 small = turn(v), large = turn(u);
    return glm::dvec3((3.0 + small.x) * large, small.y);
  });
}

Arrays waves(uint32_t n) {
  return swept(n, n, [](double u, double v) {
    return glm::dvec3(u, v, 0.03 * std::sin(9.0 * u) * std::cos(7.0 * v));
  });
}

Arrays tetrahedron() {
  return {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {0, 3, 2}}};
}

void add(Arrays& to, const Arrays& other) {
  const auto first = static_cast<uint32_t>(to.positions.size());
  to.positions.insert(to.positions.end(), other.positions.begin(), other.positions.end());
  for (const Face& f : other.faces) to.faces.push_back({first + f[0], first + f[1], first + f[2]});
}

glm::dvec3 cross_of(std::span<const glm::dvec3> positions, const Face& f) {
  const glm::dvec3& a = positions[f[0]];
  return glm::cross(positions[f[1]] - a, positions[f[2]] - a);
}

/// Checks what holds of all control meshes of sources whose own vertices keep the rule.
void check_rule(const Arrays& source, const ControlMesh& control) {
  REQUIRE(control.onto.size() == source.positions.size());
  REQUIRE(control.normals.size() == control.positions.size());
  double least = 1.0;
  const auto see = [&](const glm::dvec3& cross, uint32_t vertex) {
    REQUIRE(vertex < control.normals.size());
    const double length = glm::length(cross);
    if (length > 0.0) least = std::min(least, glm::dot(cross, control.normals[vertex]) / length);
  };
  for (const Face& face : source.faces)
    for (const uint32_t v : face) see(cross_of(source.positions, face), control.onto[v]);
  for (const Face& face : control.faces)
    for (const uint32_t v : face) see(cross_of(control.positions, face), v);
  CHECK(least >= kLeastCosine - 1e-9);
  for (const glm::dvec3& n : control.normals) CHECK(glm::length(n) == Approx(1.0));
}

MeshCensus census_of(const ControlMesh& control) {
  return mesh_census({control.positions, control.faces, {}, {}, nullptr});
}

ControlMesh control_of(const Arrays& source, int64_t target) {
  ControlMesh out = control_mesh(*mesh_of(source), target, {});
  const MeshCensus census = census_of(out);
  CHECK(census.nonmanifold_edges == 0);
  CHECK(census.nonmanifold_vertices == 0);
  CHECK(census.oriented);
  CHECK(census.degenerate_triangles == 0);
  CHECK(census.duplicate_triangles == 0);
  CHECK(census.unused_vertices == 0);
  CHECK(out.reached_target == (static_cast<int64_t>(out.faces.size()) <= target));
  return out;
}

}  // namespace

TEST_CASE("a sphere reaches its target, and is near the sphere") {
  const Arrays source = sphere(40);
  const ControlMesh control = control_of(source, 200);
  CHECK(control.reached_target);
  CHECK(control.faces.size() >= 199);
  CHECK(census_of(control).genus == 0);
  CHECK(census_of(control).boundary_edges == 0);
  check_rule(source, control);
  for (size_t v = 0; v < control.positions.size(); ++v) {
    const glm::dvec3 p = control.centre + control.positions[v];
    CHECK(glm::length(p) == Approx(1.0).epsilon(0.05));
    CHECK(glm::dot(control.normals[v], glm::normalize(p)) > 0.95);
  }
}

TEST_CASE("without a target within reach a mesh is as coarse as it can be, and says so") {
  const Arrays source = sphere(24);
  const ControlMesh control = control_of(source, 1);
  CHECK_FALSE(control.reached_target);
  CHECK(control.faces.size() < 20);
  CHECK(census_of(control).genus == 0);
  check_rule(source, control);
}

TEST_CASE(
    "a rough sphere is not stuck: other places are tried, neighbours given other axes, folds left out") {
  const auto rough = [](double most) {
    Arrays out = sphere(40);
    std::mt19937 random(1);
    std::map<std::tuple<double, double, double>, double> scale;  // equal positions move alike
    for (glm::dvec3& p : out.positions) {
      const double noise = std::uniform_real_distribution<double>(-most, most)(random) * (1.0 - p.z * p.z);
      p *= scale.try_emplace({p.x, p.y, p.z}, 1.0 + noise).first->second;
    }
    return out;
  };
  const Arrays source = rough(0.2);
  const ControlMesh control = control_of(source, 1);
  check_rule(source, control);
  CHECK(control.faces.size() < 175);                     // 182 with neither
  CHECK(control_of(rough(0.5), 1).faces.size() < 1000);  // 1,500: vertices that fit no half-sphere
}

TEST_CASE("a torus keeps its handle, two components stay two") {
  Arrays source = torus(24);
  add(source, sphere(12, {10.0, 0.0, 0.0}));
  for (const int64_t target : {int64_t{300}, int64_t{1}}) {
    const ControlMesh control = control_of(source, target);
    CHECK(control.reached_target == (target == 300));
    CHECK(census_of(control).genus == 1);
    CHECK(census_of(control).components == 2);
    check_rule(source, control);
  }
}

TEST_CASE("a patch keeps its border: one loop, its corners, near where it was") {
  const Arrays source = waves(30);
  const ControlMesh control = control_of(source, 150);
  CHECK(control.reached_target);
  check_rule(source, control);
  const MeshEdges edges = mesh_edges(control.faces, static_cast<int64_t>(control.positions.size()));
  glm::dvec2 lo(1.0), hi(0.0);
  int64_t border = 0;
  for (int64_t edge = 0; edge < edges.count(); ++edge) {
    if (edges.of(edge).size() != 1) continue;
    ++border;
    const glm::dvec3 p = control.centre + control.positions[vertex_of(control.faces, edges.of(edge)[0])];
    CHECK(std::min({p.x, 1.0 - p.x, p.y, 1.0 - p.y}) < 0.01);
    CHECK(p.z == Approx(0.03 * std::sin(9.0 * p.x) * std::cos(7.0 * p.y)).epsilon(1.0).scale(0.01));
    lo = glm::min(lo, glm::dvec2(p));
    hi = glm::max(hi, glm::dvec2(p));
  }
  CHECK(border >= 8);
  CHECK(glm::length(lo) < 0.02);
  CHECK(glm::length(hi - 1.0) < 0.02);
  CHECK(census_of(control).genus == 0);
}

TEST_CASE("a border loop keeps three edges") {
  const ControlMesh control = control_of(waves(12), 1);
  CHECK(census_of(control).boundary_edges >= 3);
  CHECK(census_of(control).components == 1);
}

TEST_CASE("what cannot be coarser stays: a tetrahedron, a triangle, two back to back") {
  const Arrays triangle{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}};
  for (const Arrays& source : {tetrahedron(), triangle}) {
    const ControlMesh control = control_of(source, 1);
    CHECK(control.faces.size() == source.faces.size());
    CHECK(control.positions.size() == source.positions.size());
  }
  CHECK(control_of(triangle, 1).reached_target);
  const Arrays both{triangle.positions, {{0, 1, 2}, {0, 2, 1}}};
  CHECK(control_mesh(*mesh_of(both), 1, {}).faces.size() == 2);
}

TEST_CASE("what is no oriented manifold is refused with counts; what a repair has split is taken") {
  Arrays fin = tetrahedron();
  fin.positions.push_back({1, 1, -1});
  fin.faces.push_back({0, 1, 4});
  CHECK_THROWS_WITH_AS(control_mesh(*mesh_of(fin), 1, {}),
                       doctest::Contains("1 edges of three triangles or more"), InvalidInput);
  Arrays turned = tetrahedron();
  std::swap(turned.faces[0][0], turned.faces[0][1]);
  CHECK_THROWS_WITH_AS(
      control_mesh(*mesh_of(turned), 1, {}),
      doctest::Contains("must be an oriented manifold: it has 0 edges of three triangles or more, 0 vertices "
                        "of several fans, and is not oriented alike (repair=split,orient"),
      InvalidInput);
  Arrays touching = tetrahedron();  // at one vertex
  touching.positions.insert(touching.positions.end(), {{-1, 0, 0}, {0, -1, 0}, {0, 0, -1}});
  for (const Face& f : {Face{0, 4, 5}, Face{0, 5, 6}, Face{4, 6, 5}, Face{0, 6, 4}})
    touching.faces.push_back(f);
  CHECK_THROWS_WITH_AS(control_mesh(*mesh_of(touching), 1, {}),
                       doctest::Contains("1 vertices of several fans"), InvalidInput);
  touching.positions.push_back({0, 0, 0});
  for (size_t t = 4; t < 8; ++t)
    for (uint32_t& v : touching.faces[t]) v = v == 0 ? 7 : v;
  CHECK(control_of(touching, 1).faces.size() == 8);
  CHECK_THROWS_AS(control_mesh(*mesh_of(tetrahedron()), 0, {}), InvalidInput);
}

TEST_CASE("triangles without area count into no normal") {
  Arrays source = waves(10);
  // Beside the border, on its line: two triangles that share its first edge's middle.
  const auto middle = static_cast<uint32_t>(source.positions.size());
  const glm::dvec3 a = source.positions[0], b = source.positions[1];
  source.positions.push_back(0.5 * (a + b));
  source.faces.push_back({0, 1, middle});
  const ControlMesh control = control_mesh(*mesh_of(source), 40, {});
  CHECK(control.reached_target);
  check_rule(source, control);
}

TEST_CASE("the same mesh whatever the number of threads") {
  const auto source = mesh_of(torus(40));
  set_thread_count(1);
  const ControlMesh one = control_mesh(*source, 400, {});
  set_thread_count(3);
  const ControlMesh three = control_mesh(*source, 400, {});
  set_thread_count(0);
  CHECK(one.positions == three.positions);
  CHECK(one.normals == three.normals);
  CHECK(one.faces == three.faces);
  CHECK(one.onto == three.onto);
}

TEST_CASE("poses that bend nothing change nothing; where they bend, faces are smaller") {
  const Arrays source = waves(40);
  const auto posed = [&](const std::function<glm::dvec3(const glm::dvec3&)>& at) {
    Arrays out = source;
    for (glm::dvec3& p : out.positions) p = at(p);
    return mesh_of(out);
  };
  const auto mesh = mesh_of(source);
  const ControlMesh none = control_mesh(*mesh, 100, {});
  const ControlMesh rest = control_mesh(*mesh, 100, {}, {mesh, mesh, mesh});
  CHECK(none.positions == rest.positions);
  CHECK(none.normals == rest.normals);
  CHECK(none.faces == rest.faces);
  CHECK(none.onto == rest.onto);
  // Half of it is rolled up.
  const auto rolled = posed([](const glm::dvec3& p) {
    if (p.x < 0.5) return p;
    const double angle = 4.0 * (p.x - 0.5), r = 0.25 - p.z;
    return glm::dvec3(0.5 + r * std::sin(angle), p.y, 0.25 - r * std::cos(angle));
  });
  const auto in_half = [](const ControlMesh& control) {
    return std::count_if(control.positions.begin(), control.positions.end(),
                         [&](const glm::dvec3& p) { return control.centre.x + p.x > 0.5; });
  };
  const ControlMesh bent = control_mesh(*mesh, 100, {}, {rolled});
  CHECK(bent.faces.size() <= 100);
  CHECK(4 * in_half(bent) > 5 * in_half(none));
  check_rule(source, bent);
}

TEST_CASE("a pose has the source's vertices and triangles") {
  const auto source = mesh_of(tetrahedron());
  Arrays more = tetrahedron(), other = tetrahedron();
  more.positions.push_back({2, 2, 2});
  std::rotate(other.faces[2].begin(), other.faces[2].begin() + 1, other.faces[2].end());
  CHECK_THROWS_WITH_AS(
      control_mesh(*source, 1, {}, {source, mesh_of(more)}),
      "subdivision: pose 1 of 2 has 5 vertices and 4 triangles; it must have the source's 4 and 4",
      InvalidInput);
  CHECK_THROWS_WITH_AS(
      control_mesh(*source, 1, {}, {mesh_of(other)}),
      "subdivision: pose 0 of 1 has vertices 2, 3, 1 in triangle 2; it must have the source's 1, 2, 3",
      InvalidInput);
}

TEST_CASE("progress may stop it") {
  const auto stop = [](const std::string&, double) { throw Interrupted(); };
  CHECK_THROWS_AS(control_mesh(*mesh_of(sphere(80)), 100, stop), Interrupted);
}

TEST_CASE("rough meshes with holes stay manifolds of their kind") {
  std::mt19937 random(5);
  for (int trial = 0; trial < 30; ++trial) {
    Arrays source = trial % 2 == 0 ? torus(8) : waves(12);
    std::uniform_real_distribution<double> noise(-0.02 * trial, 0.02 * trial);
    // Vertices at equal positions move alike, or the mesh comes apart: then that is the test.
    for (glm::dvec3& p : source.positions) p.z += noise(random);
    for (int holes = 0; holes < trial / 3; ++holes)
      source.faces.erase(source.faces.begin() + static_cast<long>(random() % source.faces.size()));
    const auto mesh = mesh_of(source);
    ControlMesh control;
    try {
      control = control_mesh(*mesh, 1 + static_cast<int64_t>(random() % 60), {});
    } catch (const InvalidInput&) {
      continue;  // two holes touch at a vertex
    }
    const MeshCensus after = census_of(control);
    CHECK(after.nonmanifold_edges == 0);
    CHECK(after.nonmanifold_vertices == 0);
    CHECK(after.oriented);
    for (const glm::dvec3& n : control.normals) CHECK(glm::length(n) == Approx(1.0));
  }
}
