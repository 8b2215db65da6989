// SPDX-License-Identifier: MIT
// The ruler of meshes on shapes whose answers are known on paper. No GL: captures are made by hand.
#include <doctest/doctest.h>

#include <cmath>

#include "base/errors.h"
#include "geometry/angles.h"
#include "geometry/mesh_distance.h"
#include "instrument/mesh_ruler.h"
#include "instrument/pixel_error.h"
#include "instrument/slack.h"
#include "mesh_arrays.h"

using namespace lodlab;
using testing::Arrays;
using testing::mesh_of;
using namespace lodlab::instrument;
using doctest::Approx;

namespace {

/// [0, 1] x [0, 1] at height 0 in n x n cells, outside up.
Arrays plate(uint32_t n) {
  Arrays out;
  for (uint32_t j = 0; j <= n; ++j) {
    for (uint32_t i = 0; i <= n; ++i) out.positions.push_back({double(i) / n, double(j) / n, 0.0});
  }
  for (uint32_t j = 0; j < n; ++j) {
    for (uint32_t i = 0; i < n; ++i) {
      const uint32_t a = j * (n + 1) + i, b = a + 1, c = a + n + 2, d = a + n + 1;
      out.faces.push_back({a, b, c});
      out.faces.push_back({a, c, d});
    }
  }
  return out;
}

Camera above(const glm::dvec3& at) {
  View view;
  view.eye = at;
  view.target = {at.x, at.y, 0.0};
  view.up = {0.0, 1.0, 0.0};
  view.width = view.height = 100;
  view.fov = 2.0 * std::atan(0.5) * kDegreesPerRadian;
  return make_camera(view);
}

render::Captured captured(const Arrays& mesh, const glm::dvec3& eye, uint32_t node = 0) {
  render::Captured out;
  out.eye = eye;
  for (const Face& face : mesh.faces) {
    for (const uint32_t vertex : face) {
      const glm::vec3 p(mesh.positions[vertex] - eye);
      out.vertices.push_back({p.x, p.y, p.z, 0.0f, 0.0f, node, 0});
    }
  }
  return out;
}

render::Captured together(render::Captured a, const render::Captured& b) {
  a.vertices.insert(a.vertices.end(), b.vertices.begin(), b.vertices.end());
  return a;
}

std::unique_ptr<Laid> lay(const MeshRuler& ruler, const Camera& camera, const render::Captured& now,
                          const render::Captured* before = nullptr) {
  Shown shown{camera, [&now]() -> const render::Captured& { return now; }, {}, "test"};
  if (before != nullptr) shown.before = [before] { return *before; };
  return ruler.lay(std::move(shown));
}

Arrays moved(Arrays arrays, const glm::dvec3& by) {
  for (glm::dvec3& p : arrays.positions) p += by;
  return arrays;
}

Arrays both(const Arrays& a, const Arrays& b) {
  Arrays out = a;
  const auto first = static_cast<uint32_t>(a.positions.size());
  out.positions.insert(out.positions.end(), b.positions.begin(), b.positions.end());
  for (const Face& face : b.faces) out.faces.push_back({face[0] + first, face[1] + first, face[2] + first});
  return out;
}

double unbound(uint32_t) { return 0.0; }

}  // namespace

TEST_CASE("two plates a known gap apart: both ways, on screen, and from the plate before") {
  const Arrays source = plate(4);
  const MeshRuler ruler(mesh_of(source));
  const Camera camera = above({0.5, 0.5, 2.0});
  const render::Captured lifted = captured(moved(source, {0.0, 0.0, 0.25}), camera.eye);
  const render::Captured exact = captured(source, camera.eye);
  const auto laid = lay(ruler, camera, lifted, &exact);
  CHECK(laid->samples().max == Approx(0.25));
  CHECK(laid->samples().rms == Approx(0.25));
  CHECK(laid->samples().samples == 25);
  CHECK(laid->two_sided().max_to_drawn == Approx(0.25));
  CHECK(laid->two_sided().rms_to_source == Approx(0.25));
  // A corner, 0.5 off the axis both ways: at distance 2, and at 1.75.
  const double corner = camera.K * std::sqrt(0.5) * (1.0 / 1.75 - 1.0 / 2.0);
  CHECK(laid->px_max() == Approx(corner));
  CHECK(laid->jump_px_max() == Approx(corner));
  CHECK(lay(ruler, camera, exact, &exact)->jump_px_max() == 0.0);
  CHECK(lay(ruler, camera, exact)->px_max() == 0.0);
  CHECK(std::isnan(lay(ruler, camera, exact)->jump_px_max()));
  REQUIRE(laid->node_errors().size() == 1);
  CHECK(laid->node_errors()[0].max == Approx(0.25));
}

TEST_CASE("what is missing shows as distance from the source, not as a hole") {
  const Arrays source = plate(2);
  Arrays half = source;
  half.faces.resize(4);  // the lower half
  const MeshRuler ruler(mesh_of(source));
  const Camera camera = above({0.5, 0.5, 2.0});
  const render::Captured drawn = captured(half, camera.eye);
  const auto laid = lay(ruler, camera, drawn);
  CHECK(!ruler.has_holes());
  CHECK(laid->two_sided().max_to_drawn == Approx(0.5));
  CHECK(laid->two_sided().max_to_source == Approx(0.0).epsilon(1e-6));
  const render::Captured nothing{camera.eye, {}};
  CHECK(std::isinf(lay(ruler, camera, nothing)->samples().max));
  CHECK(std::isinf(lay(ruler, camera, nothing)->px_max()));
}

TEST_CASE(
    "an edge without a partner is a crack unless it lies on the source's border, within the node's bound") {
  const Arrays source = plate(4);
  const MeshRuler ruler(mesh_of(source));
  const glm::dvec3 eye(0.5, 0.5, 2.0);
  CHECK(ruler.crack_edges(captured(source, eye), unbound) == 0);  // 16 edges of the border
  Arrays torn = source;
  torn.faces.erase(torn.faces.begin() + 10);  // inside
  CHECK(ruler.crack_edges(captured(torn, eye), unbound) == 3);
  CHECK(ruler.crack_edges(captured(torn, eye), [](uint32_t) { return 0.6; }) == 0);
  const Arrays shrunk = moved(plate(4), {0.02, 0.0, 0.0});
  CHECK(ruler.crack_edges(captured(shrunk, eye), unbound) ==
        10);  // left, right, and beyond the right corners
  CHECK(ruler.crack_edges(captured(shrunk, eye), [](uint32_t) { return 0.03; }) == 0);
  Arrays turned = source;
  std::swap(turned.faces[10][0], turned.faces[10][1]);
  CHECK(ruler.crack_edges(captured(turned, eye), unbound) == 6);
  Arrays doubled = source;
  doubled.faces.push_back(doubled.faces[10]);
  CHECK(ruler.crack_edges(captured(doubled, eye), unbound) == 3);
}

TEST_CASE("edges of the source that many triangles share are its own") {
  Arrays fan{{{0, 0, 0}, {0, 0, 1}, {1, 0, 0}, {0, 1, 0}, {-1, -1, 0}}, {{0, 1, 2}, {0, 1, 3}, {0, 1, 4}}};
  const MeshRuler ruler(mesh_of(fan));
  CHECK(ruler.crack_edges(captured(fan, {3.0, 0.0, 0.0}), unbound) == 0);
}

TEST_CASE("each node has its own largest distance; a source vertex counts for the node that is closest") {
  const Arrays source = plate(2);
  const MeshRuler ruler(mesh_of(source));
  const Camera camera = above({0.5, 0.5, 2.0});
  Arrays low = source, high = source;
  low.faces.resize(4);
  high.faces.erase(high.faces.begin(), high.faces.begin() + 4);
  const auto parts =
      together(captured(low, camera.eye, 3), captured(moved(high, {0.0, 0.0, 0.125}), camera.eye, 7));
  const auto laid = lay(ruler, camera, parts);
  const auto errors = laid->node_errors();
  REQUIRE(errors.size() == 2);
  CHECK(errors[0].node == 3);
  CHECK(errors[0].max == Approx(0.0));
  CHECK(errors[1].node == 7);
  CHECK(errors[1].max == Approx(0.125));
}

TEST_CASE("a source vertex that the closest node is no bound for counts for another that keeps its own") {
  const Arrays low = plate(2), high = moved(plate(2), {0.0, 0.0, 0.1});
  const MeshRuler ruler(mesh_of(both(low, high)));
  const Camera camera = above({0.5, 0.5, 2.0});
  // Node 0 stands for the low plate, and is drawn above the high one, which node 1 draws.
  const render::Captured now =
      together(captured(moved(low, {0.0, 0.0, 0.2}), camera.eye, 0), captured(high, camera.eye, 1));
  Shown shown{camera, [&]() -> const render::Captured& { return now; }, {}, "test"};
  const auto errors = [&](double bound) {
    shown.bound = [bound](uint32_t node) { return node == 0 ? bound : 0.0; };
    const std::vector<NodeError> found = ruler.lay(shown)->node_errors();
    REQUIRE(found.size() == 2);
    return std::pair(found[0].max, found[1].max);
  };
  CHECK(errors(0.2).first == Approx(0.2));
  CHECK(errors(0.2).second == Approx(0.0));
  CHECK(errors(0.19).first == Approx(0.1));  // from what it draws to the high plate
  CHECK(errors(0.19).second == Approx(0.1));
  const render::Captured nothing{camera.eye, {}};
  CHECK(lay(ruler, camera, nothing)->node_errors().empty());
}

TEST_CASE("a node is held to the inside of source triangles, not to their vertices alone") {
  const Arrays source{{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}, {{0, 1, 2}, {0, 2, 3}}};
  const MeshRuler ruler(mesh_of(source));
  const Camera camera = above({0.5, 0.5, 2.0});
  // Drawn with a hole [0.6, 0.9] x [0.3, 0.7], all of it right of x = 0.5: nothing is off at a vertex of
  // either.
  Arrays left, right;
  const auto cell = [](Arrays& to, double x0, double y0, double x1, double y1) {
    const auto a = static_cast<uint32_t>(to.positions.size());
    to.positions.insert(to.positions.end(), {{x0, y0, 0}, {x1, y0, 0}, {x1, y1, 0}, {x0, y1, 0}});
    to.faces.insert(to.faces.end(), {{a, a + 1, a + 2}, {a, a + 2, a + 3}});
  };
  cell(left, 0.0, 0.0, 0.5, 1.0);
  cell(right, 0.5, 0.0, 0.6, 1.0);
  cell(right, 0.9, 0.0, 1.0, 1.0);
  cell(right, 0.6, 0.0, 0.9, 0.3);
  cell(right, 0.6, 0.7, 0.9, 1.0);
  const render::Captured now = together(captured(left, camera.eye, 3), captured(right, camera.eye, 7));
  Shown shown{camera, [&]() -> const render::Captured& { return now; }, {}, "test"};
  const auto errors = [&](double bound_of_left) {
    shown.bound = [=](uint32_t node) { return node == 3 ? bound_of_left : 0.0; };
    const std::vector<NodeError> found = ruler.lay(shown)->node_errors();
    REQUIRE(found.size() == 2);
    return std::pair(found[0].max, found[1].max);
  };
  // Along x = 0.75 from y = 0.45 to 0.55 both sides of the hole are as far as can be.
  CHECK(errors(0.0).first < 1e-6);
  CHECK(errors(0.0).second == Approx(0.15).epsilon(kMaxTolerance));
  // Held to what it does not claim, the right one leaves the hole to the left one, which does: to x = 0.9.
  CHECK(errors(0.45).first == Approx(0.4).epsilon(kMaxTolerance));
  CHECK(errors(0.45).second < 1e-6);
}

TEST_CASE("a triangle faces as the source does; of a sheet thinner than its bound nothing is said") {
  const Arrays up = plate(2);
  Arrays down = moved(up, {0.0, 0.0, -0.1}), turned = up;
  for (Face& face : down.faces) std::swap(face[0], face[1]);
  std::swap(turned.faces[3][0], turned.faces[3][1]);
  const glm::dvec3 eye(0.5, 0.5, 2.0);
  const MeshRuler sheet(mesh_of(both(up, down)));
  const auto inverted = [&](const Arrays& drawn, double bound) {
    const Orientation found = sheet.orientation(captured(drawn, eye), [bound](uint32_t) { return bound; });
    CHECK_FALSE(found.slanted_fillers.has_value());
    return found.inverted;
  };
  CHECK(inverted(both(up, down), 0.0) == 0);
  CHECK(inverted(turned, 0.0) == 1);
  CHECK(inverted(moved(turned, {0.0, 0.0, 0.01}), 0.0) == 0);  // beyond its bound: that is said elsewhere
  CHECK(inverted(moved(turned, {0.0, 0.0, 0.01}), 0.02) == 1);
  CHECK(inverted(turned, 0.11) == 0);
}

TEST_CASE("pixels see the closest point of the other surface") {
  const Arrays source = plate(4);
  const MeshRuler ruler(mesh_of(source));
  const Camera camera = above({0.5, 0.5, 2.0});
  const render::Captured lifted = captured(moved(source, {0.0, 0.0, 0.25}), camera.eye);
  const auto laid = lay(ruler, camera, lifted);
  std::vector<glm::dvec3> points{{0.25, 0.0, -2.0}}, found(1);
  laid->to_drawn()(points, found);
  CHECK(found[0].z == Approx(-1.75));
  points[0] = {0.25, 0.0, -1.75};
  laid->to_source()(points, found);
  CHECK(found[0].z == Approx(-2.0));
  CHECK(!laid->to_drawn_before());
}

TEST_CASE("vertices that are not finite are named, and eyes too far away are refused") {
  const Arrays source = plate(1);
  const MeshRuler ruler(mesh_of(source));
  const Camera camera = above({0.5, 0.5, 2.0});
  render::Captured broken = captured(source, camera.eye, 5);
  broken.vertices[4].y = std::numeric_limits<float>::quiet_NaN();
  CHECK_THROWS_AS(lay(ruler, camera, broken)->samples(), InvalidInput);
  CHECK_NOTHROW(ruler.check_near({100.0, 0.0, 0.0}));
  CHECK_THROWS_AS(ruler.check_near({1e5, 0.0, 0.0}), InvalidInput);
  CHECK(ruler.slack({0.0, 0.0, 3.0}) >= world_slack(3.0));
}
