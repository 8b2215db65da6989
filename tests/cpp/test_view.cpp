// SPDX-License-Identifier: MIT
// Views, and what is drawn through them: places and depths of a known triangle, depth precision, capture,
// replay, coverage, planets. Everything ends without a GL error.
#include <doctest/doctest.h>
#include <epoxy/gl.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>

#include "base/errors.h"
#include "geometry/height_field.h"
#include "geometry/view.h"
#include "gl/context.h"
#include "gl/error.h"
#include "gl/framebuffer.h"
#include "gl/query.h"
#include "render/frame.h"
#include "render/gl_pass.h"
#include "render/replay.h"
#include "render/surface.h"

using namespace lodlab;
using render::Captured;
using render::CapturedVertex;
using render::Picture;
using render::Show;

namespace {

/// A square view of `size` pixels from the origin to the north, 90 degrees wide.
View north(int size) {
  View view;
  view.target = {0.0, 100.0, 0.0};
  view.fov = 90.0;
  view.width = view.height = size;
  view.near_plane = 0.1;
  return view;
}

FieldFrame flat_frame() {
  FieldFrame frame;
  frame.rows = frame.cols = 9;
  frame.z_min = -1.0;
  frame.z_max = 1.0;
  return frame;
}

std::shared_ptr<const render::Surface> resources(const FieldFrame& frame, const Bytes& coverage = {}) {
  return render::make_surface(frame, coverage);
}

void add(Captured& captured, glm::dvec3 a, glm::dvec3 b, glm::dvec3 c) {
  for (const glm::dvec3& p : {a, b, c}) {
    captured.vertices.push_back(
        {static_cast<float>(p.x), static_cast<float>(p.y), static_cast<float>(p.z), 0, 0, 0, 0});
  }
}

/// A wall across the view at this distance, facing the eye.
void add_wall(Captured& captured, double distance, double half) {
  const glm::dvec3 sw(-half, distance, -half), se(half, distance, -half), nw(-half, distance, half),
      ne(half, distance, half);
  add(captured, sw, se, ne);
  add(captured, sw, ne, nw);
}

/// A bumpy sheet of n x n cells below the eye, with grid coordinates, nodes and levels.
Captured sheet(int n) {
  Captured out;
  const auto corner = [&](int row, int col) {
    const auto x = static_cast<float>(col - n / 2) * 0.731f, y = 20.0f + static_cast<float>(n - row) * 0.517f;
    const float z = -9.0f + 2.0f * std::sin(x * 0.7f) * std::cos(y * 0.9f);
    return CapturedVertex{x, y, z, static_cast<float>(col), static_cast<float>(row), 0, 0};
  };
  for (int row = 0; row < n; ++row) {
    for (int col = 0; col < n; ++col) {
      for (const auto& [r, c] : {std::pair{0, 0}, {1, 0}, {1, 1}, {0, 0}, {1, 1}, {0, 1}}) {
        CapturedVertex v = corner(row + r, col + c);
        v.node = static_cast<uint32_t>(row);
        v.bits = static_cast<uint32_t>(col % 5) << 1;
        out.vertices.push_back(v);
      }
    }
  }
  return out;
}

render::DrawCall drawing(render::StaticMesh& mesh, const render::Surface& field) {
  return [&](render::Pass& pass) { mesh.draw(pass, field); };
}

size_t pixel(const Picture& picture, int x, int y) {
  return static_cast<size_t>(y) * static_cast<size_t>(picture.width) + static_cast<size_t>(x);
}

int red(const Picture& picture, int x, int y) { return picture.rgba[4 * pixel(picture, x, y)]; }

bool same(const Picture& a, const Picture& b) { return a.depth == b.depth && a.rgba == b.rgba; }

}  // namespace

TEST_CASE("view: matrix, projection and depth are one camera") {
  View view;
  view.eye = {1e6, -2e6, 3000.0};
  view.target = {1.01e6, -1.98e6, 100.0};
  view.fov = 73.0;
  view.width = 640;
  view.height = 480;
  const Camera camera = make_camera(view);
  std::mt19937 random(7);
  std::uniform_real_distribution<double> offset(-5000.0, 5000.0);
  for (int i = 0; i < 1000; ++i) {
    const glm::dvec3 relative =
        10000.0 * camera.forward + glm::dvec3(offset(random), offset(random), offset(random));
    const glm::dvec4 clip = camera.clip_from_relative() * glm::dvec4(relative, 1.0);
    const glm::dvec2 at = camera.project(relative);
    CHECK(at.x == doctest::Approx((clip.x / clip.w * 0.5 + 0.5) * view.width).epsilon(1e-9));
    CHECK(at.y == doctest::Approx((0.5 - clip.y / clip.w * 0.5) * view.height).epsilon(1e-9));
    CHECK(clip.w == doctest::Approx(camera.depth(relative)).epsilon(1e-12));
    CHECK(clip.z / clip.w == doctest::Approx(camera.near_plane / camera.depth(relative)).epsilon(1e-12));
  }
  CHECK(camera.near_plane == doctest::Approx(1e-4 * glm::length(view.target - view.eye)));
}

TEST_CASE("view: up is a direction, however long") {
  View view = north(64);
  view.up = {0.0, 1.0, 2.0};
  const glm::dvec3 up = make_camera(view).up;
  for (const double length : {1e200, 1e-200, 1e-310}) {
    view.up = length * glm::dvec3(0.0, 1.0, 2.0);
    CHECK(glm::length(make_camera(view).up - up) < 1e-9);
  }
}

TEST_CASE("view: what is no view is refused") {
  const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
  const auto refused = [](auto change) {
    View view = north(64);
    change(view);
    CHECK_THROWS_AS(make_camera(view), InvalidInput);
  };
  refused([&](View& v) { v.eye.x = nan; });
  refused([&](View& v) { v.target.y = inf; });
  refused([&](View& v) { v.up = {0, 0, 0}; });
  refused([&](View& v) { v.fov = 0.5; });
  refused([&](View& v) { v.fov = 171.0; });
  refused([&](View& v) { v.width = 0; });
  refused([&](View& v) { v.height = 100000; });
  refused([&](View& v) { v.target = v.eye; });
  refused([&](View& v) { v.near_plane = -1.0; });
  refused([&](View& v) { v.near_plane = 1e-40; });
  refused([&](View& v) {  // near: a ten-thousandth of the way
    v.target = v.eye + glm::dvec3(1e-34, 0, 0);
    v.near_plane = 0.0;
  });
  View straight_up = north(64);
  straight_up.target = {0, 0, 5};
  CHECK_NOTHROW(make_camera(straight_up));
}

TEST_CASE("picture: a known triangle covers the pixels and depths that geometry says") {
  const auto field = resources(flat_frame());
  Captured captured;  // in pixels of a 64 x 64 view: corners (32, 0), (0, 64), (64, 64) at distance 10
  add(captured, {-10, 10, -10}, {10, 10, -10}, {0, 10, 10});
  const Picture picture = render::replay(captured, make_camera(north(64)), *field, Show::kShade);
  const Picture classes = render::replay(captured, make_camera(north(64)), *field, Show::kClass);
  CHECK(picture.rgba.size() == 4 * 64 * 64);
  for (int y = 0; y < 64; ++y) {
    for (int x = 0; x < 64; ++x) {
      const double edge = std::abs(x + 0.5 - 32.0) * 2.0 - (y + 0.5);
      if (std::abs(edge) < 0.1) continue;  // the fill rule's
      const float depth = picture.depth[pixel(picture, x, y)];
      CHECK(std::isinf(depth) == (edge > 0.0));
      if (edge < 0.0) CHECK(depth == doctest::Approx(10.0).epsilon(1e-6));  // float depth: 2^-23 and rounding
      CHECK(red(classes, x, y) == (edge > 0.0 ? 0 : 255));
    }
  }
  gl::check("the triangle test");
}

TEST_CASE("picture: inside and outside of the surface") {
  const auto field = resources(flat_frame());
  Captured floor;  // counter-clockwise from above, 5 below the eye
  add(floor, {-50, 5, -5}, {50, 5, -5}, {0, 80, -5});
  Captured ceiling;
  add(ceiling, {-50, 5, 5}, {50, 5, 5}, {0, 80, 5});
  CHECK(red(render::replay(floor, make_camera(north(64)), *field, Show::kClass), 32, 50) == 255);
  CHECK(red(render::replay(ceiling, make_camera(north(64)), *field, Show::kClass), 32, 13) == 128);
}

TEST_CASE("depth: two planes 1 m apart at 100 km never fight") {
  const auto field = resources(flat_frame());
  Captured near_first, far_first;
  View view = north(256);
  view.near_plane = 1.0;
  add_wall(near_first, 100000.0, 60000.0);
  add_wall(near_first, 100001.0, 120000.0);
  add_wall(far_first, 100001.0, 120000.0);
  add_wall(far_first, 100000.0, 60000.0);
  for (const Captured* order : {&near_first, &far_first}) {
    const Picture picture = render::replay(*order, make_camera(view), *field, Show::kShade);
    int wrong = 0;
    for (int y = 60; y < 196; ++y) {
      for (int x = 60; x < 196; ++x) wrong += picture.depth[pixel(picture, x, y)] > 100000.5f;
    }
    CHECK(wrong == 0);
    CHECK(picture.depth[pixel(picture, 5, 5)] > 100000.5f);
  }
}

TEST_CASE("depth: a millimetre is seen at a metre, whatever the far end") {
  const auto field = resources(flat_frame());
  View view = north(64);
  view.near_plane = 0.001;
  Captured captured;
  add_wall(captured, 1.0, 0.1);
  add_wall(captured, 1.001, 2.0);
  add_wall(captured, 5e6, 1e7);
  const Picture picture = render::replay(captured, make_camera(view), *field, Show::kShade);
  CHECK(picture.depth[pixel(picture, 32, 32)] == doctest::Approx(1.0).epsilon(1e-6));
  CHECK(picture.depth[pixel(picture, 2, 2)] == doctest::Approx(1.001).epsilon(1e-6));
}

TEST_CASE("capture: what was drawn, in order, and it grows until nothing is lost") {
  const auto field = resources(flat_frame());
  for (const int n : {1, 7, 400}) {  // 400: 320,000 triangles, 27 MB, more than the first buffer
    const Captured source = sheet(n);
    render::StaticMesh mesh(source.vertices);
    const Captured captured = render::capture(make_camera(north(64)), drawing(mesh, *field), true);
    REQUIRE(captured.vertices.size() == source.vertices.size());
    CHECK(std::memcmp(captured.vertices.data(), source.vertices.data(),
                      source.vertices.size() * sizeof(CapturedVertex)) == 0);
  }
  gl::check("the capture test");
}

TEST_CASE("capture: several batches and programs in one draw") {
  const auto field = resources(flat_frame());
  const Captured first = sheet(3), second = sheet(5);
  render::StaticMesh a(first.vertices), b(second.vertices);
  const Captured captured = render::capture(
      make_camera(north(64)),
      [&](render::Pass& pass) {
        a.draw(pass, *field);
        b.draw(pass, *field);
      },
      true);
  CHECK(captured.triangles() == first.triangles() + second.triangles());
}

TEST_CASE("replay: the captured triangles give the same picture and depth, bit for bit") {
  const auto field = resources(flat_frame());
  const Captured source = sheet(200);
  render::StaticMesh mesh(source.vertices);
  const Camera camera = make_camera(north(300));
  for (const Show show : {Show::kShade, Show::kNormal, Show::kLevel, Show::kClass}) {
    const Picture drawn = render::draw_picture(camera, show, drawing(mesh, *field));
    const Captured captured = render::capture(camera, drawing(mesh, *field), true);
    CHECK(same(drawn, render::replay(captured, camera, *field, show)));
    if (show != Show::kClass) CHECK(drawn.depth == render::replay_depth(captured, camera, *field).depth);
    CHECK(std::count_if(drawn.depth.begin(), drawn.depth.end(), [](float d) { return std::isfinite(d); }) >
          10000);
  }
}

TEST_CASE("static mesh: indexed vertices draw the same surface") {
  const auto field = resources(flat_frame());
  const Captured source = sheet(40);
  std::vector<uint32_t> indices, first_use;
  for (uint32_t i = 0; i < source.vertices.size(); ++i) {
    if (i % 6 == 3) {  // the second triangle of a cell starts at the first one's corner
      indices.push_back(indices[indices.size() - 3]);
    } else {
      indices.push_back(static_cast<uint32_t>(first_use.size()));
      first_use.push_back(i);
    }
  }
  const auto mesh = render::make_static_mesh(source, indices, first_use);
  const Camera camera = make_camera(north(200));
  const Picture indexed = render::draw_picture(camera, Show::kShade, drawing(*mesh, *field));
  CHECK(indexed.depth == render::replay(source, camera, *field, Show::kShade).depth);
  const render::Timing timing = render::time_static(camera, Show::kNone, *mesh, *field);
  CHECK(timing.submitted.triangles == source.triangles());
  CHECK(timing.submitted.draw_calls == 1);
  CHECK(timing.total_ms > 0.0);
  CHECK(timing.gpu_clock == (gl::ensure_context().software ? "wall" : "query"));
  indices[0] = static_cast<uint32_t>(first_use.size());
  CHECK_THROWS_AS(render::make_static_mesh(source, indices, first_use), InvalidInput);
}

TEST_CASE(
    "a method's own passes: neutral before and after, told when all is done, neither captured nor counted") {
  const auto field = resources(flat_frame());
  render::StaticMesh mesh(sheet(40).vertices);
  const Camera camera = make_camera(north(120));
  int prepared = 0;
  bool neutral = true;
  const auto draw = [&](render::Pass& pass) { mesh.draw(pass, *field); };
  const render::DrawCall plain = draw;
  const auto prepare = [&](render::Work& work) {
    ++prepared;
    GLint mode[2] = {GL_FILL, GL_FILL}, query = 0;
    glGetIntegerv(GL_POLYGON_MODE, mode);
    glGetQueryiv(GL_PRIMITIVES_GENERATED, GL_CURRENT_QUERY, &query);
    GLboolean feedback = GL_FALSE;
    glGetBooleanv(GL_TRANSFORM_FEEDBACK_ACTIVE, &feedback);
    neutral &= mode[0] == GL_FILL && query == 0 && feedback == GL_FALSE &&
               !glIsEnabled(GL_RASTERIZER_DISCARD) && !glIsEnabled(GL_POLYGON_OFFSET_FILL) &&
               !glIsEnabled(GL_CULL_FACE) && glIsEnabled(GL_DEPTH_TEST);
    // Triangles of its own, in a framebuffer of its own, counted by a query of its own.
    const auto own = std::make_shared<gl::Framebuffer>(16, 16);
    const auto generated = std::make_shared<gl::Query>(GL_PRIMITIVES_GENERATED);
    own->bind();
    render::DrawPass pass(work.camera(), render::shader_show(Show::kLevel), work.everything());
    generated->begin();
    draw(pass);
    generated->end();
    work.when_done([own, generated](render::Submitted& told) {
      told.processed += static_cast<int64_t>(generated->result());
    });
    for (const GLenum on : {GL_CULL_FACE, GL_BLEND, GL_SCISSOR_TEST, GL_RASTERIZER_DISCARD, GL_STENCIL_TEST})
      glEnable(on);
    glDisable(GL_DEPTH_TEST);
    glScissor(0, 0, 1, 1);
    glColorMask(GL_FALSE, GL_TRUE, GL_FALSE, GL_TRUE);
    glDepthMask(GL_FALSE);
    glDepthRange(0.5, 0.6);
    glFrontFace(GL_CW);
    glPolygonMode(GL_FRONT_AND_BACK, GL_LINE);
  };
  const render::DrawCall call{prepare, draw};
  for (const Show show : {Show::kShade, Show::kClass}) {
    const Picture expected = render::draw_picture(camera, show, plain);
    const Picture drawn = render::draw_picture(camera, show, call);
    CHECK(same(drawn, expected));
    CHECK(drawn.triangles == expected.triangles);
  }
  CHECK(prepared == 2);
  CHECK(same(render::draw_wire(camera, call), render::draw_wire(camera, plain)));
  CHECK(prepared == 3);
  CHECK(render::capture(camera, call, true).triangles() == 3200);
  CHECK(prepared == 4);
  CHECK(render::time_draw(camera, Show::kShade, plain).submitted.processed == 0);
  for (const Show show : {Show::kShade, Show::kNone}) {
    const render::Timing timing = render::time_draw(camera, show, call);
    CHECK(timing.submitted.triangles == 3200);
    CHECK(timing.submitted.processed == 3200);
  }
  CHECK(neutral);
  CHECK(same(render::draw_picture(camera, Show::kShade, plain),
             render::draw_picture(camera, Show::kShade, call)));
}

TEST_CASE("coverage: void cells are discarded, whatever triangle covers them") {
  FieldFrame frame = flat_frame();  // 8 x 8 cells; the eye is at (col, row) = (0, 0)
  Bytes coverage(8, std::byte{0xff});
  coverage[2] = std::byte{0xf7};  // row 2: column 3 is void
  const auto field = resources(frame, coverage);
  CHECK_THROWS_AS(resources(frame, Bytes(7)), InvalidInput);
  View view = north(80);
  view.eye = {0, 0, 4};
  view.target = {0, 0, 0};
  view.up = {0, 1, 0};
  view.fov = 2.0 * std::atan(4.0 / 4.0) * 180.0 / 3.14159265358979;  // sees -4 to 4
  Captured captured;
  const auto at = [](float x, float y) { return CapturedVertex{x, y, -4.0f, x, -y, 0, 0}; };
  captured.vertices = {at(0, 0), at(0, -8), at(8, -8), at(0, 0), at(8, -8), at(8, 0)};
  const Picture picture = render::replay(captured, make_camera(view), *field, Show::kShade);
  const auto empty = [&](int x, int y) { return std::isinf(picture.depth[static_cast<size_t>(80 * y + x)]); };
  CHECK(empty(40 + 35, 40 + 25));  // 10 pixels a cell: column 3, row 2
  CHECK_FALSE(empty(40 + 35, 40 + 15));
  CHECK_FALSE(empty(40 + 25, 40 + 25));
  CHECK(empty(20, 20));  // no surface there
  int holes = 0;
  for (int y = 40; y < 80; ++y) {
    for (int x = 40; x < 80; ++x) holes += empty(x, y);
  }
  CHECK(holes == doctest::Approx(100).epsilon(0.2));  // one cell, give or take its rim
  CHECK(picture.depth == render::replay_depth(captured, make_camera(view), *field).depth);
  // The picture of the crack test has its voids filled: no void is a crack.
  const Picture classes = render::replay(captured, make_camera(view), *field, Show::kClass);
  CHECK(red(classes, 40 + 35, 40 + 25) == 255);
  CHECK(red(classes, 20, 20) == 0);
}

TEST_CASE("views at the limits draw without an error") {
  const auto field = resources(flat_frame());
  const Captured source = sheet(20);
  View view = north(1);
  CHECK(render::replay(source, make_camera(view), *field, Show::kShade).depth.size() == 1);
  for (const double fov : {1.0, 170.0}) {
    view = north(64);
    view.fov = fov;
    CHECK_NOTHROW(render::replay(source, make_camera(view), *field, Show::kShade));
  }
  view.width = gl::ensure_context().max_width;
  view.height = 1;
  CHECK_NOTHROW(render::replay(source, make_camera(view), *field, Show::kShade));
  Camera wide = make_camera(view);
  wide.width = gl::ensure_context().max_width + 1;
  CHECK_THROWS_AS(render::replay(source, wide, *field, Show::kShade), InvalidInput);
  CHECK(render::replay(Captured{}, make_camera(north(8)), *field, Show::kShade).depth[0] ==
        std::numeric_limits<float>::infinity());
  gl::check("the limits test");
}

TEST_CASE("wire: lines over a pale surface") {
  const auto field = resources(flat_frame());
  Captured captured;
  add_wall(captured, 10.0, 6.0);
  render::StaticMesh mesh(captured.vertices);
  const Picture picture = render::draw_wire(make_camera(north(100)), drawing(mesh, *field));
  int dark = 0, pale = 0;
  for (int y = 22; y < 78; ++y) {
    dark += red(picture, 99 - y, y) < 60 || red(picture, 98 - y, y) < 60 || red(picture, 100 - y, y) < 60;
    pale += red(picture, 30, y) > 100;
  }
  CHECK(dark > 50);  // the diagonal
  CHECK(pale > 35);
}
