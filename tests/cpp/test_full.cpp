// SPDX-License-Identifier: MIT
// `full`: the drawn triangles are the source, bit for bit: flat, wide, round the planet and over its poles.
#include <doctest/doctest.h>
#include <unistd.h>

#include <array>
#include <bit>
#include <cmath>
#include <filesystem>
#include <map>
#include <set>

#include "base/errors.h"
#include "gl/error.h"
#include "method/method.h"
#include "render/frame.h"

using namespace lodlab;

namespace {

struct Built {
  std::shared_ptr<const std::filesystem::path> file;  ///< removed last: every thread that reads opens it
  std::shared_ptr<const HeightField> field;
  std::shared_ptr<const Hierarchy> hierarchy;
  std::unique_ptr<Session> session;
};

/// Heights without a pattern, from the sample's place alone.
float bump(int64_t row, int64_t col) {
  return static_cast<float>(std::sin(1.7 * static_cast<double>(row)) *
                            std::cos(2.3 * static_cast<double>(col)) * 40.0);
}

Built build(FieldFrame frame) {
  auto heights = std::make_shared<std::vector<float>>();
  for (int64_t row = 0; row < frame.rows; ++row) {
    const bool pole = frame.planet && std::abs(frame.latitude(row)) == 90.0;
    for (int64_t col = 0; col < frame.cols; ++col) heights->push_back(pole ? 5.0f : bump(row, col));
  }
  Built built;
  built.field = make_height_field(frame, heights->data(), nullptr, heights, "");
  const auto path =
      std::filesystem::temp_directory_path() / ("lodlab_test_full_" + std::to_string(getpid()) + ".lod");
  built.file = {new std::filesystem::path(path), [](const std::filesystem::path* file) {
                  std::filesystem::remove(*file);
                  delete file;
                }};
  const Method& full = find_method("full");
  const auto store = build_store(*built.field, full, {}, path.string(), BuildMode::kForce, {});
  built.hierarchy = full.open(store);
  built.session = built.hierarchy->session(resolve_options("full", full.info().options, Stage::kDraw, {}));
  return built;
}

render::Captured capture(Built& built, const View& view) {
  const Cut cut = built.session->select({view, {}, nullptr});
  CHECK(cut.claim->budget_met);
  CHECK(cut.claim->predicted_px == 0.0);
  const auto captured = render::capture(
      make_camera(view), [&](render::Pass& pass) { built.session->draw(cut, pass); }, true);
  CHECK(captured.triangles() == cut.claim->triangles);
  gl::check("capturing full");
  return captured;
}

using Key = std::array<uint32_t, 3>;

Key key_of(const render::CapturedVertex& v) {
  return {std::bit_cast<uint32_t>(v.x), std::bit_cast<uint32_t>(v.y), std::bit_cast<uint32_t>(v.z)};
}

/// Directed edges without their opposite.
int64_t open_edges(const render::Captured& captured) {
  std::map<std::pair<Key, Key>, int> edges;
  for (size_t t = 0; t < captured.vertices.size(); t += 3) {
    for (size_t i = 0; i < 3; ++i) {
      const Key a = key_of(captured.vertices[t + i]), b = key_of(captured.vertices[t + (i + 1) % 3]);
      CHECK(a != b);
      ++edges[{a, b}];
    }
  }
  int64_t open = 0;
  for (const auto& [edge, count] : edges) {
    CHECK(count == 1);
    open += !edges.contains({edge.second, edge.first});
  }
  return open;
}

/// Every captured vertex is the sample that its grid coordinates name, to four float steps at its distance.
void check_positions(const Built& built, const render::Captured& captured, glm::ivec2 eye_cell) {
  for (const render::CapturedVertex& v : captured.vertices) {
    const int64_t row = std::lround(v.row) + eye_cell.y, col = (std::lround(v.col) + eye_cell.x);
    const HeightField& field = *built.field;
    const glm::dvec3 exact = field.position(row, col, field.at(row, col % field.cols)) - captured.eye;
    const double slack = 4.0 * std::ldexp(glm::length(exact), -23);
    const double off = glm::length(exact - glm::dvec3(v.x, v.y, v.z));
    if (!(off <= slack)) FAIL("sample (" << row << ", " << col << ") is off by " << off);
  }
}

View above(glm::dvec3 eye, glm::dvec3 target) {
  View view;
  view.eye = eye;
  view.target = target;
  view.width = view.height = 64;
  return view;
}

FieldFrame globe(int64_t rows, int64_t cols) {
  FieldFrame frame;
  frame.rows = rows;
  frame.cols = cols;
  frame.planet = frame.wraps = true;
  frame.dlon = 360.0 / static_cast<double>(cols);
  frame.dlat = 180.0 / static_cast<double>(rows - 1);
  return frame;
}

}  // namespace

TEST_CASE("flat: every sample in its place, two triangles a cell, the 4-8 diagonals") {
  FieldFrame frame;
  frame.rows = 35;
  frame.cols = 38;  // more than two strips
  frame.dx = 30.5;
  frame.dy = 27.25;
  frame.x0 = 4e6;
  frame.y0 = -3e6;
  Built built = build(frame);
  const auto captured = capture(built, above({4e6 + 100.0, -3e6 - 2000.0, 500.0}, {4e6 + 100.0, -3e6, 0.0}));
  CHECK(captured.triangles() == 2 * 34 * 37);
  const glm::ivec2 eye_cell(static_cast<int>(std::floor(100.0 / 30.5)),
                            static_cast<int>(std::floor(2000.0 / 27.25)));
  check_positions(built, captured, eye_cell);
  CHECK(open_edges(captured) == 2 * (34 + 37));
  for (size_t t = 0; t < captured.vertices.size(); t += 3) {
    const render::CapturedVertex *a = &captured.vertices[t], *b = a + 1, *c = a + 2;
    CHECK((b->x - a->x) * (c->y - a->y) - (b->y - a->y) * (c->x - a->x) >
          0.0f);  // counter-clockwise from above
    for (const auto& [p, q] : {std::pair{a, b}, {b, c}, {c, a}}) {
      const long dc = std::lround(q->col - p->col), dr = std::lround(q->row - p->row);
      if (dc == 0 || dr == 0) continue;
      const long col = std::lround(std::min(p->col, q->col)) + eye_cell.x;
      const long row = std::lround(std::min(p->row, q->row)) + eye_cell.y;
      CHECK((dc == dr) == ((row + col) % 2 == 0));
    }
  }
}

TEST_CASE("flat: smallest, and wider than 16 bits") {
  FieldFrame frame;
  for (const auto& [rows, cols] : {std::pair{2, 2}, {2, 17}, {2, 18}, {33, 2}, {2, 70000}}) {
    frame.rows = rows;
    frame.cols = cols;
    Built built = build(frame);
    const auto captured = capture(built, above({-0.5, 0.5, 9.0}, {10.0, 0.0, 0.0}));
    CHECK(captured.triangles() == 2 * (rows - 1) * (cols - 1));
    check_positions(built, captured, {-1, -1});
  }
}

TEST_CASE("planet: closed round the seam and over the poles, without a triangle of no area") {
  Built built = build(globe(19, 37));
  CHECK(built.hierarchy->vertices() == 17 * 37 + 2);
  // The eye is at longitude 0, latitude 0: cell (0, 9).
  const auto captured = capture(built, above({2e7, 0.0, 0.0}, {0.0, 0.0, 0.0}));
  CHECK(captured.triangles() == 37 * (2 * 18 - 2));
  CHECK(open_edges(captured) == 0);
  check_positions(built, captured, {0, 9});
  std::set<Key> poles;
  for (const auto& v : captured.vertices) {
    if (std::lround(v.row) + 9 == 0) poles.insert(key_of(v));
  }
  CHECK(poles.size() == 1);
}

TEST_CASE("planet: a part of one has borders") {
  FieldFrame frame = globe(19, 37);
  frame.wraps = false;
  frame.rows = 5;
  frame.cols = 6;
  frame.lat0 = 40.0;
  Built built = build(frame);
  const auto captured = capture(built, above({2e7, 0.0, 0.0}, {0.0, 0.0, 0.0}));
  CHECK(captured.triangles() == 2 * 4 * 5);
  CHECK(open_edges(captured) == 2 * (4 + 5));
}

TEST_CASE("cuts by hand: node 0, once") {
  Built built = build([] {
    FieldFrame frame;
    frame.rows = frame.cols = 3;
    return frame;
  }());
  CHECK(built.session->cut({0}, {}).claim->triangles == 8);
  for (const std::vector<int64_t>& wrong : {std::vector<int64_t>{}, {1}, {0, 0}, {-1}}) {
    CHECK_THROWS_AS(built.session->cut(wrong, {}), InvalidInput);
  }
  CHECK_THROWS_AS(built.session->cut({0}, {1}), InvalidInput);
  CHECK(built.hierarchy->nodes().size() == 1);
  CHECK(built.hierarchy->nodes()[0].error == 0.0);
}
