// SPDX-License-Identifier: MIT
// multigrain as the GPU draws it: random cuts of odd-sized fields and of planets close bit for bit, cover
// every sample, face outwards and keep their bounds; the finest cut is `full`'s picture; cuts by hand and
// audit cuts.
#include <doctest/doctest.h>

#include <algorithm>
#include <random>
#include <set>

#include "base/errors.h"
#include "instrument/drawn_surface.h"
#include "instrument/field_ruler.h"
#include "instrument/orientation.h"
#include "instrument/sample_error.h"
#include "instrument/slack.h"
#include "methods/multigrain/hierarchy.h"
#include "render/frame.h"
#include "store_fixture.h"
#include "synthetic.h"

using namespace lodlab;
using multigrain::Forest;
using multigrain::Node;

namespace lodlab {
const Method& full_method();
const Method& multigrain_method();
}  // namespace lodlab

namespace {

using OptionValues = std::map<std::string, OptionValue>;
using Field = std::shared_ptr<const HeightField>;
using Random = std::mt19937;

int64_t between(Random& random, int64_t low, int64_t high) {
  return std::uniform_int_distribution<int64_t>(low, high)(random);
}

double rough(int64_t row, int64_t col) {
  Random random(static_cast<unsigned>(row * 104729 + col * 1299709));
  const double r = static_cast<double>(row), c = static_cast<double>(col);
  return 20.0 + 15.0 * std::sin(0.11 * r) * std::cos(0.07 * c) +
         3.0 * static_cast<double>(random() % 1000) / 1000.0;
}

struct Opened {
  Field field;
  std::shared_ptr<const Hierarchy> hierarchy;
  std::unique_ptr<Session> session;

  Opened(const Method& method, const Field& source, const OptionValues& options) : field(source) {
    const testing::TemporaryFolder folder;
    hierarchy = method.open(build_store(*field, method, options, folder / "a.lod", BuildMode::kNew, {}));
    session =
        hierarchy->session(resolve_options(method.info().name, method.info().options, Stage::kDraw, {}));
  }
  const Forest& forest() const { return dynamic_cast<const Forest&>(*hierarchy); }
};

View over(const HeightField& field) {
  View view;
  view.width = 320;
  view.height = 200;
  if (field.planet) {
    view.eye = {2.0 * field.radius, 0.3 * field.radius, 0.7 * field.radius};
    view.target = glm::dvec3(0.0);
    return view;
  }
  const double wide = static_cast<double>(field.cols) * field.dx,
               high = static_cast<double>(field.rows) * field.dy;
  view.eye = {field.x0 - 0.3 * wide, field.y0 - 1.3 * high, 0.5 * std::max(wide, high) + 50.0};
  view.target = {field.x0 + 0.5 * wide, field.y0 - 0.5 * high, 0.0};
  return view;
}

/// Any nodes at any of their resolutions; `wild`: only the least and the finest.
Cut random_cut(const Opened& opened, Random& random) {
  const Forest& forest = opened.forest();
  const int64_t split = between(random, 20, 90);
  const bool wild = between(random, 0, 2) > 0;
  std::vector<uint8_t> parts(forest.node.size(), 0);
  std::vector<int64_t> ids;
  std::vector<int32_t> resolutions;
  for (size_t i = 0; i < parts.size(); ++i) {
    const Node& n = forest.node[i];
    if (n.parent >= 0 && parts[static_cast<size_t>(n.parent)] == 0) continue;
    parts[i] = n.children > 0 && between(random, 0, 99) < split;
    if (parts[i] != 0) continue;
    ids.push_back(static_cast<int64_t>(i));
    const auto any = static_cast<int32_t>(between(random, n.least, n.most));
    resolutions.push_back(!wild ? any : between(random, 0, 1) > 0 ? n.least : n.most);
  }
  return opened.session->cut(ids, resolutions);
}

void check_drawn(const Opened& opened, const Cut& cut) {
  const Camera camera = make_camera(over(*opened.field));
  render::Submitted submitted;
  const auto draw = [&](render::Pass& pass) {
    opened.session->draw(cut, pass);
    submitted = pass.submitted;
  };
  const render::Captured captured = render::capture(camera, draw, true);
  CHECK(captured.triangles() == cut.claim->triangles);
  CHECK(submitted.triangles == cut.claim->triangles);
  CHECK(submitted.nodes == static_cast<int64_t>(cut.claim->nodes.size()));
  CHECK(submitted.draw_calls == 1);
  const instrument::SampleGrid grid(*opened.field);
  CHECK(instrument::crack_edges(grid, captured) == 0);
  CHECK(instrument::orientation(grid, captured).inverted == 0);
  std::vector<float> worst;
  const instrument::DrawnSurface surface(*opened.field, grid, captured, &worst);
  CHECK(instrument::sample_error(*opened.field, surface).holes == 0);
  double far = 0.0;
  for (const auto& v : captured.vertices) far = std::max(far, glm::length(glm::dvec3(v.x, v.y, v.z)));
  for (const instrument::NodeError& error : instrument::worst_of_nodes(captured, worst)) {
    const auto node = std::lower_bound(cut.claim->nodes.begin(), cut.claim->nodes.end(), error.node,
                                       [](const CutNode& n, uint32_t id) { return n.node < id; });
    REQUIRE(node->node == error.node);
    CHECK(error.max <= node->error + instrument::world_slack(far));
  }
}

OptionValues options_of(int chart, int levels) {
  return {{"chart", int64_t{1} << chart}, {"levels", int64_t{levels}}};
}

std::string refusal(const std::function<void()>& call) {
  try {
    call();
  } catch (const InvalidInput& error) {
    return error.what();
  }
  return "";
}

}  // namespace

TEST_CASE("random cuts of fields of any size close, cover and keep their bounds") {
  Random random(1);
  for (int i = 0; i < 40; ++i) {
    const int chart = static_cast<int>(between(random, 1, 6)),
              levels = static_cast<int>(between(random, 1, chart));
    const auto frame =
        synthetic::flat(between(random, 2, 140), between(random, 2, 140), 30.0, 1000.0, -500.0);
    INFO(frame.rows, " x ", frame.cols, ", chart ", chart, ", levels ", levels);
    const Opened opened(multigrain_method(), synthetic::field(frame, rough), options_of(chart, levels));
    for (int c = 0; c < 6; ++c) check_drawn(opened, random_cut(opened, random));
  }
}

TEST_CASE("random cuts of planets do, round the seam, at both poles and without poles") {
  Random random(2);
  for (int i = 0; i < 24; ++i) {
    auto frame = synthetic::planet(between(random, 40, 140), between(random, 60, 200));
    if (i % 3 == 2) {
      frame.lat0 = 70.0;
      frame.dlat = 130.0 / static_cast<double>(frame.rows - 1);
    }
    const int levels = static_cast<int>(between(random, 1, 4));
    INFO(frame.rows, " x ", frame.cols, ", levels ", levels);
    const Opened opened(multigrain_method(), synthetic::field(frame, rough), {{"levels", int64_t{levels}}});
    for (int c = 0; c < 6; ++c) check_drawn(opened, random_cut(opened, random));
  }
}

/// Two coarse neighbours pulled both edges of a narrow node onto the pole: the grid between them stood on
/// end.
TEST_CASE("no vertex of an edge moves onto a pole") {
  Random random(3);
  const Opened opened(multigrain_method(), synthetic::field(synthetic::planet(113, 130), rough),
                      options_of(4, 3));
  for (int c = 0; c < 60; ++c) check_drawn(opened, random_cut(opened, random));
}

/// All nodes of the last level at their finest.
Cut finest(const Opened& opened) {
  std::vector<int64_t> ids;
  const std::vector<NodeInfo> nodes = opened.hierarchy->nodes();
  for (const NodeInfo& n : nodes) {
    if (n.level == nodes.back().level && (ids.empty() || ids.back() != n.id)) ids.push_back(n.id);
  }
  return opened.session->cut(ids, {});
}

TEST_CASE("the finest cut is full's picture, with its depth and its holes") {
  for (const bool planet : {false, true}) {
    const FieldFrame frame = planet ? synthetic::planet(61, 120) : synthetic::flat(75, 98, 30.0);
    std::vector<uint8_t> valid(static_cast<size_t>(frame.rows * frame.cols), 1);
    for (size_t i = 0; i < valid.size(); i += 37) valid[i] = 0;
    for (const bool holes : {false, true}) {
      const Field field = synthetic::field(frame, rough, holes ? valid : std::vector<uint8_t>{});
      const auto picture = [&](const Method& method) {
        const Opened opened(method, field, {});
        const Cut cut = finest(opened);
        return render::draw_picture(make_camera(over(*field)), render::Show::kShade,
                                    [&](render::Pass& pass) { opened.session->draw(cut, pass); });
      };
      const render::Picture drawn = picture(multigrain_method()), reference = picture(full_method());
      if (!planet) {
        CHECK(drawn.depth == reference.depth);
        CHECK(drawn.rgba == reference.rgba);
        continue;
      }
      // A lattice beside doubles: rounded apart, a vertex may fall on the other side of a pixel's centre.
      int64_t apart = 0;
      for (size_t i = 0; i < drawn.depth.size(); ++i) {
        int difference = std::abs(drawn.depth[i] - reference.depth[i]) > 1e-5f * reference.depth[i] ? 255 : 0;
        for (size_t k = 4 * i; k < 4 * i + 4; ++k)
          difference = std::max(difference, std::abs(int{drawn.rgba[k]} - int{reference.rgba[k]}));
        apart += difference > 2 ? 1 : 0;
      }
      CHECK(apart <= 10);
    }
  }
}

TEST_CASE("a capture of millions of triangles comes in batches, a picture in one call") {
  const auto flat = [](int64_t, int64_t) { return 1.0; };
  const Opened opened(multigrain_method(), synthetic::field(synthetic::flat(1101, 1101), flat), {});
  const Cut cut = finest(opened);
  CHECK(cut.claim->triangles == 2 * 1100 * 1100);
  render::Submitted submitted;
  const auto draw = [&](render::Pass& pass) {
    opened.session->draw(cut, pass);
    submitted = pass.submitted;
  };
  const Camera camera = make_camera(over(*opened.field));
  CHECK(render::capture(camera, draw, true).triangles() == cut.claim->triangles);
  CHECK(submitted.draw_calls == 2);
  CHECK(submitted.triangles == cut.claim->triangles);
  render::draw_picture(camera, render::Show::kShade, draw);
  CHECK(submitted.draw_calls == 1);
}

TEST_CASE("cuts by hand are refused with the reason") {
  const Opened opened(multigrain_method(), synthetic::field(synthetic::flat(65, 65), rough),
                      options_of(5, 3));
  const Session& session = *opened.session;
  const auto says = [&](const std::vector<int64_t>& ids, const std::vector<int32_t>& resolutions) {
    return refusal([&] { session.cut(ids, resolutions); });
  };
  CHECK(session.cut({3, 0, 1, 2}, {}).claim->nodes.size() == 4);
  CHECK(testing::says(says({0, 1, 2}, {}), "gap"));
  CHECK(testing::says(says({0, 1, 2, 3, 3}, {}), "twice"));
  CHECK(testing::says(says({0, 1, 2, 3, 4}, {}), "overlaps"));
  CHECK(testing::says(says({0, 1, 2, 99999}, {}), "not within"));
  CHECK(testing::says(says({0, 1, 2, 3}, {2, 2, 2}), "3 resolutions for 4 nodes"));
  CHECK(testing::says(says({0, 1, 2, 3}, {2, 2, 2, 1}), "resolution 1 of node 3 is not within 2 to 5"));
}

TEST_CASE("audit cuts draw every node at every resolution, and hold their bounds") {
  const Opened opened(multigrain_method(), synthetic::field(synthetic::flat(100, 75), rough),
                      options_of(5, 3));
  const std::vector<Cut> cuts = opened.session->audit_cuts();
  CHECK(cuts.size() < 400);
  std::set<std::pair<int64_t, uint32_t>> drawn;
  for (const Cut& cut : cuts) {
    check_drawn(opened, cut);
    for (const CutNode& n : cut.claim->nodes) drawn.insert({n.node, n.resolution});
  }
  CHECK(drawn.size() == opened.forest().resolution.size());
}
