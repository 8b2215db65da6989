// SPDX-License-Identifier: MIT
// seamless while it loads: windows of families round the eye, of which an L enters when the eye moves;
// budgets of memory and of uploads that hold; cuts of what is there, without a crack.
#include <doctest/doctest.h>

#include <set>

#include "base/errors.h"
#include "instrument/field_ruler.h"
#include "instrument/sample_grid.h"
#include "methods/seamless/paging.h"
#include "render/frame.h"
#include "seamless_stores.h"

using namespace lodlab;
using namespace lodlab::seamless;

namespace {

/// Streaming, unless they say otherwise.
Options draw_options(OptionValues given) {
  const MethodInfo& info = seamless_method().info();
  given.emplace("stream", true);
  return resolve_options(info.name, info.options, Stage::kDraw, given);
}

/// Its file stays, for threads that read it.
struct OnDisk {
  testing::TemporaryFolder folder;
  std::shared_ptr<const seamless::Hierarchy> hierarchy;

  OnDisk(const Field& field, const OptionValues& options)
      : hierarchy(std::dynamic_pointer_cast<const seamless::Hierarchy>(seamless_method().open(
            build_store(*field, seamless_method(), options, folder / "a.lod", BuildMode::kNew, {})))) {}
};

struct Pager {
  OnDisk opened;
  PatchMesh mesh;
  Paging paging;

  Pager(const Field& field, const OptionValues& build, const OptionValues& draw)
      : opened(field, build),
        mesh(opened.hierarchy->layout.patch_log2, opened.hierarchy->layout.resolutions),
        paging(opened.hierarchy, mesh, draw_options(draw)) {
    paging.admit(0, true, 0.0);
  }
  const Layout& layout() const { return opened.hierarchy->layout; }
  /// Above a place of the field, in patches of the last level.
  glm::dvec3 above(double x, double y) const {
    const double side = std::ldexp(10.0, layout().side_log2(layout().levels - 1));
    return {x * side, -y * side, 1000.0};
  }
  /// What is asked for when the eye is there.
  std::vector<int64_t> asked(const glm::dvec3& eye) {
    paging.next_frame();
    paging.follow(eye, layout().levels - 1);
    paging.ask();
    std::vector<int64_t> out;
    for (const Residency::Want& want : paging.wanted()) out.push_back(want.unit);
    return out;
  }
  void load(const glm::dvec3& eye) {
    for (int frame = 0; frame < 40 && !asked(eye).empty(); ++frame) {
      paging.settle();
      for (const Residency::Want& want : paging.wanted()) {
        if (!paging.resident(paging.parent(want.unit))) continue;
        paging.touch(want.unit, want.priority);
        paging.admit(want.unit, false, want.priority);
      }
    }
  }
  int64_t resident() const {
    int64_t count = 0;
    for (int64_t id = 0; id < layout().patches(); ++id) {
      if (!paging.resident(id)) continue;
      ++count;
      CHECK((id == 0 || paging.resident(paging.parent(id))));
    }
    return count;
  }
};

View looking(const glm::dvec3& eye) {
  View view;
  view.width = 160;
  view.height = 100;
  view.eye = eye;
  view.target = eye + glm::dvec3(300.0, 500.0, -400.0);
  return view;
}

}  // namespace

TEST_CASE("windows fill, and a move brings in an L of families") {
  for (const int64_t resolutions : {2, 3}) {
    Pager pager(flat(513, 513, 1), shape(8, resolutions), {{"gpu_cache_mb", int64_t{1}}});
    Paging& paging = pager.paging;
    const Layout& layout = pager.layout();
    const int last = layout.levels - 1;
    const int64_t slots = paging.capacity() / paging.slots().bytes(), width = paging.window();
    const int64_t step = int64_t{1} << layout.branch_log2();
    INFO(slots, " slots, windows of ", width);
    CHECK(width < layout.across(last));
    CHECK(width >= 2 * step);
    pager.load(pager.above(32.0, 32.0));
    CHECK(pager.resident() <= slots);

    const auto of_last_level = [&](const std::vector<int64_t>& ids) {
      std::set<int64_t> out;
      for (const int64_t id : ids) {
        CHECK(!paging.resident(id));
        if (id >= layout.first(last)) out.insert(id);
      }
      return static_cast<int64_t>(out.size());
    };
    const auto move = static_cast<double>(step);
    CHECK(pager.asked(pager.above(32.0, 32.0)).empty());
    CHECK(of_last_level(pager.asked(pager.above(32.0 + move, 32.0))) == step * width);
    CHECK(of_last_level(pager.asked(pager.above(32.0, 32.0 - move))) == step * width);
    const glm::dvec3 diagonal = pager.above(32.0 + move, 32.0 + move);
    CHECK(of_last_level(pager.asked(diagonal)) == 2 * step * width - step * step);
    pager.load(diagonal);
    CHECK(pager.asked(diagonal).empty());
    CHECK(pager.resident() <= slots);
  }
}

TEST_CASE("wherever the eye is, the parents of what is in a window are in one") {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> place(-10.0, 75.0);
  for (const int64_t resolutions : {2, 3}) {
    Pager pager(flat(513, 380, 1), shape(8, resolutions), {{"gpu_cache_mb", int64_t{1}}});
    for (int i = 0; i < 50; ++i) {
      const std::vector<int64_t> list = pager.asked(pager.above(place(random), place(random)));
      const std::set<int64_t> ids(list.begin(), list.end());
      for (const int64_t id : ids) {
        const int64_t parent = pager.paging.parent(id);
        CHECK((parent == 0 || ids.contains(parent)));
      }
    }
  }
}

TEST_CASE("a flight keeps its budgets, and what it draws has no cracks") {
  const Field field = flat(513, 513, 1);
  const instrument::SampleGrid grid(*field);
  for (const int64_t resolutions : {2, 3}) {
    const OnDisk opened(field, shape(8, resolutions));
    constexpr int64_t kUpload = 64 << 10;
    const auto session =
        opened.hierarchy->session(draw_options({{"gpu_cache_mb", int64_t{1}}, {"upload_bytes", kUpload}}));
    const auto whole = opened.hierarchy->session(draw_options({{"stream", false}}));
    int64_t missing = 0;
    double first = 0.0, settled = 0.0;
    for (int frame = 0; frame < 40; ++frame) {
      const double at = std::min(frame, 20) * 80.0;  // then it stands still
      const View view = looking({1000.0 + at, -3500.0 + at, 1000.0});
      Budget budget;
      budget.pixel_error = 2.0;
      const Cut cut = session->select({view, budget, nullptr});
      render::Submitted submitted;
      render::draw_picture(make_camera(view), render::Show::kShade, [&](render::Pass& pass) {
        session->draw(cut, pass);
        submitted = pass.submitted;
      });
      CHECK(submitted.triangles == cut.claim->triangles);
      CHECK(session->resident_bytes() <= 1 << 20);
      const int64_t beside = 1 << 19;  // index ranges, instances and commands
      CHECK(submitted.upload_bytes <= kUpload + beside);
      const auto draw = [&](render::Pass& pass) { whole->draw(cut, pass); };
      if (frame % 5 == 0)
        CHECK(instrument::crack_edges(grid, render::capture(make_camera(view), draw, true)) == 0);
      session->settle();
      missing += cut.claim->missing_nodes;
      if (frame == 0) first = cut.claim->predicted_px;
      settled = cut.claim->predicted_px;
    }
    CHECK(missing > 0);
    CHECK(settled < 0.5 * first);
  }
}

TEST_CASE("a cut of more patches than memory holds is drawn in rounds") {
  const OnDisk opened(flat(513, 513, 1), shape(8, 2));
  const auto session =
      opened.hierarchy->session(draw_options({{"gpu_cache_mb", int64_t{1}}, {"stream", false}}));
  const Cut cut = session->audit_cuts().back();
  render::Submitted submitted;
  const auto draw = [&](render::Pass& pass) {
    session->draw(cut, pass);
    submitted = pass.submitted;
  };
  const Camera camera = make_camera(looking({2500.0, -2500.0, 1000.0}));
  CHECK(render::capture(camera, draw, true).triangles() == cut.claim->triangles);
  CHECK(submitted.draw_calls > 1);
  CHECK(session->resident_bytes() <= 1 << 20);
}

TEST_CASE("caches that are too small are refused with the least that will do") {
  const OnDisk opened(flat(300, 300, 1), shape(64, 3));
  const auto says = [&](const OptionValues& values) -> std::string {
    try {
      opened.hierarchy->session(draw_options(values));
    } catch (const InvalidInput& error) {
      return error.what();
    }
    return "";
  };
  CHECK(testing::says(says({{"gpu_cache_mb", int64_t{1}}}), "need gpu_cache_mb of at least"));
  CHECK(testing::says(says({{"upload_bytes", int64_t{2000}}}), "upload_bytes=2000 cannot move a patch of"));
  const std::string text = says({{"gpu_cache_mb", int64_t{1}}});
  const int64_t least = std::stoll(text.substr(text.find("at least ") + 9));
  CHECK(says({{"gpu_cache_mb", least}}).empty());
  CHECK(!says({{"gpu_cache_mb", least - 1}}).empty());
}
