// SPDX-License-Identifier: MIT
// multigrain's bounds against its own triangles, without GL: random cuts are stitched vertex by vertex as the GPU
// does it, every triangle is compared with all samples in double, and nothing may exceed the bound of its node.
#define DOCTEST_CONFIG_IMPLEMENT_WITH_MAIN
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <random>
#include <set>

#include "base/errors.h"
#include "base/parallel.h"
#include "methods/multigrain/hierarchy.h"
#include "methods/multigrain/multigrain.h"
#include "methods/multigrain/tiles.h"
#include "multigrain/stitch.h"
#include "store_fixture.h"
#include "synthetic.h"

using namespace lodlab;
using multigrain::Forest;
using multigrain::Node;
using multigrain::StitchVertex;
using multigrain::StrideMap;

namespace lodlab {
const Method& multigrain_method();
}

namespace {

using OptionValues = std::map<std::string, OptionValue>;
using Field = std::shared_ptr<const HeightField>;

struct Opened {
  Field field;
  std::shared_ptr<const Forest> forest;
};

Opened open(const Field& field, const OptionValues& options) {
  const testing::TemporaryFolder folder;
  const auto store = build_store({field}, multigrain_method(), options, folder / "a.lod", BuildMode::kNew, {});
  return {field, std::dynamic_pointer_cast<const Forest>(multigrain_method().open(store))};
}

/// Hills with a step and spikes.
synthetic::Height rough(unsigned seed, double scale = 1.0) {
  return [seed, scale](int64_t row, int64_t col) {
    std::mt19937 random(static_cast<unsigned>(seed * 7919u + row * 104729u + col * 1299709u));
    random.discard(3);
    const double noise = static_cast<double>(random() % 1000) / 1000.0;
    const double r = static_cast<double>(row), c = static_cast<double>(col);
    const double spike = random() % 97 == 0 ? 400.0 : 0.0;
    return scale * (300.0 + 90.0 * std::sin(0.11 * r + 0.3 * seed) * std::cos(0.07 * c) + 15.0 * noise + spike +
                    (col > 30 ? 60.0 : 0.0));
  };
}

struct Selected {
  uint32_t node;
  int k;
};

/// A random cut: any node, any resolution.
std::vector<Selected> random_cut(const Forest& forest, std::mt19937& random) {
  std::vector<Selected> cut;
  std::vector<uint32_t> open;
  for (uint32_t i = 0; i < forest.roots; ++i) open.push_back(i);
  const auto split = 20 + random() % 70;
  while (!open.empty()) {
    const uint32_t i = open.back();
    open.pop_back();
    const Node& n = forest.node[i];
    if (n.children > 0 && random() % 100 < split) {
      for (uint32_t c = 0; c < n.children; ++c) open.push_back(n.first_child + c);
      continue;
    }
    cut.push_back({i, n.least + static_cast<int>(random() % (1u + n.most - n.least))});
  }
  return cut;
}

using Triangle = std::array<StitchVertex, 3>;

class Surface {
 public:
  explicit Surface(const Opened& opened) : field_(*opened.field), forest_(*opened.forest) {}

  /// The triangles of a node as drawn, those that have collapsed left out.
  std::vector<Triangle> triangles(const Selected& s, const StrideMap& map) const {
    const multigrain::Layout& layout = forest_.layout;
    const Node& n = forest_.node[s.node];
    const int size = layout.node_log2(n.level), a = layout.stride_log2(n.level, s.k);
    const multigrain::StitchField field{static_cast<int>(layout.last_col()), static_cast<int>(layout.last_row()),
                                        static_cast<int>(layout.blocks_x()), layout.block_log2(), layout.wraps, layout.poles()};
    const auto vertex = [&](int i, int j) {
      return multigrain::stitch({n.col, n.row, size, a}, i, j, field, [&](int x, int y) {
        return static_cast<int>(map[static_cast<size_t>(y * layout.blocks_x() + x)]);
      });
    };
    std::vector<Triangle> out;
    const auto add = [&](StitchVertex p, StitchVertex q, StitchVertex r) {
      if (key(p) != key(q) && key(q) != key(r) && key(r) != key(p)) out.push_back({p, q, r});
    };
    const auto nx = static_cast<int>(layout.cells_x(n.col, size, a));
    const auto ny = static_cast<int>(layout.cells_y(n.row, size, a));
    for (int j = 0; j < ny; ++j) {
      for (int i = 0; i < nx; ++i) {
        const StitchVertex nw = vertex(i, j), ne = vertex(i + 1, j), sw = vertex(i, j + 1);
        const StitchVertex se = vertex(i + 1, j + 1);
        if ((i + j) % 2 == 0) {
          add(nw, sw, se);
          add(nw, se, ne);
        } else {
          add(nw, sw, ne);
          add(ne, sw, se);
        }
      }
    }
    return out;
  }

  /// One number for each point of the surface.
  int64_t key(StitchVertex v) const {
    const multigrain::Layout& layout = forest_.layout;
    const bool pole = (layout.pole_first && v.row == 0) || (layout.pole_last && v.row == layout.last_row());
    return static_cast<int64_t>(v.row) * field_.cols + (pole ? 0 : v.col % field_.cols);
  }

  double height(StitchVertex v) const { return field_.heights[key(v)]; }

  /// Largest distance at all samples that the triangle covers.
  double error(const Triangle& t) const { return field_.planet ? error_of_rays(t) : error_of_columns(t); }

 private:
  double error_of_columns(const Triangle& t) const {
    const auto cross = [](StitchVertex a, StitchVertex b, int64_t col, int64_t row) {
      return (b.col - a.col) * (row - a.row) - (b.row - a.row) * (col - a.col);
    };
    const int64_t area = cross(t[0], t[1], t[2].col, t[2].row);
    double worst = 0.0;
    if (area == 0) return worst;
    const int64_t sign = area > 0 ? 1 : -1;
    const auto [left, right] = std::minmax({t[0].col, t[1].col, t[2].col});
    const auto [top, bottom] = std::minmax({t[0].row, t[1].row, t[2].row});
    for (int64_t row = top; row <= bottom; ++row) {
      for (int64_t col = left; col <= right; ++col) {
        const int64_t w[3] = {sign * cross(t[1], t[2], col, row), sign * cross(t[2], t[0], col, row),
                              sign * cross(t[0], t[1], col, row)};
        if (std::min({w[0], w[1], w[2]}) < 0) continue;
        double z = 0.0;
        for (size_t i = 0; i < 3; ++i) z += static_cast<double>(w[i]) * height(t[i]);
        worst = std::max(worst, std::abs(z / static_cast<double>(sign * area) - field_.at(row, col)));
      }
    }
    return worst;
  }

  double error_of_rays(const Triangle& t) const {
    glm::dvec3 p[3];
    for (size_t i = 0; i < 3; ++i) p[i] = field_.position(t[i].row, t[i].col, height(t[i]));
    const double volume = glm::dot(p[0], glm::cross(p[1], p[2]));
    const double sign = volume > 0.0 ? 1.0 : -1.0;
    double worst = 0.0;
    if (std::abs(volume) < 1e-12 * std::pow(field_.radius, 3)) return worst;
    for (int64_t row = 0; row < field_.rows; ++row) {
      for (int64_t col = 0; col < field_.cols; ++col) {
        const glm::dvec3 ray = field_.direction(row, col);
        double sum = 0.0, least = 1e300;
        for (size_t i = 0; i < 3; ++i) {
          const glm::dvec3 normal = sign * glm::cross(p[(i + 1) % 3], p[(i + 2) % 3]);
          least = std::min(least, glm::dot(normal, ray) + 1e-14 * glm::length(normal));
          sum += glm::dot(normal, ray);
        }
        if (least < 0.0 || sum <= 0.0) continue;
        const StitchVertex at{static_cast<int>(col), static_cast<int>(row)};
        worst = std::max(worst, std::abs(sign * volume / sum - field_.radius - height(at)));
      }
    }
    return worst;
  }

  const HeightField& field_;
  const Forest& forest_;
};

struct Case {
  std::string name;
  Field field;
  OptionValues options;
};

OptionValues shape(int64_t chart, int64_t levels, int64_t most) {
  return {{"chart", chart}, {"levels", levels}, {"node_resolution", most}};
}

Field flat(int64_t rows, int64_t cols, unsigned seed, double scale = 1.0) {
  return synthetic::field(synthetic::flat(rows, cols, 10.0), rough(seed, scale));
}

Field globe(int64_t rows, int64_t cols, unsigned seed) {
  return synthetic::field(synthetic::planet(rows, cols, 20000.0), rough(seed));
}

Field patch(int64_t rows, int64_t cols, unsigned seed) {
  FieldFrame frame = synthetic::planet(181, 360, 20000.0);
  frame.rows = rows;
  frame.cols = cols;
  frame.lat0 = 62.0;
  frame.lon0 = 175.0;
  frame.wraps = false;
  return synthetic::field(frame, rough(seed));
}

std::vector<Case> cases() {
  return {{"smallest", flat(2, 2, 1), {}},
          {"strip", flat(2, 45, 2), {}},
          {"one block", flat(9, 9, 3), shape(8, 1, 8)},
          {"automatic", flat(50, 71, 4), {}},
          {"whole blocks", flat(65, 65, 5), shape(32, 3, 32)},
          {"odd", flat(37, 86, 6), shape(32, 3, 16)},
          {"odd, two levels", flat(83, 47, 7), shape(16, 2, 8)},
          {"high", flat(49, 49, 8, 1e4), shape(16, 3, 16)},
          {"deep", flat(70, 40, 9), shape(64, 5, 16)},
          {"globe", globe(33, 64, 10), shape(16, 3, 16)},
          {"globe, odd", globe(29, 51, 11), shape(16, 3, 16)},
          {"globe, last block of one cell", globe(25, 49, 12), shape(16, 2, 16)},
          {"globe, three columns in the last block", globe(25, 51, 12), shape(16, 2, 16)},
          {"globe, automatic", globe(19, 36, 13), {}},
          {"smallest globe", globe(3, 3, 14), {}},
          {"patch", patch(30, 41, 15), shape(16, 3, 16)}};
}

/// Every directed edge has its opposite, but along the border of a field that has one.
void check_watertight(const Opened& opened, const std::vector<std::vector<Triangle>>& triangles) {
  const multigrain::Layout& layout = opened.forest->layout;
  const Surface surface(opened);
  const auto border = [&](StitchVertex a, StitchVertex b) {
    if (a.row == b.row && (a.row == 0 || a.row == layout.last_row())) return true;
    return !layout.wraps && a.col == b.col && (a.col == 0 || a.col == layout.last_col());
  };
  std::map<std::pair<int64_t, int64_t>, int> edges;
  for (const auto& node : triangles) {
    for (const Triangle& t : node) {
      for (size_t i = 0; i < 3; ++i) {
        const StitchVertex a = t[i], b = t[(i + 1) % 3];
        if (!border(a, b)) ++edges[{surface.key(a), surface.key(b)}];
      }
    }
  }
  int64_t open = 0;
  for (const auto& [edge, count] : edges) {
    const auto other = edges.find({edge.second, edge.first});
    open += other == edges.end() || other->second != count;
  }
  CHECK(open == 0);
}

}  // namespace

TEST_CASE("no triangle of any cut is farther from the samples than its node says, and the surface is closed") {
  for (const Case& c : cases()) {
    CAPTURE(c.name);
    const Opened opened = open(c.field, c.options);
    const Forest& forest = *opened.forest;
    const Surface surface(opened);
    std::mt19937 random(7);
    std::vector<double> ratios;
    // Of the truth itself, which is known in double: thin triangles of a planet lose a few digits.
    const double rounding = c.field->planet ? 1e-12 * c.field->radius : 0.0;
    for (int round = 0; round < (c.field->planet ? 6 : 25); ++round) {
      const std::vector<Selected> cut = random_cut(forest, random);
      StrideMap map(static_cast<size_t>(forest.layout.blocks_x() * forest.layout.blocks_y()));
      for (const Selected& s : cut) forest.mark(forest.node[s.node], s.k, map);
      std::vector<std::vector<Triangle>> triangles;
      for (const Selected& s : cut) {
        const Node& n = forest.node[s.node];
        triangles.push_back(surface.triangles(s, map));
        double truth = 0.0;
        for (const Triangle& t : triangles.back()) truth = std::max(truth, surface.error(t));
        const double bound = forest.drawn_error(n, s.k, map);
        CAPTURE(s.node);
        CAPTURE(s.k);
        REQUIRE(truth <= bound + rounding);
        REQUIRE(bound <= forest.stored_error(n, s.k));
        if (truth > rounding) ratios.push_back(bound / truth);
      }
      check_watertight(opened, triangles);
    }
    if (ratios.empty()) continue;
    std::nth_element(ratios.begin(), ratios.begin() + static_cast<int64_t>(ratios.size() / 2), ratios.end());
    const double median = ratios[ratios.size() / 2];
    const double largest = *std::max_element(ratios.begin(), ratios.end());
    MESSAGE(std::string(c.name) << ": median bound/truth " << median << ", largest " << largest);
    CHECK(median <= 1.05);
    CHECK(largest <= 3.0);
  }
}
