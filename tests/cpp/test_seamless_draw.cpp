// SPDX-License-Identifier: MIT
// seamless as the GPU draws it: the captured triangles are those of the meshes with the heights of the store,
// bit for bit, none of them without an area; strips and tiles are told apart by what `parts` says.
#include <doctest/doctest.h>

#include <algorithm>
#include <cstring>
#include <random>

#include "instrument/field_ruler.h"
#include "instrument/orientation.h"
#include "instrument/sample_grid.h"
#include "methods/seamless/hierarchy.h"
#include "methods/seamless/slots.h"
#include "render/frame.h"
#include "store_fixture.h"
#include "synthetic.h"

using namespace lodlab;
using seamless::Layout;
using seamless::Patch;
using seamless::PatchMesh;
using seamless::Resolutions;
using seamless::Vertex;

namespace lodlab {
const Method& seamless_method();
}  // namespace lodlab

namespace {

using OptionValues = std::map<std::string, OptionValue>;
using Field = std::shared_ptr<const HeightField>;

double rough(int64_t row, int64_t col) {
  std::mt19937 random(static_cast<unsigned>(row * 104729 + col * 1299709));
  return static_cast<double>(random() % 100000) / 1000.0 - 50.0;
}

Field noise(int64_t rows, int64_t cols) { return synthetic::field(synthetic::flat(rows, cols), rough); }

struct Opened {
  Field field;
  std::shared_ptr<const lodlab::Hierarchy> hierarchy;
  std::unique_ptr<Session> session;

  Opened(const Field& source, const OptionValues& build, const OptionValues& draw = {}) : field(source) {
    const Method& method = seamless_method();
    const testing::TemporaryFolder folder;
    hierarchy = method.open(build_store(*field, method, build, folder / "a.lod", BuildMode::kNew, {}));
    session =
        hierarchy->session(resolve_options(method.info().name, method.info().options, Stage::kDraw, draw));
  }
  const seamless::Hierarchy& patches() const { return dynamic_cast<const seamless::Hierarchy&>(*hierarchy); }
};

OptionValues options_of(int patch, int resolutions, const char* pyramid = "vertex") {
  return {
      {"patch", int64_t{patch}}, {"resolutions", int64_t{resolutions}}, {"pyramid", std::string(pyramid)}};
}

/// From a sample at height 0: positions relative to the eye are samples and heights, unrounded.
Camera above(const HeightField& field) {
  View view;
  view.width = 64;
  view.height = 40;
  view.eye = {static_cast<double>(field.cols / 2), -static_cast<double>(field.rows / 2), 0.0};
  view.target = view.eye + glm::dvec3(1.0, 0.0, 0.0);
  return make_camera(view);
}

struct Corner {
  int64_t row, col;
  uint32_t height;  ///< its bits
  auto operator<=>(const Corner&) const = default;
};
struct Drawn {
  std::array<Corner, 3> corners;  ///< from the least on
  uint32_t node, level;
  auto operator<=>(const Drawn&) const = default;
};

uint32_t bits_of(float value) {
  uint32_t bits;
  std::memcpy(&bits, &value, sizeof bits);
  return bits;
}

Drawn make(std::array<Corner, 3> corners, uint32_t node, uint32_t level) {
  std::rotate(corners.begin(), std::min_element(corners.begin(), corners.end()), corners.end());
  return {corners, node, level};
}

/// What a store's pages and the meshes say of a cut; `level` of each piece as `parts` has it.
std::vector<Drawn> expected(const Opened& opened, const Cut& cut, bool parts) {
  const seamless::Hierarchy& hierarchy = opened.patches();
  const Layout& layout = hierarchy.layout;
  const PatchMesh mesh(layout.patch_log2, layout.resolutions);
  const int side = layout.segments();
  std::vector<Drawn> out;
  for (const CutNode& picked : cut.claim->nodes) {
    const Patch p = layout.at(picked.node);
    const std::vector<float> page = hierarchy.heights(picked.node);
    const auto corner = [&](const Vertex& v) {
      int first = 0, length = side + 1, shift = 0;
      for (int k = layout.resolutions - 1; hierarchy.averaged() && k > v.resolution; --k, ++shift) {
        first += length * length;
        length = length / 2 + 1;
      }
      const float height = page[static_cast<size_t>(first + (v.v >> shift) * length + (v.u >> shift))];
      return Corner{layout.sample_row(p, v.v), layout.sample_col(p, v.u), bits_of(height)};
    };
    const auto pieces =
        mesh.pieces_of(seamless::unpack(static_cast<int>(picked.resolution), layout.resolutions));
    for (size_t i = 0; i < pieces.size(); ++i) {
      const auto level = parts ? (i < 4 ? 3u : 5u) : static_cast<uint32_t>(p.level);
      for (const seamless::Triangle& t : mesh.piece(pieces[i])) {
        if (seamless::remains(t, layout.clip_x(p), layout.clip_y(p)))
          out.push_back(make({corner(t[0]), corner(t[1]), corner(t[2])}, picked.node, level));
      }
    }
  }
  std::sort(out.begin(), out.end());
  return out;
}

std::vector<Drawn> drawn(const Opened& opened, const render::Captured& captured) {
  const auto row = static_cast<float>(opened.field->rows / 2),
             col = static_cast<float>(opened.field->cols / 2);
  int64_t moved = 0, without_area = 0;
  const auto corner = [&](const render::CapturedVertex& v) {
    moved += v.x != v.col || v.y != -v.row;
    return Corner{static_cast<int64_t>(v.row + row), static_cast<int64_t>(v.col + col), bits_of(v.z)};
  };
  std::vector<Drawn> out;
  for (size_t i = 0; i < captured.vertices.size(); i += 3) {
    const render::CapturedVertex* v = &captured.vertices[i];
    out.push_back(make({corner(v[0]), corner(v[1]), corner(v[2])}, v[2].node, v[2].bits >> 1));
    const auto& c = out.back().corners;
    without_area +=
        (c[1].col - c[0].col) * (c[2].row - c[0].row) >= (c[2].col - c[0].col) * (c[1].row - c[0].row);
  }
  CHECK(moved == 0);
  CHECK(without_area == 0);
  std::sort(out.begin(), out.end());
  return out;
}

void check_drawn(const Opened& opened, const Cut& cut, bool parts = false) {
  render::Submitted submitted;
  const auto draw = [&](render::Pass& pass) {
    opened.session->draw(cut, pass);
    submitted = pass.submitted;
  };
  const render::Captured captured = render::capture(above(*opened.field), draw, true);
  const std::vector<Drawn> all = expected(opened, cut, parts);
  CHECK((drawn(opened, captured) == all));
  CHECK(submitted.triangles == static_cast<int64_t>(all.size()));
  CHECK(submitted.nodes == static_cast<int64_t>(cut.claim->nodes.size()));
  CHECK(submitted.draw_calls == 1);
  if (opened.patches().averaged()) return;  // cracks; test_seamless.py counts them
  const instrument::SampleGrid grid(*opened.field);
  CHECK(instrument::crack_edges(grid, captured) == 0);
  CHECK(instrument::orientation(grid, captured).inverted == 0);
}

}  // namespace

TEST_CASE("every four resolutions of every level are drawn as the meshes and the pages say") {
  for (const auto& [rows, cols] : {std::pair{33, 33}, {40, 23}, {17, 70}, {9, 9}, {2, 37}}) {
    for (const int resolutions : {2, 3}) {
      INFO(rows, " x ", cols, ", ", resolutions, " resolutions");
      const Opened opened(noise(rows, cols), options_of(8, resolutions));
      for (const Cut& cut : opened.session->audit_cuts()) check_drawn(opened, cut);
    }
  }
}

TEST_CASE("cuts of many levels are, with patches of more than one strip of heights") {
  for (const int resolutions : {2, 3}) {
    const Opened opened(noise(517, 390), options_of(64, resolutions));
    for (uint64_t seed = 0; seed < 12; ++seed) check_drawn(opened, *opened.session->random_cut(seed));
  }
}

TEST_CASE("with averages a vertex has the height of its own resolution") {
  for (const int resolutions : {2, 3}) {
    for (const int patch : {8, 32}) {
      const Opened opened(noise(100, 75), options_of(patch, resolutions, "average"));
      for (const Cut& cut : opened.session->audit_cuts()) check_drawn(opened, cut);
    }
  }
}

TEST_CASE("parts: the last vertex of a triangle says whether it is of a strip or of a tile") {
  for (const char* pyramid : {"vertex", "average"}) {
    const Opened opened(noise(70, 45), options_of(16, 3, pyramid), {{"parts", true}});
    for (const Cut& cut : opened.session->audit_cuts()) check_drawn(opened, cut, true);
  }
}

TEST_CASE("a capture of millions of triangles comes in batches, a picture in one call") {
  const auto flat = [](int64_t, int64_t) { return 1.0; };
  const Opened opened(synthetic::field(synthetic::flat(1101, 1101), flat), {});
  const Cut cut = opened.session->audit_cuts().back();  // the last level at its finest
  CHECK(cut.claim->triangles == 2 * 1100 * 1100);
  render::Submitted submitted;
  const auto draw = [&](render::Pass& pass) {
    opened.session->draw(cut, pass);
    submitted = pass.submitted;
  };
  const Camera camera = above(*opened.field);
  CHECK(render::capture(camera, draw, true).triangles() == cut.claim->triangles);
  CHECK(submitted.draw_calls == 2);
  CHECK(submitted.triangles == cut.claim->triangles);
  render::draw_picture(camera, render::Show::kShade, draw);
  CHECK(submitted.draw_calls == 1);
}
