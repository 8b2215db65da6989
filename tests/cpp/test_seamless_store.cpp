// SPDX-License-Identifier: MIT
// seamless: the patches of a store cover the field, and their pages hold its heights, whatever its size and
// whether it is in memory or read by rows.
#include <doctest/doctest.h>

#include "base/errors.h"
#include "base/parallel.h"
#include "geometry/coverage.h"
#include "seamless_stores.h"

using namespace lodlab;
using namespace lodlab::seamless;

namespace {

struct Case {
  std::string name;
  Field field;
  OptionValues options;
};

std::vector<Case> cases() {
  return {{"smallest", flat(2, 2, 1), {}},
          {"strip", flat(2, 145, 2), shape(8, 2)},
          {"high strip", flat(700, 3, 3), shape(8, 3)},
          {"one patch", flat(17, 17, 4), shape(16, 2)},
          {"less than a patch", flat(7, 12, 5), {}},
          {"odd", flat(137, 86, 6), shape(8, 2)},
          {"odd, three resolutions", flat(137, 300, 7), shape(8, 3)},
          {"several bands", flat(600, 330, 8), shape(16, 2)},
          {"several bands, three resolutions", flat(771, 64, 9), shape(64, 3)}};
}

/// The height that the vertex of a lattice has, from the definition: a sample, or the mean of what is there
/// of four of the next finer lattice.
double height(const HeightField& field, bool averaged, int stride_log2, int64_t row, int64_t col) {
  if (!averaged) return field.at(row, col);
  const auto mean = [&](const auto& self, int a, int64_t i, int64_t j) -> double {
    if (a == 0) return field.at(i, j);
    const int64_t rows = ((field.rows - 1) >> (a - 1)) + 1, cols = ((field.cols - 1) >> (a - 1)) + 1;
    double sum = 0.0;
    int count = 0;
    for (int64_t r = 2 * i; r < std::min(2 * i + 2, rows); ++r) {
      for (int64_t c = 2 * j; c < std::min(2 * j + 2, cols); ++c, ++count) sum += self(self, a - 1, r, c);
    }
    return sum / count;
  };
  return mean(mean, stride_log2, row >> stride_log2, col >> stride_log2);
}

void check_pages(const Opened& opened, bool averaged) {
  const seamless::Hierarchy& h = *opened.hierarchy;
  const Layout& layout = h.layout;
  REQUIRE(h.averaged() == averaged);
  for (int64_t id = 0; id < layout.patches(); ++id) {
    const Patch p = layout.at(id);
    REQUIRE(layout.id(p) == id);
    const std::vector<float> page = h.heights(id);
    size_t i = 0;
    for (int k = layout.resolutions - 1; k >= (averaged ? 0 : layout.resolutions - 1); --k) {
      const int step = 1 << (layout.resolutions - 1 - k), stride_log2 = layout.stride_log2(p.level, k);
      for (int v = 0; v <= layout.segments(); v += step) {
        for (int u = 0; u <= layout.segments(); u += step, ++i) {
          const double want =
              height(*opened.field, averaged, stride_log2, layout.sample_row(p, v), layout.sample_col(p, u));
          REQUIRE(static_cast<double>(page[i]) == doctest::Approx(want).epsilon(1e-6));
          if (!averaged) REQUIRE(static_cast<double>(page[i]) == want);
        }
      }
    }
    REQUIRE(i == page.size());
  }
}

}  // namespace

TEST_CASE("pages hold the heights of their lattices") {
  for (const Case& c : cases()) {
    for (const char* pyramid : {"vertex", "average"}) {
      CAPTURE(c.name);
      CAPTURE(pyramid);
      OptionValues options = c.options;
      options["pyramid"] = std::string(pyramid);
      check_pages(open(c.field, options), options["pyramid"] == OptionValue(std::string("average")));
    }
  }
}

TEST_CASE("patches cover the field once at every level, and lie in their parents") {
  for (const Case& c : cases()) {
    CAPTURE(c.name);
    const Opened opened = open(c.field, c.options);
    const Layout& layout = opened.hierarchy->layout;
    REQUIRE(layout.across(0) == 1);
    REQUIRE(layout.down(0) == 1);
    for (int level = 0; level < layout.levels; ++level) {
      int64_t cells = 0;
      for (int64_t id = layout.first(level); id < layout.first(level + 1); ++id) {
        const Patch p = layout.at(id);
        const int m = layout.segments();
        const int64_t rows = layout.sample_row(p, m) - layout.row(p);
        const int64_t cols = layout.sample_col(p, m) - layout.col(p);
        REQUIRE(rows > 0);
        REQUIRE(cols > 0);
        cells += rows * cols;
        if (level == 0) continue;
        const Box box = opened.hierarchy->box(p), above = opened.hierarchy->box(layout.parent(p));
        for (int i = 0; i < 3; ++i) {
          CHECK(box.lo[i] >= above.lo[i]);
          CHECK(box.hi[i] <= above.hi[i]);
        }
      }
      CHECK(cells == layout.last_row() * layout.last_col());
    }
    CHECK(opened.hierarchy->vertices() == c.field->rows * c.field->cols);
  }
}

TEST_CASE("equal samples give equal stores: by rows, with one thread or two") {
  for (const Case& c : cases()) {
    for (const char* pyramid : {"vertex", "average"}) {
      CAPTURE(c.name);
      OptionValues options = c.options;
      options["pyramid"] = std::string(pyramid);
      set_thread_count(1);
      const std::string one = open(c.field, options).content_hash;
      set_thread_count(2);
      CHECK(open(c.field, options).content_hash == one);
      CHECK(open(windowed(c.field), options).content_hash == one);
      CHECK(open(windowed(c.field, 1), options).content_hash == one);
      set_thread_count(0);
    }
  }
}

TEST_CASE("options that no patch can have are refused, and say what can") {
  const auto message = [&](const OptionValues& options) {
    try {
      open({flat(9, 9, 1)}, options);
    } catch (const InvalidInput& error) {
      return std::string(error.what());
    }
    return std::string("no error");
  };
  CHECK(testing::says(message(shape(48, 2)), "patch = 48 is not a power of two"));
  CHECK(message(shape(8, 3)) == "no error");
}

TEST_CASE("voids: the mask of cells is kept, in memory and by rows") {
  std::vector<uint8_t> valid(90 * 70, 1);
  for (size_t i = 0; i < valid.size(); ++i) valid[i] = i % 70 > 20 && i % 70 < 40 && i / 70 > 30 ? 0 : 1;
  const Field field = synthetic::field(synthetic::flat(90, 70), rough(61), valid);
  const Opened opened = open(field, shape(8, 2)), by_rows = open(windowed(field), shape(8, 2));
  CHECK(opened.hierarchy->coverage() == coverage_bits(*field));
  CHECK(by_rows.content_hash == opened.content_hash);
  CHECK(open({flat(20, 20, 1)}, shape(8, 2)).hierarchy->coverage().empty());
}

TEST_CASE("a build that was stopped goes on to the same store") {
  const Field field = flat(150, 170, 41);
  const testing::TemporaryFolder folder;
  const auto build = [&](const std::string& name, BuildMode mode, const Progress& progress) {
    return build_store(*field, seamless_method(), shape(8, 2), folder / name, mode, progress)->content_hash();
  };
  double last = 0.0;
  const std::string whole = build("a.lod", BuildMode::kNew, [&](const std::string&, double share) {
    CHECK(share >= last);
    CHECK(share <= 1.0);
    last = share;
  });
  CHECK(last == 1.0);
  const auto stop = [](const std::string& stage, double share) {
    if (stage == "patches" && share > 0.7) throw Interrupted();
  };
  CHECK_THROWS_AS(build("b.lod", BuildMode::kNew, stop), Interrupted);
  CHECK(build("b.lod", BuildMode::kResume, {}) == whole);
}

TEST_CASE("a store whose arrays do not fit its field is refused, and says why") {
  const Field field = flat(100, 100, 42);
  const testing::TemporaryFolder folder;
  const auto message = [&](const std::vector<int32_t>& layout, size_t means, size_t edges,
                           const std::vector<double>& scales) {
    const std::string path = folder / "a.lod";
    {
      StoreWriter writer(path, {"seamless", "{}", "cafe", "", field->frame()}, BuildMode::kForce);
      writer.put_array("layout", as_bytes(layout));
      writer.put_array("typical", as_bytes(std::vector<double>(means)));
      writer.put_array("scales", as_bytes(scales));
      writer.put_array("codes", as_bytes(std::vector<uint16_t>(edges)));
      writer.put_meta("pyramid", "vertex");
      writer.commit();
    }
    return testing::store_error([&] { seamless::Hierarchy(Store::open(path)).codes(); });
  };
  const Layout right = make_layout(*field, 3, 2, 0);
  const std::vector<int32_t> layout{3, 2, 0, right.levels};
  const auto means = static_cast<size_t>(2 * right.levels);
  const auto edges = static_cast<size_t>(right.first_edge(right.levels));
  CHECK(message(layout, means, edges, {1.0, 0.0}) == "no error");
  CHECK(testing::says(message({3, 2, 0}, means, edges, {1.0, 0.0}), "holds no layout of patches"));
  CHECK(testing::says(message({3, 5, 0, 5}, means, edges, {1.0, 0.0}), "holds no layout of patches"));
  CHECK(testing::says(message({3, 2, 1, right.levels}, means, edges, {1.0, 0.0}), "levels of patches"));
  CHECK(testing::says(message(layout, 1, edges, {1.0, 0.0}), "mean errors"));
  CHECK(testing::says(message(layout, means, edges - 1, {1.0, 0.0}), "errors of its"));
  CHECK(testing::says(message(layout, means, edges, {1.0}), "scales"));
  CHECK(testing::says(message(layout, means, edges, {-1.0, 0.0}), "scales"));
}
