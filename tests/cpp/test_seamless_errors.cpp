// SPDX-License-Identifier: MIT
// seamless's bounds against its own triangles, without GL: every patch at all resolutions of its edges is
// compared with all samples in double, and no tile or strip may exceed the bound of its edge. And the rules
// that bounds and weights keep, read back from the two bytes of an edge.
#include <doctest/doctest.h>

#include <algorithm>
#include <cstdio>

#include "base/errors.h"
#include "methods/seamless/closure.h"
#include "seamless_stores.h"

using namespace lodlab;
using namespace lodlab::seamless;
using Tree = seamless::Hierarchy;

namespace {

constexpr std::array<Edge, 4> kEdges{kNorth, kEast, kSouth, kWest};

struct Corner {
  int64_t col, row;
};

/// Largest vertical distance at the samples that a triangle covers.
double error_of(const HeightField& field, const std::array<Corner, 3>& t) {
  const auto cross = [](Corner a, Corner b, int64_t col, int64_t row) {
    return (b.col - a.col) * (row - a.row) - (b.row - a.row) * (col - a.col);
  };
  const int64_t area = cross(t[0], t[1], t[2].col, t[2].row), sign = area > 0 ? 1 : -1;
  double worst = 0.0;
  if (area == 0) return worst;
  const auto [left, right] = std::minmax({t[0].col, t[1].col, t[2].col});
  const auto [top, bottom] = std::minmax({t[0].row, t[1].row, t[2].row});
  for (int64_t row = top; row <= bottom; ++row) {
    for (int64_t col = left; col <= right; ++col) {
      const int64_t w[3] = {sign * cross(t[1], t[2], col, row), sign * cross(t[2], t[0], col, row),
                            sign * cross(t[0], t[1], col, row)};
      if (std::min({w[0], w[1], w[2]}) < 0) continue;
      double z = 0.0;
      for (size_t i = 0; i < 3; ++i) z += static_cast<double>(w[i]) * field.at(t[i].row, t[i].col);
      worst = std::max(worst, std::abs(z / static_cast<double>(sign * area) - field.at(row, col)));
    }
  }
  return worst;
}

class Truth {
 public:
  Truth(const Opened& opened)
      : field_(*opened.field),
        layout_(opened.hierarchy->layout),
        mesh_(layout_.patch_log2, layout_.resolutions) {}

  double tile(const Patch& p, Edge e, int k) const { return worst(p, mesh_.tile(e, k)); }
  double half(const Patch& p, Edge e, Side side, int k, int diagonal) const {
    return worst(p, mesh_.half(e, side, k, diagonal));
  }

 private:
  double worst(const Patch& p, const std::vector<Triangle>& piece) const {
    const auto at = [&](const Vertex& v) {
      return Corner{layout_.sample_col(p, v.u), layout_.sample_row(p, v.v)};
    };
    double most = 0.0;
    for (const Triangle& t : piece) most = std::max(most, error_of(field_, {at(t[0]), at(t[1]), at(t[2])}));
    return most;
  }

  const HeightField& field_;
  const Layout& layout_;
  const PatchMesh mesh_;
};

/// Every tile and half strip of every patch beside every diagonal is within the bound of its edge. Appends
/// bound / truth of each patch at each combination of resolutions that is off.
void check_bounds(const Opened& opened, std::vector<double>& ratios) {
  const Tree& tree = *opened.hierarchy;
  const Layout& layout = tree.layout;
  const int resolutions = layout.resolutions;
  const Truth truth(opened);
  for (int64_t id = 0; id < layout.patches(); ++id) {
    const Patch p = layout.at(id);
    double tiles[4][3] = {}, halves[4][2][3][3] = {};
    CAPTURE(id);
    for (const Edge e : kEdges) {
      for (int k = 0; k < resolutions; ++k) {
        const double bound = tree.bound(p, e, k);
        CAPTURE(int(e));
        CAPTURE(k);
        tiles[e][k] = truth.tile(p, e, k);
        REQUIRE(tiles[e][k] <= bound);
        for (const Side side : {Side::kStart, Side::kEnd}) {
          for (int d = k; d < resolutions; ++d) {
            double& half = halves[e][static_cast<int>(side)][k][d];
            half = truth.half(p, e, side, k, d);
            REQUIRE(half <= bound);
          }
        }
      }
    }
    for (int i = 0; i < packed_count(resolutions); ++i) {
      const Resolutions k = unpack(i, resolutions);
      double worst = 0.0;
      for (const Edge e : kEdges) {
        const Edge next = PatchMesh::next(e);
        const int diagonal = std::max(k[e], k[next]);
        worst = std::max(
            {worst, tiles[e][k[e]], halves[e][1][k[e]][diagonal], halves[next][0][k[next]][diagonal]});
      }
      REQUIRE(worst <= tree.bound(p, k));
      if (worst > 1e-3) ratios.push_back(tree.bound(p, k) / worst);
    }
  }
}

struct Case {
  std::string name;
  Field field;
  OptionValues options;
};

synthetic::Height spike(int64_t row, int64_t col) {
  return [row, col](int64_t r, int64_t c) { return r == row && c == col ? 1000.0 : 0.0; };
}

std::vector<Case> cases() {
  const auto made = [](int64_t rows, int64_t cols, const synthetic::Height& height) {
    return synthetic::field(synthetic::flat(rows, cols, 10.0), height);
  };
  FieldFrame oblong = synthetic::flat(70, 95, 10.0);
  oblong.dy = 3.7;
  return {{"smallest", flat(2, 2, 1), {}},
          {"strip", flat(2, 145, 2), shape(8, 2)},
          {"strip, three resolutions", flat(145, 2, 3), shape(8, 3)},
          {"less than a patch", flat(7, 12, 4), {}},
          {"one patch", flat(33, 33, 5), shape(32, 2)},
          {"whole patches", flat(129, 129, 6), shape(16, 2)},
          {"whole patches, three resolutions", flat(129, 129, 7), shape(8, 3)},
          {"odd", flat(137, 86, 8), shape(8, 2)},
          {"odd, three resolutions", flat(101, 150, 9), shape(8, 3)},
          {"two bands", flat(300, 90, 10), shape(16, 2)},
          {"not square samples", synthetic::field(oblong, rough(11)), shape(8, 2)},
          {"high", flat(90, 90, 12, 1e4), shape(16, 2)},
          {"spike", made(70, 90, spike(33, 47)), shape(8, 2)},
          {"spike, three resolutions", made(70, 90, spike(33, 47)), shape(8, 3)},
          {"cliff", made(90, 70, [](int64_t, int64_t c) { return c > 30 ? 500.0 : -20.0; }), shape(8, 2)},
          {"slanted cliff", made(90, 99, [](int64_t r, int64_t c) { return 3 * r > 2 * c ? 1e3 : 0.0; }),
           shape(16, 3)}};
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

}  // namespace

TEST_CASE("no tile or strip of any patch is farther from the samples than the bound of its edge") {
  for (const Case& c : cases()) {
    CAPTURE(c.name);
    std::vector<double> ratios;
    check_bounds(open(c.field, c.options), ratios);
    if (ratios.empty()) continue;
    // A code is 6 % with two resolutions, 26 % with three; the other side of an edge counts, too.
    const double middle = median(ratios), most = *std::max_element(ratios.begin(), ratios.end());
    MESSAGE(c.name << ": bound / truth " << middle << " in the median, " << most << " at most");
    CHECK(middle <= 2.0);
  }
}

TEST_CASE("fields of any size and options: bounds hold") {
  std::mt19937 random(11);
  const auto pick = [&](int from, int to) { return from + static_cast<int>(random() % (to - from + 1u)); };
  std::vector<double> ratios;
  for (int i = 0; i < 120; ++i) {
    const int rows = pick(2, 60), cols = pick(2, 60), resolutions = pick(2, 3);
    CAPTURE(rows);
    CAPTURE(cols);
    OptionValues options = shape(int64_t{1} << pick(3, 6), resolutions);
    if (i % 4 == 0) options["finest_error"] = 0.25 * pick(1, 400);
    check_bounds(open({flat(rows, cols, 100u + static_cast<unsigned>(i))}, options), ratios);
  }
  CHECK(median(ratios) <= 2.0);
}

TEST_CASE("bounds nest: no refinement of an edge and no split raises one") {
  for (const Case& c : cases()) {
    CAPTURE(c.name);
    const Opened opened = open(c.field, c.options);
    const Tree& tree = *opened.hierarchy;
    const Layout& layout = tree.layout;
    const int finest = layout.resolutions - 1;
    for (int64_t id = 0; id < layout.patches(); ++id) {
      const Patch p = layout.at(id);
      for (const Edge e : kEdges) {
        for (int k = 1; k <= finest; ++k) REQUIRE(tree.bound(p, e, k) <= tree.bound(p, e, k - 1));
      }
      if (p.level == 0) continue;
      const Resolutions all{finest, finest, finest, finest};
      REQUIRE(tree.bound(p, {0, 0, 0, 0}) <= tree.bound(layout.parent(p), all));
    }
  }
}

TEST_CASE("weights are what claim 1 needs: at least half of a patch's others, a child's at most its edge's") {
  for (const Case& c : cases()) {
    CAPTURE(c.name);
    const Opened opened = open(c.field, c.options);
    const Tree& tree = *opened.hierarchy;
    const Layout& layout = tree.layout;
    const CodeBook& book = tree.book();
    const auto weight = [&](const Patch& p, Edge e) {
      return book.weight(tree.codes()[static_cast<size_t>(layout.first_edge(p.level) + layout.edge(p, e))]);
    };
    const double least = book.weight(1);
    for (int64_t id = 0; id < layout.patches(); ++id) {
      const Patch p = layout.at(id);
      for (const Edge e : kEdges) {
        for (const Edge f : kEdges) {
          const double half = 0.5 * weight(p, f);
          REQUIRE(weight(p, e) >= (half < least ? half == 0.0 ? 0.0 : least : half));
        }
        for (int k = 0; k < layout.resolutions; ++k)
          REQUIRE(weight(p, e) >= (1 << k) * tree.bound(p, e, k) / tree.level[p.level].length * (1 - 1e-12));
        if (p.level + 1 == layout.levels) continue;
        for_child_edges(layout, p, e, [&](int64_t child, bool inner) {
          const auto code = tree.codes()[static_cast<size_t>(layout.first_edge(p.level + 1) + child)];
          if (!inner) REQUIRE(book.weight(code) <= weight(p, e));
        });
      }
    }
  }
}

TEST_CASE("the children's edges in the region of a tile: three of two children a side, ten of four") {
  for (const int resolutions : {2, 3}) {
    const Field field = synthetic::field(synthetic::flat(129, 129), [](int64_t, int64_t) { return 0.0; });
    const Layout layout = make_layout(*field, 3, resolutions, 0);
    for (const Edge e : kEdges) {
      std::vector<int64_t> edges;
      int inner = 0;
      for_child_edges(layout, {0, 0, 0}, e, [&](int64_t edge, bool inside) {
        edges.push_back(edge);
        inner += inside;
      });
      std::sort(edges.begin(), edges.end());
      CHECK(std::unique(edges.begin(), edges.end()) == edges.end());
      CHECK(edges.size() == (resolutions == 2 ? 3u : 10u));
      CHECK(inner == (resolutions == 2 ? 1 : 6));
    }
  }
}

TEST_CASE("level ground has no error at all, a plane none but rounding") {
  const auto made = [](const synthetic::Height& height) {
    return synthetic::field(synthetic::flat(90, 77), height);
  };
  const Field level = made([](int64_t, int64_t) { return 12.5; });
  const Field plane = made([](int64_t r, int64_t c) { return static_cast<double>(3 * r - 2 * c); });
  for (const int64_t resolutions : {2, 3}) {
    const Opened ground = open({level}, shape(8, resolutions)), slope = open({plane}, shape(8, resolutions));
    for (const NodeInfo& node : ground.hierarchy->nodes()) REQUIRE(node.error == 0.0);
    for (const uint16_t code : ground.hierarchy->codes())
      REQUIRE(ground.hierarchy->book().weight(code) == 0.0);
    for (const NodeInfo& node : slope.hierarchy->nodes()) REQUIRE(node.error <= 2e-3);
  }
}

TEST_CASE("a spike of 1000 is an error of 1000 wherever it is no vertex, and nothing where it is one") {
  for (const int64_t resolutions : {2, 3}) {
    const Field field = synthetic::field(synthetic::flat(65, 65), spike(33, 21));
    const Opened opened = open(field, shape(8, resolutions));
    const Tree& tree = *opened.hierarchy;
    const int finest = static_cast<int>(resolutions) - 1;
    CHECK(tree.bound({0, 0, 0}, {0, 0, 0, 0}) >= 1000.0);
    CHECK(tree.bound({0, 0, 0}, {0, 0, 0, 0}) <= 1000.0 * std::exp2(1.0 / tree.book().steps()) * 1.001);
    CHECK(tree.last_error == 0.0);
    CHECK(tree.bound({tree.layout.levels - 1, 4, 2}, {finest, finest, finest, finest}) == 0.0);
  }
}

TEST_CASE("finest_error: the last level's stride is the coarsest whose error is within it everywhere") {
  const Field field = synthetic::field(synthetic::flat(300, 170, 10.0), [](int64_t r, int64_t c) {
    return 40.0 * std::sin(0.02 * static_cast<double>(r)) * std::cos(0.03 * static_cast<double>(c));
  });
  for (const int64_t resolutions : {2, 3}) {
    int last = 0;
    for (const double finest_error : {0.0, 0.05, 0.5, 5.0, 1e6}) {
      OptionValues options = shape(8, resolutions);
      options["finest_error"] = finest_error;
      const Opened opened = open(field, options), by_rows = open(windowed(field), options);
      CHECK(opened.content_hash == by_rows.content_hash);
      const Layout& layout = opened.hierarchy->layout;
      CHECK(opened.hierarchy->last_error <= finest_error);
      CHECK(layout.finest_log2 >= last);
      last = layout.finest_log2;
      if (layout.levels == 1) continue;
      // The next coarser stride is beyond it.
      Opened coarser = opened;
      auto tree = std::make_shared<Tree>();
      tree->layout = make_layout(*field, 3, static_cast<int>(resolutions), last + 1);
      coarser.hierarchy = tree;
      const Truth truth(coarser);
      double worst = 0.0;
      for (int64_t id = tree->layout.first(tree->layout.levels - 1); id < tree->layout.patches(); ++id) {
        const int finest = static_cast<int>(resolutions) - 1;
        const Patch p = tree->layout.at(id);
        for (const Edge e : kEdges) {
          worst = std::max({worst, truth.tile(p, e, finest), truth.half(p, e, Side::kStart, finest, finest),
                            truth.half(p, e, Side::kEnd, finest, finest)});
        }
      }
      CHECK(worst > 0.9999 * finest_error);
    }
    CHECK(last >= 5);
  }
}

TEST_CASE("typical: the mean over a level's patches of what uniform resolutions are off by") {
  for (const int64_t resolutions : {2, 3}) {
    const Opened opened = open({flat(129, 97, 51)}, shape(8, resolutions));
    const Tree& tree = *opened.hierarchy;
    const Layout& layout = tree.layout;
    const Truth truth(opened);
    for (int level = 0; level < layout.levels; ++level) {
      for (int k = 0; k < resolutions; ++k) {
        double sum = 0.0;
        for (int64_t id = layout.first(level); id < layout.first(level + 1); ++id) {
          double worst = 0.0;
          for (const Edge e : kEdges) {
            worst = std::max(worst, truth.tile(layout.at(id), e, k));
            for (const Side side : {Side::kStart, Side::kEnd}) {
              for (int d = k; d < resolutions; ++d)
                worst = std::max(worst, truth.half(layout.at(id), e, side, k, d));
            }
          }
          sum += worst;
        }
        const double mean = sum / static_cast<double>(layout.first(level + 1) - layout.first(level));
        const double typical = tree.typical[static_cast<size_t>(level * resolutions + k)];
        if (k + 1 < resolutions || level + 1 == layout.levels) {
          CHECK(typical == doctest::Approx(mean).epsilon(1e-3));
        } else {  // that of the children, whose strips may have finer diagonals
          CHECK(typical >= mean);
          CHECK(typical <= 1.2 * mean);
        }
      }
    }
  }
}

TEST_CASE("codes: weights and bounds come back rounded up, by less than a code") {
  std::mt19937 random(5);
  const auto uniform = [&] { return static_cast<double>(random() % 100001) / 100000.0; };
  for (const int resolutions : {2, 3}) {
    const CodeBook book(resolutions, 37.5);
    const double code = std::exp2(1.0 / book.steps());
    for (int i = 0; i < 20000; ++i) {
      const double weight = 37.5 * std::exp2(-7.0 * uniform()), low = weight * std::exp2(-6.0 * uniform());
      const double mid = i % 5 == 0 ? 0.0 : low * std::exp2(-6.0 * uniform());
      const uint16_t bytes =
          book.encode(book.weight_code_of(weight), book.weight_code_of(low), book.weight_code_of(mid));
      CHECK(book.weight(bytes) >= weight);
      CHECK(book.weight(bytes) <= weight * code * 1.000001);
      CHECK(book.low(bytes, 2.0) >= 2.0 * low);
      CHECK(book.low(bytes, 2.0) <= 2.0 * low * code * 1.000001);
      if (resolutions == 2) continue;
      CHECK(book.mid(bytes, 2.0) >= 2.0 * mid);
      CHECK(book.mid(bytes, 2.0) <= 2.0 * mid * code * 1.000001);
    }
    CHECK(book.weight(book.encode(0, 0, 0)) == 0.0);
    CHECK(book.low(book.encode(0, 0, 0), 1.0) == 0.0);
  }
}
