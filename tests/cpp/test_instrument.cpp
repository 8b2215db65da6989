// SPDX-License-Identifier: MIT
// The instrument against surfaces made by hand, whose errors are known on paper. No GL.
#include <doctest/doctest.h>

#include <limits>

#include "base/errors.h"
#include "base/parallel.h"
#include "instrument/crack_pixels.h"
#include "instrument/field_ruler.h"
#include "instrument/orientation.h"
#include "instrument/picture_difference.h"
#include "instrument/pixel_error.h"
#include "instrument/sample_error.h"
#include "instrument/screen.h"
#include "instrument/slack.h"
#include "synthetic.h"

using namespace lodlab;
using namespace lodlab::instrument;
using synthetic::add;
using synthetic::flat;
using synthetic::mesh;

namespace {

const synthetic::Height kTilted = [](int64_t row, int64_t col) {
  return 0.25 * double(row) - 0.5 * double(col);
};

/// Looks straight down from `height` above the middle of a 9 x 9 field; 100 pixels a metre at distance 10.
Camera from_above(double height = 10.0) {
  View view;
  view.eye = {4.0, -4.0, height};
  view.target = {4.0, -4.0, 0.0};
  view.up = {0.0, 1.0, 0.0};
  view.width = view.height = 1000;
  view.fov = 2.0 * std::atan(0.5) * 57.295779513082320877;
  view.near_plane = 0.5;
  return make_camera(view);
}

render::Picture picture(int width, int height, uint8_t red) {
  render::Picture out{width, height, std::vector<uint8_t>(size_t(4 * width * height), 0), {}};
  for (size_t i = 0; i < out.rgba.size(); i += 4) out.rgba[i] = red;
  return out;
}

void set(render::Picture& p, int x, int y, uint8_t red) { p.rgba[size_t(4 * (y * p.width + x))] = red; }

}  // namespace

TEST_CASE("slack is four float steps") {
  CHECK(float_step(1.0) == 0x1p-23);
  CHECK(float_step(1.99) == 0x1p-23);
  CHECK(float_step(-3.0) == 0x1p-22);
  CHECK(float_step(0.0) == 0.0);
  CHECK(world_slack(1e6) == 4.0 * double(std::nextafter(1e6f, 2e6f) - 1e6f));
}

TEST_CASE("the slack of a vertex counts a cell, however near the eye is, and the doubles on the way") {
  FieldFrame frame = flat(9, 9);
  frame.dx = 30.0;
  frame.dy = 2.0;
  const glm::dvec3 near(0.01, -0.01, 0.0), eye(100.0, -100.0, 3.0);
  CHECK(grid_slack(frame, near, eye).x == doctest::Approx(world_slack(30.0)));
  CHECK(grid_slack(frame, near, eye).y == doctest::Approx(world_slack(2.0)));
  CHECK(grid_slack(frame, {500.0, 0.0, 1e6}, eye).x == doctest::Approx(world_slack(500.0)));
  CHECK(vertex_slack(frame, near, eye) == doctest::Approx(world_slack(30.0)));
  CHECK(vertex_slack(frame, {3.0, 0.0, 400.0}, eye) == doctest::Approx(world_slack(400.0)));
  CHECK(vertex_slack(frame, near, {1e12, 0.0, 0.0}) >= 1e-3);
  frame.planet = true;
  CHECK(vertex_slack(frame, near, {0.0, 0.0, 6.4e6}) == doctest::Approx(1.28e-8).epsilon(0.2));
}

TEST_CASE("the source drawn as it is has no error, no crack, no hole") {
  const auto source = synthetic::field(flat(9, 9), kTilted);
  const SampleGrid grid(*source);
  const auto captured = mesh(*source, {3.3, -2.7, 40.0}, kTilted);
  const DrawnSurface surface(*source, grid, captured);
  const SampleError error = sample_error(*source, surface);
  CHECK(error.samples == 81);
  CHECK(error.holes == 0);
  CHECK(error.max <= world_slack(45.0));
  CHECK(crack_edges(grid, captured) == 0);
}

TEST_CASE("a bump on a tilted plane is measured in full") {
  const synthetic::Height bumped = [](int64_t row, int64_t col) {
    return kTilted(row, col) + (row == 4 && col == 5 ? 3.0 : 0.0);
  };
  const auto source = synthetic::field(flat(9, 9), bumped);
  const SampleGrid grid(*source);
  for (const int64_t step : {1, 2, 8}) {  // the plane without its bump, in small and in large triangles
    const DrawnSurface surface(*source, grid, mesh(*source, {4.0, -4.0, 10.0}, kTilted, step));
    const SampleError error = sample_error(*source, surface);
    CHECK(error.max == doctest::Approx(3.0).epsilon(1e-6));
    CHECK(error.rms == doctest::Approx(3.0 / 9.0).epsilon(1e-6));
    CHECK(surface.deviation(4 * 9 + 5) == doctest::Approx(-3.0).epsilon(1e-6));
  }
}

TEST_CASE("screen distance of a displaced sample is that of the pinhole") {
  const Camera camera = from_above();
  CHECK(camera.K == doctest::Approx(1000.0));
  const synthetic::Height bumped = [](int64_t row, int64_t col) { return row == 4 && col == 6 ? 2.0 : 0.0; };
  const auto source = synthetic::field(flat(9, 9), bumped);
  const SampleGrid grid(*source);
  const synthetic::Height level = [](int64_t, int64_t) { return 0.0; };
  const DrawnSurface surface(*source, grid, mesh(*source, camera.eye, level));
  // The sample is 2 m right of the axis at depth 8, its correspondent at depth 10: K (2 / 8 - 2 / 10).
  CHECK(sample_error_px(*source, grid, surface, InView(*source, false, camera)) ==
        doctest::Approx(50.0).epsilon(1e-6));
}

TEST_CASE("what lies behind the near plane is clamped to it along the segment") {
  const Camera camera = from_above();
  const glm::dvec3 seen(1.0, 0.0, -1.0), behind(1.0, 0.0, 1.0);
  // The segment meets the near plane (depth 0.5) right above: K (1 / 0.5 - 1 / 1).
  CHECK(screen_distance(camera, seen, behind) == doctest::Approx(1000.0));
  CHECK(screen_distance(camera, behind, seen) == doctest::Approx(1000.0));
  CHECK(screen_distance(camera, behind, behind * 2.0) == 0.0);
}

TEST_CASE("samples outside the frustum do not count on screen") {
  View view;
  view.eye = {4.0, -4.0, 10.0};
  view.target = {4.0, -4.0, 20.0};  // looks up, away from the field
  view.up = {0.0, 1.0, 0.0};
  const Camera camera = make_camera(view);
  const auto source = synthetic::field(flat(9, 9), kTilted);
  const SampleGrid grid(*source);
  const DrawnSurface surface(*source, grid, mesh(*source, camera.eye, kTilted, 8));
  CHECK(std::isnan(sample_error_px(*source, grid, surface, InView(*source, false, camera))));
}

TEST_CASE("a planet's horizon hides what is beyond it from outside, nothing from within") {
  const double radius = 1000.0;
  const glm::dvec3 eye(3000.0, 0.0, 0.0);
  const Horizon horizon(radius, eye);
  const double rim = std::acos(radius / 3000.0);  // of the sphere, as seen from its centre
  const auto at = [](double r, double angle) {
    return r * glm::dvec3(std::cos(angle), std::sin(angle) * 0.6, std::sin(angle) * 0.8);
  };
  for (const double height : {0.0, 1.0, 300.0, 5000.0}) {
    CAPTURE(height);
    const double last = rim + std::acos(radius / (radius + height));
    CHECK_FALSE(horizon.hides(at(radius + height, last - 1e-6) - eye));
    CHECK(horizon.hides(at(radius + height, last + 1e-6) - eye));
    CHECK_FALSE(horizon.hides(at(radius + height, 0.0) - eye));
    CHECK(horizon.hides(at(radius + height, 3.14) - eye));
    const Horizon within(radius, {999.0, 0.0, 0.0});
    CHECK_FALSE(within.hides(at(radius + height, 3.0) - glm::dvec3(999.0, 0.0, 0.0)));
    // A cone reaches as far as its own angle.
    for (const double angle : {0.0, 0.3}) {
      const double raised = angle + std::acos(radius / (radius + height));
      const auto cone = [&](double middle) {
        return Cone{at(1.0, middle), std::cos(raised), std::sin(raised)};
      };
      CHECK_FALSE(horizon.hides(cone(rim + raised - 1e-6)));
      CHECK(horizon.hides(cone(rim + raised + 1e-6)) == (rim + raised < 3.14));
      CHECK_FALSE(within.hides(cone(3.1)));
    }
  }
  const Horizon none(0.0, eye);
  CHECK_FALSE(none.hides(at(10.0, 3.0) - eye));
}

TEST_CASE("samples beyond a planet's horizon do not count on screen") {
  View view;
  view.eye = {3000.0, 0.0, 0.0};
  view.target = glm::dvec3(0.0);
  const Camera camera = make_camera(view);
  FieldFrame frame = synthetic::planet(19, 36);
  for (const bool low : {false, true}) {  // one low sample, and the horizon is farther
    const auto source = synthetic::field(
        frame, [&](int64_t row, int64_t col) { return low && row == 3 && col == 18 ? -500.0 : 0.0; });
    const SampleGrid grid(*source);
    // The horizon is acos((1000 - 500 low) / 3000) off the axis, for samples on the sphere acos(1 - 0.5 low)
    // farther.
    for (const int64_t col : {7, 8, 14, 15}) {
      const auto drawn = mesh(*source, camera.eye, [&](int64_t row, int64_t at) {
        return row == 9 && at == col ? 100.0 : source->at(row, at);
      });
      const DrawnSurface surface(*source, grid, drawn);
      const double found = sample_error_px(*source, grid, surface, InView(*source, false, camera));
      CHECK((found > 1.0) == (static_cast<double>(col) * 10.0 < (low ? 80.4 + 60.0 : 70.5)));
    }
  }
}

TEST_CASE(
    "a planet with an opening has no horizon: samples seen past a patch's border or through a void count") {
  View view;
  view.eye = {3000.0, 0.0, 0.0};
  view.target = glm::dvec3(0.0);
  const Camera camera = make_camera(view);
  const glm::dvec3 far(-4000.0, 0.0, 0.0);  // the far side, relative to the eye
  const FieldFrame globe = synthetic::planet(19, 36);
  CHECK_FALSE(InView(globe, false, camera)(far));
  CHECK(InView(globe, true, camera)(far));
  FieldFrame window = globe, cap = globe;
  window.wraps = false;
  cap.rows = 18;  // no South Pole
  CHECK(InView(window, false, camera)(far));
  CHECK(InView(cap, false, camera)(far));
}

TEST_CASE("a missing triangle leaves holes, and cracks along its edges inside the source") {
  const auto source = synthetic::field(flat(9, 9), kTilted);
  const SampleGrid grid(*source);
  auto captured = mesh(*source, {4.0, -4.0, 10.0}, kTilted, 4);
  // Cell (4, 4): an even one, cut from north-west to south-east. Its first triangle has corners
  // (4, 4), (8, 4), (8, 8); inside it lie (6, 5), (7, 5), (7, 6), on the border edge (8, 5), (8, 6), (8, 7).
  const size_t triangle = 6;
  auto& vertices = captured.vertices;
  for (size_t i = 3 * triangle; i + 3 < vertices.size(); ++i) vertices[i] = vertices[i + 3];
  vertices.resize(vertices.size() - 3);
  const DrawnSurface surface(*source, grid, captured);
  const SampleError error = sample_error(*source, surface);
  CHECK(error.holes == 6);
  CHECK(error.samples == 81);
  CHECK(std::isinf(error.max));
  CHECK(std::isinf(error.rms));
  CHECK(std::isinf(sample_error_px(*source, grid, surface, InView(*source, false, from_above(20.0)))));
  CHECK(crack_edges(grid, captured) == 2);  // its third edge is the source's border
}

TEST_CASE("void samples are left out") {
  std::vector<uint8_t> valid(81, 1);
  valid[4 * 9 + 5] = 0;
  const synthetic::Height bumped = [](int64_t row, int64_t col) {
    return kTilted(row, col) + (row == 4 && col == 5 ? 3.0 : 0.0);
  };
  const auto source = synthetic::field(flat(9, 9), bumped, valid);
  const SampleGrid grid(*source);
  const DrawnSurface surface(*source, grid, mesh(*source, {4.0, -4.0, 10.0}, kTilted));
  const SampleError error = sample_error(*source, surface);
  CHECK(error.samples == 80);
  CHECK(error.max <= world_slack(20.0));
}

TEST_CASE("a step between two half-planes is one crack edge a side") {
  const auto source = synthetic::field(flat(3, 5), kTilted);
  const SampleGrid grid(*source);
  render::Captured captured;
  captured.eye = {2.0, -1.0, 10.0};
  const synthetic::Height raised = [](int64_t row, int64_t col) { return kTilted(row, col) + 0.125; };
  add(captured, *source, kTilted, {0, 0}, {2, 0}, {2, 2}, 1);
  add(captured, *source, kTilted, {0, 0}, {2, 2}, {0, 2}, 1);
  add(captured, *source, raised, {0, 2}, {2, 2}, {2, 4}, 2);
  add(captured, *source, raised, {0, 2}, {2, 4}, {0, 4}, 2);
  CHECK(crack_edges(grid, captured) == 2);
  std::vector<float> worst;
  const SampleError error = sample_error(*source, DrawnSurface(*source, grid, captured, &worst));
  CHECK(error.max == doctest::Approx(0.125).epsilon(1e-5));  // on the shared edge the worst of both counts
  const auto nodes = worst_of_nodes(captured, worst);
  REQUIRE(nodes.size() == 2);
  CHECK(nodes[0].node == 1);
  CHECK(nodes[0].max <= world_slack(12.0));
  CHECK(nodes[1].max == doctest::Approx(0.125).epsilon(1e-5));
}

TEST_CASE("one bit is a crack, the sign of zero is none, a T-junction is three") {
  const synthetic::Height level = [](int64_t, int64_t) { return 0.0; };
  const auto source = synthetic::field(flat(5, 5), level);
  const SampleGrid grid(*source);
  auto captured = mesh(*source, {2.0, -2.0, 0.0}, level, 2);
  REQUIRE(crack_edges(grid, captured) == 0);
  for (size_t i = 0; i < captured.vertices.size(); i += 2) captured.vertices[i].z = -0.0f;
  CHECK(crack_edges(grid, captured) == 0);
  // The corner of one triangle at the middle of the field: the two edges that meet there fail on both sides.
  for (render::CapturedVertex& v : captured.vertices) {
    if (v.x != 0.0f || v.y != 0.0f) continue;
    v.z = std::numeric_limits<float>::denorm_min();
    break;
  }
  CHECK(crack_edges(grid, captured) == 4);
  // A fine row against a coarse one: two short edges on one side, a long one on the other.
  render::Captured junction;
  junction.eye = {2.0, -2.0, 5.0};
  add(junction, *source, level, {0, 0}, {2, 0}, {2, 4});
  add(junction, *source, level, {0, 0}, {2, 4}, {0, 4});
  add(junction, *source, level, {2, 0}, {4, 0}, {2, 2});
  add(junction, *source, level, {2, 2}, {4, 0}, {4, 4});
  add(junction, *source, level, {2, 2}, {4, 4}, {2, 4});
  CHECK(crack_edges(grid, junction) == 3);
}

TEST_CASE("collapsed triangles and fillers make no cracks; doubled triangles do") {
  const auto source = synthetic::field(flat(5, 5), kTilted);
  const SampleGrid grid(*source);
  auto captured = mesh(*source, {2.0, -2.0, 9.0}, kTilted);
  add(captured, *source, kTilted, {1, 1}, {2, 2}, {1, 1});
  const synthetic::Height deep = [](int64_t, int64_t) { return -50.0; };
  add(captured, *source, deep, {1, 1}, {3, 3}, {1, 3});
  captured.vertices.back().bits = 1;
  CHECK(crack_edges(grid, captured) == 0);
  CHECK(sample_error(*source, DrawnSurface(*source, grid, captured)).max <= world_slack(20.0));
  add(captured, *source, kTilted, {1, 1}, {2, 1}, {2, 2});  // there already
  CHECK(crack_edges(grid, captured) == 3);                  // its neighbours have two opposites
}

TEST_CASE("crack edges are found among many") {
  const auto source = synthetic::field(flat(301, 301), kTilted);
  const SampleGrid grid(*source);
  auto captured = mesh(*source, {150.0, -150.0, 50.0}, kTilted);
  REQUIRE(crack_edges(grid, captured) == 0);
  // Three triangles far apart, inside: each leaves its three neighbours alone.
  for (const size_t triangle : {100000u, 70000u, 40000u}) {
    const auto at = captured.vertices.begin() + int64_t(3 * triangle);
    captured.vertices.erase(at, at + 3);
  }
  CHECK(crack_edges(grid, captured) == 9);
  set_thread_count(1);
  CHECK(crack_edges(grid, captured) == 9);
  set_thread_count(0);
}

TEST_CASE("slivers are measured, lines and vertical walls are not") {
  const synthetic::Height level = [](int64_t, int64_t) { return 0.0; };
  const auto source = synthetic::field(flat(2, 1001), level);
  const SampleGrid grid(*source);
  render::Captured captured;
  captured.eye = {500.0, 0.0, 10.0};
  add(captured, *source, level, {0, 0}, {1, 1000}, {0, 1000});
  add(captured, *source, level, {0, 0}, {1, 0}, {1, 1000});
  CHECK(sample_error(*source, DrawnSurface(*source, grid, captured)).holes == 0);
  const synthetic::Height high = [](int64_t, int64_t col) { return col == 500 ? 80.0 : 0.0; };
  add(captured, *source, high, {0, 0}, {0, 500}, {0, 1000});
  CHECK(sample_error(*source, DrawnSurface(*source, grid, captured)).max == 0.0);
}

TEST_CASE("shared edges count as covered where float positions are coarse") {
  // Positions near a million metres from the eye: float steps of 1/16 m, cells of 1 m that do not fit them.
  const auto frame = flat(40, 40, 1.003, 123456.789, 98765.4321);
  const auto source = synthetic::field(frame, kTilted);
  const SampleGrid grid(*source);
  const glm::dvec3 eye{1.1e6, -0.9e6, 3e5};
  for (const int64_t step : {1, 3, 13, 39}) {
    const auto captured = mesh(frame, eye, kTilted, step);
    const SampleError error = sample_error(*source, DrawnSurface(*source, grid, captured));
    CHECK(error.holes == 0);
    CHECK(error.max <= world_slack(1.5e6));
    CHECK(crack_edges(grid, captured) == 0);
  }
}

TEST_CASE("rounding of positions is no error on a cliff") {
  const synthetic::Height cliffs = [](int64_t row, int64_t col) {
    return (row * 7 + col * 3) % 5 == 0 ? 9000.0 : 0.0;
  };
  const auto frame = flat(30, 30, 1.001);
  const auto source = synthetic::field(frame, cliffs);
  const SampleGrid grid(*source);
  const glm::dvec3 eye{-7000.3, 8000.7, 12000.1};
  const DrawnSurface surface(*source, grid, mesh(frame, eye, cliffs));
  CHECK(sample_error(*source, surface).max <= world_slack(17000.0));
}

TEST_CASE("triangles between the samples cover what lies in them") {
  const synthetic::Height level = [](int64_t, int64_t) { return 0.0; };
  const auto source = synthetic::field(flat(5, 5), level);
  const SampleGrid grid(*source);
  render::Captured captured;
  captured.eye = {0.0, 0.0, 8.0};
  for (const glm::dvec3 world :
       {glm::dvec3(0.5, -0.5, 1.0), glm::dvec3(0.5, -3.5, 1.0), glm::dvec3(3.5, -0.5, 4.0)}) {
    captured.vertices.push_back(synthetic::vertex(world, captured.eye));
  }
  const DrawnSurface surface(*source, grid, captured);
  int covered = 0;
  for (int64_t i = 0; i < 25; ++i) covered += surface.covered(i) ? 1 : 0;
  CHECK(covered ==
        6);  // (1, 1) to (1, 3), (2, 1), (2, 2) and (3, 1): x + y <= 4 holds with equality at three
  CHECK(surface.deviation(1 * 5 + 2) == doctest::Approx(2.5));
}

TEST_CASE("threads do not change a bit") {
  const auto source = synthetic::field(flat(200, 150), [](int64_t row, int64_t col) {
    return 10.0 * std::sin(0.3 * double(row)) + 7.0 * std::cos(0.2 * double(col * row % 37));
  });
  const SampleGrid grid(*source);
  const synthetic::Height own = [&](int64_t row, int64_t col) { return double(source->at(row, col)); };
  const auto captured = mesh(*source, {70.0, -80.0, 60.0}, own, 6);
  set_thread_count(1);
  const DrawnSurface one(*source, grid, captured);
  const SampleError error_one = sample_error(*source, one);
  set_thread_count(2);
  const DrawnSurface two(*source, grid, captured);
  const SampleError error_two = sample_error(*source, two);
  set_thread_count(0);
  CHECK(error_one.max == error_two.max);
  CHECK(error_one.rms == error_two.rms);
  CHECK(error_one.max > 1.0);
  bool same = true;
  for (int64_t i = 0; i < grid.size(); ++i) same = same && one.deviation(i) == two.deviation(i);
  CHECK(same);
}

TEST_CASE("vertices that are not finite are refused, and their node is named") {
  const auto source = synthetic::field(flat(5, 5), kTilted);
  const SampleGrid grid(*source);
  auto captured = mesh(*source, {2.0, -2.0, 9.0}, kTilted);
  captured.vertices[10].z = std::numeric_limits<float>::quiet_NaN();
  captured.vertices[10].node = 4711;
  CHECK_THROWS_WITH_AS(DrawnSurface(*source, grid, captured), doctest::Contains("node 4711"), InvalidInput);
}

TEST_CASE("nothing drawn: every sample is a hole, no crack") {
  const auto source = synthetic::field(flat(5, 5), kTilted);
  const SampleGrid grid(*source);
  const render::Captured nothing;
  std::vector<float> worst;
  const DrawnSurface surface(*source, grid, nothing, &worst);
  CHECK(sample_error(*source, surface).holes == 25);
  CHECK(crack_edges(grid, nothing) == 0);
  CHECK(worst_of_nodes(nothing, worst).empty());
  CHECK(orientation(grid, nothing).inverted == 0);
}

TEST_CASE("a jump is measured where both surfaces are") {
  const Camera camera = from_above();
  const synthetic::Height level = [](int64_t, int64_t) { return 0.0; };
  const synthetic::Height lifted = [](int64_t row, int64_t col) { return row == 4 && col == 6 ? 2.0 : 0.0; };
  const auto source = synthetic::field(flat(9, 9), level);
  const SampleGrid grid(*source);
  const DrawnSurface before(*source, grid, mesh(*source, camera.eye, level));
  const DrawnSurface after(*source, grid, mesh(*source, camera.eye, lifted));
  CHECK(surface_jump(*source, grid, before, after, InView(*source, false, camera)) ==
        doctest::Approx(50.0).epsilon(1e-6));
  CHECK(surface_jump(*source, grid, before, before, InView(*source, false, camera)) == 0.0);
  const DrawnSurface nothing(*source, grid, render::Captured{});
  CHECK(std::isnan(surface_jump(*source, grid, before, nothing, InView(*source, false, camera))));
}

TEST_CASE("winding: one triangle turned round is inverted, and no crack hides it") {
  for (const bool round : {false, true}) {
    const FieldFrame frame = round ? synthetic::planet(19, 36) : flat(9, 9);
    const synthetic::Height level = [](int64_t, int64_t) { return 0.0; };
    const auto source = synthetic::field(frame, level);
    const SampleGrid grid(*source);
    auto captured = mesh(frame, {1300.0, 20.0, 30.0}, level);
    CHECK(orientation(grid, captured).inverted == 0);
    std::swap(captured.vertices[30], captured.vertices[31]);
    CHECK(orientation(grid, captured).inverted == 1);
    for (size_t i = 30; i < 33; ++i) captured.vertices[i].bits |= 1u;  // as a filler it is one that lies flat
    CHECK(orientation(grid, captured).inverted == 0);
    CHECK(orientation(grid, captured).slanted_fillers == 1);
  }
}

TEST_CASE("fillers that hang straight down are vertical, on planets too") {
  for (const bool round : {false, true}) {
    const FieldFrame frame = round ? synthetic::planet(19, 36) : flat(9, 9);
    const auto source = synthetic::field(frame, kTilted);
    const SampleGrid grid(*source);
    render::Captured captured;
    captured.eye = {1300.0, 20.0, 30.0};
    for (const double drop : {0.0, 5.0}) {
      captured.vertices.push_back(synthetic::vertex(frame.position(4, 3, -drop), captured.eye));
    }
    captured.vertices.push_back(synthetic::vertex(frame.position(4, 4, 2.0), captured.eye));
    for (auto& v : captured.vertices) v.bits |= 1u;
    CHECK(orientation(grid, captured).slanted_fillers == 0);
    captured.vertices[1] = synthetic::vertex(frame.position(5, 3, -5.0), captured.eye);
    captured.vertices[1].bits |= 1u;
    CHECK(orientation(grid, captured).slanted_fillers == 1);
  }
}

TEST_CASE("a whole planet: poles, the wrap and every sample") {
  const synthetic::Height hills = [](int64_t row, int64_t col) {
    return row == 0 || row == 18 ? 5.0 : 10.0 * std::sin(double(row) * 0.7 + double(col));
  };
  const auto frame = synthetic::planet(19, 36);
  const auto source = synthetic::field(frame, hills);
  const SampleGrid grid(*source);
  const glm::dvec3 eye{3000.0, 100.0, 200.0};
  const auto captured = mesh(frame, eye, hills);
  const SampleError error = sample_error(*source, DrawnSurface(*source, grid, captured));
  CHECK(error.holes == 0);
  CHECK(error.samples == 19 * 36);
  CHECK(error.max <= world_slack(4200.0));
  CHECK(crack_edges(grid, captured) == 0);
}

TEST_CASE("a planet's octant has the depth of its chord plane") {
  // The triangle of the three axes lies radius / sqrt(3) from the centre; seen along (1, 1, 1).
  const auto frame = synthetic::planet(5, 8);  // steps of 45 degrees: rows 90, 45, 0, -45, -90
  const synthetic::Height level = [](int64_t, int64_t) { return 0.0; };
  const auto source = synthetic::field(frame, level);
  const SampleGrid grid(*source);
  render::Captured captured;
  add(captured, frame, level, {0, 0}, {2, 0}, {2, 2});
  const DrawnSurface surface(*source, grid, captured);
  int covered = 0;
  for (int64_t i = 0; i < grid.size(); ++i) covered += surface.covered(i) ? 1 : 0;
  CHECK(covered == 8 + 3 + 3);  // the pole's columns, and longitudes 0, 45, 90 of two rows
  // Latitude 45, longitude 45: direction (0.5, 0.5, sqrt(1 / 2)); the plane x + y + z = 1000.
  CHECK(surface.deviation(1 * 8 + 1) ==
        doctest::Approx(1000.0 / (1.0 + std::sqrt(0.5)) - 1000.0).epsilon(1e-6));
  CHECK(surface.deviation(2 * 8 + 1) == doctest::Approx(1000.0 * std::sqrt(0.5) - 1000.0).epsilon(1e-6));
}

TEST_CASE("a triangle that holds a pole covers all longitudes near it") {
  const auto frame = synthetic::planet(181, 90);
  const synthetic::Height level = [](int64_t, int64_t) { return 0.0; };
  const auto source = synthetic::field(frame, level);
  const SampleGrid grid(*source);
  for (const int64_t row : {20, 160}) {
    render::Captured captured;
    add(captured, frame, level, {row, 10}, {row, 40}, {row, 70});
    const DrawnSurface surface(*source, grid, captured);
    const int64_t pole = row < 90 ? 0 : 180, step = row < 90 ? 1 : -1;
    // An edge over 120 degrees of longitude comes as near to the pole as atan(tan(20) cos(60)) = 10.3
    // degrees.
    for (int64_t near = 0; near <= 10; ++near) {
      bool all = true;
      for (int64_t col = 0; col < 90; ++col) all = all && surface.covered((pole + step * near) * 90 + col);
      CHECK_MESSAGE(all, "row " << near << " from the pole");
    }
    CHECK_FALSE(surface.covered((pole + step * 11) * 90 + 25));
    CHECK(surface.covered((pole + step * 20) * 90 + 40));
    CHECK_FALSE(surface.covered((180 - pole) * 90));
  }
}

TEST_CASE("coarse triangles of a planet leave no hole, wherever the eye is") {
  const synthetic::Height level = [](int64_t, int64_t) { return 0.0; };
  const auto frame = synthetic::planet(33, 64, 6.4e6);
  const auto source = synthetic::field(frame, level);
  const SampleGrid grid(*source);
  for (const glm::dvec3 eye :
       {glm::dvec3(6.5e6, 10.0, 20.0), glm::dvec3(-1e5, 3e5, 7e6), glm::dvec3(3e7, -4e7, 1e7)}) {
    const auto captured = mesh(frame, eye, level, 8);
    CHECK(sample_error(*source, DrawnSurface(*source, grid, captured)).holes == 0);
    CHECK(crack_edges(grid, captured) == 0);
  }
}

TEST_CASE("a planet's patch knows its border") {
  FieldFrame frame = synthetic::planet(9, 9, 1000.0);
  frame.wraps = false;
  frame.lat0 = 60.0;
  frame.lon0 = 170.0;  // across the date line
  frame.dlat = frame.dlon = 3.0;
  const auto source = synthetic::field(frame, kTilted);
  const SampleGrid grid(*source);
  const auto captured = mesh(frame, {-1500.0, 0.0, 900.0}, kTilted);
  const SampleError error = sample_error(*source, DrawnSurface(*source, grid, captured));
  CHECK(error.holes == 0);
  CHECK(error.max <= world_slack(2000.0));
  CHECK(crack_edges(grid, captured) == 0);
}

TEST_CASE("pixels of the reference are measured by the source's own triangles") {
  const Camera camera = from_above();
  const synthetic::Height level = [](int64_t, int64_t) { return 0.0; };
  const synthetic::Height spike = [](int64_t row, int64_t col) { return row == 4 && col == 6 ? 2.0 : 0.0; };
  const auto source = synthetic::field(flat(9, 9), level);
  const SampleGrid grid(*source);
  const DrawnSurface surface(*source, grid, mesh(*source, camera.eye, spike));
  for (const glm::dvec2 place :
       {glm::dvec2(5.5, 4.0), glm::dvec2(6.0, 3.5), glm::dvec2(6.5, 4.0), glm::dvec2(6.0, 4.5)}) {
    CHECK(interpolated_deviation(*source, surface, place) == doctest::Approx(1.0));
  }
  // Row + column of (4, 6) is even: diagonals of its cells all meet in it.
  CHECK(interpolated_deviation(*source, surface, {6.25, 4.25}) == doctest::Approx(1.5));
  CHECK(interpolated_deviation(*source, surface, {5.75, 4.25}) == doctest::Approx(1.5));
  CHECK(interpolated_deviation(*source, surface, {8.0, 8.0}) == 0.0);

  render::Picture reference = picture(1000, 1000, 255);
  reference.depth.assign(1000000, std::numeric_limits<float>::infinity());
  CHECK(std::isnan(pixel_error(along_up(*source, grid, surface, camera.eye, 1.0), reference, camera).p99));
  reference.depth[499 * 1000 + 700] = 10.0f;  // the pixel centre at x = 2.005, y = 0.005 of the eye
  const PixelError one = pixel_error(along_up(*source, grid, surface, camera.eye, 1.0), reference, camera);
  CHECK(one.pixels == 1);
  const double lifted = 2.0 * (1.0 - 0.005), reach = std::hypot(2.005, 0.005);
  CHECK(one.p99 == doctest::Approx(1000.0 * reach * (1.0 / (10.0 - lifted) - 0.1)).epsilon(1e-4));
  for (int i = 0; i < 99; ++i) reference.depth[size_t(i)] = 10.0f;  // far off: no error there
  const PixelError hundred =
      pixel_error(along_up(*source, grid, surface, camera.eye, 1.0), reference, camera);
  CHECK(hundred.p99 == doctest::Approx(0.0));
  CHECK(hundred.rms == doctest::Approx(one.rms / 10.0));
  View small;
  small.width = 10;
  CHECK_THROWS_AS(
      pixel_error(along_up(*source, grid, surface, camera.eye, 1.0), reference, make_camera(small)),
      InvalidInput);
}

TEST_CASE("the erosion is a Euclidean disc, and nothing is set beyond the picture's border") {
  CHECK(erosion_radius(0.0) == 1.0);
  CHECK(erosion_radius(72.5) == 73.5);
  CHECK(erosion_radius(std::numeric_limits<double>::quiet_NaN()) == 1.0);
  std::vector<uint8_t> mask(31 * 31, 1);
  mask[15 * 31 + 15] = 0;
  for (const double radius : {0.0, 1.0, 1.4, 1.5, 3.0, 4.2, 5.0, 13.9, 1e300}) {
    const std::vector<uint8_t> eroded = erode(mask, 31, 31, radius);
    bool disc = true;
    for (int y = 0; y < 31; ++y) {
      for (int x = 0; x < 31; ++x) {
        const int border = std::min({x, y, 30 - x, 30 - y}) + 1;
        const bool gone = std::hypot(x - 15, y - 15) <= radius || border <= radius;
        disc = disc && (eroded[size_t(y * 31 + x)] == 0) == gone;
      }
    }
    CHECK_MESSAGE(disc, "radius " << radius);
  }
}

TEST_CASE("crack pixels are clear colour or inside, within the eroded silhouette") {
  render::Picture reference = picture(60, 50, 255);  // of 40 x 30 pixels, ten more on each side
  for (int x = 0; x < 60; ++x) {
    for (int y = 0; y < 20; ++y) set(reference, x, y, 0);  // sky
  }
  render::Picture cut = reference;
  set(cut, 30, 20, 0);  // on the silhouette: eroded
  set(cut, 30, 21, 0);  // at distance 2 of the sky, survives a radius of 1
  set(cut, 10, 39, 128);
  set(cut, 9, 30, 128);  // outside the picture
  const auto found = [&](double error_px) { return crack_pixels(cut, reference, 40, 30, error_px); };
  CHECK(found(0.0).pixels == 2);
  CHECK(found(0.0).mask_share == doctest::Approx(19.0 / 20.0));
  CHECK(found(1.5).pixels == 1);
  CHECK(found(9.0).pixels == 1);
  CHECK(found(9.0).mask_share == doctest::Approx(0.5));  // 10 rows of 20 covered: the margin is wide enough
  CHECK(std::isnan(found(1e9).pixels));
  CHECK(crack_pixels(reference, reference, 40, 30, 0.0).pixels == 0);
  CHECK_THROWS_AS(crack_pixels(picture(59, 50, 0), reference, 40, 30, 0.0), InvalidInput);
  CHECK_THROWS_AS(crack_pixels(cut, reference, 61, 50, 0.0), InvalidInput);
}

TEST_CASE("where next to nothing is looked at, no crack is none") {
  render::Picture reference = picture(20, 20, 128), cut = reference;
  for (int x = 0; x < 20; ++x) {
    for (int y = 0; y < 4; ++y) set(reference, x, y, 255);
  }
  // Two rows of 18 pixels survive a radius of 1.
  CHECK(std::isnan(crack_pixels(cut, reference, 20, 20, 0.0).pixels));
  CHECK(crack_pixels(cut, reference, 20, 20, 0.0).mask_share == doctest::Approx(0.09));
  CHECK(crack_pixels(cut, reference, 18, 18, 0.0).pixels == 36);  // of 324
  const CrackPixels sky = crack_pixels(cut, picture(20, 20, 0), 20, 20, 0.0);
  CHECK((std::isnan(sky.pixels) && std::isnan(sky.mask_share)));
}

TEST_CASE("a filled void is not looked at for cracks") {
  render::Picture classes = picture(10, 10, 255), seen = classes;
  classes.depth.assign(100, 7.0f);
  seen.depth = classes.depth;
  classes.rgba[4 * 44] = 0;
  seen.depth[44] = 8.0f;                                    // nothing stays nothing
  seen.depth[45] = std::nextafter(7.0f, 8.0f);              // through a void to what lies behind
  seen.depth[46] = std::numeric_limits<float>::infinity();  // to nothing
  leave_out_voids(classes, seen);
  std::vector<int> found;
  for (int i = 43; i < 48; ++i) found.push_back(classes.rgba[4 * i]);
  CHECK(found == std::vector<int>{255, 0, 128, 128, 255});
}

TEST_CASE("the margin alone keeps its depths") {
  Camera wide = from_above(), camera = from_above();
  wide.width = 7, wide.height = 6, camera.width = 3, camera.height = 4;
  std::vector<float> depth(42, 5.0f);
  keep_margin(depth, wide, camera);
  for (int i = 0; i < 42; ++i) {
    const int x = i % 7, y = i / 7;
    CHECK(std::isinf(depth[size_t(i)]) == (x >= 2 && x < 5 && y >= 1 && y < 5));
  }
}

TEST_CASE("an eye stands free of what hangs over it and of what its near plane cuts") {
  Camera camera = from_above();
  camera.near_plane = 1.0;
  camera.s = 1.5;
  const auto free = [&](float x, float z) {
    render::Captured captured;
    for (const auto& [east, north] : {std::pair{0.0f, 0.0f}, {4.0f, 0.0f}, {0.0f, 4.0f}}) {
      captured.vertices.push_back({x + east, north - 1.0f, z, 0.0f, 0.0f, 0, 0});
    }
    return stands_free(captured, camera, {0.0, 0.0, 1.0});
  };
  CHECK(free(-1.0f, -1.6f));
  CHECK(!free(-1.0f, -1.4f));
  CHECK(!free(-1.0f, 100.0f));
  CHECK(free(0.1f, 100.0f));
  CHECK(!free(1.4f, 0.0f));
  CHECK(free(1.6f, 0.0f));
}

TEST_CASE("a silhouette just outside the picture erodes it") {
  render::Picture cut = picture(32, 32, 255), reference = picture(32, 32, 255);  // of 20 x 20 pixels
  set(cut, 16, 25, 0);
  CHECK(crack_pixels(cut, reference, 20, 20, 0.0).pixels == 1);
  for (int x = 0; x < 32; ++x) set(reference, x, 27, 0);
  CHECK(crack_pixels(cut, reference, 20, 20, 0.5).pixels == 1);
  CHECK(crack_pixels(cut, reference, 20, 20, 1.0).pixels == 0);
  CHECK(crack_pixels(cut, reference, 20, 20, 1.0).mask_share == doctest::Approx(0.95));
}

TEST_CASE("the margin widens the view and leaves its rays where they were") {
  const Camera camera = from_above(), wide = with_margin(camera);
  CHECK(wide.width == 1012);
  CHECK(wide.height == 1012);
  const glm::dvec3 point(1.0, 2.0, -10.0);
  CHECK(glm::distance(wide.project(point) - camera.project(point), {6.0, 6.0}) < 1e-9);
  View huge;
  huge.width = huge.height = 16384;
  CHECK(with_margin(make_camera(huge)).width == 16384);
}

TEST_CASE("pictures differ by what they differ by") {
  render::Picture a = picture(10, 10, 100), b = a;
  CHECK(std::isinf(psnr_db(a, b)));
  b.rgba[3] = 77;  // alpha does not count
  CHECK(std::isinf(psnr_db(a, b)));
  set(b, 3, 3, 130);  // 30^2 over 300 values: a mean square of 3
  CHECK(psnr_db(a, b) == doctest::Approx(10.0 * std::log10(255.0 * 255.0 / 3.0)));
  CHECK_THROWS_AS(psnr_db(a, picture(10, 9, 0)), InvalidInput);
  CHECK_THROWS_AS(depth_mismatch_pixels(a, b), InvalidInput);
  a.depth.assign(100, std::numeric_limits<float>::infinity());
  b.depth = a.depth;
  CHECK(depth_mismatch_pixels(a, b) == 0);
  b.depth[5] = 1.0f;
  b.depth[6] = std::nextafter(1.0f, 2.0f);
  a.depth[6] = 1.0f;
  CHECK(depth_mismatch_pixels(a, b) == 2);
}
