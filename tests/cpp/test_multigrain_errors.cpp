// SPDX-License-Identifier: MIT
// multigrain's bounds against its own triangles, without GL: random cuts are stitched vertex by vertex as the
// GPU does it, every triangle is compared with all samples in double, and nothing may exceed the bound of its
// node.
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <random>
#include <set>

#include "base/errors.h"
#include "base/parallel.h"
#include "geometry/horizon.h"
#include "methods/multigrain/hierarchy.h"
#include "methods/multigrain/lattice.h"
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
  const auto store = build_store(*field, multigrain_method(), options, folder / "a.lod", BuildMode::kNew, {});
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
    return scale * (300.0 + 90.0 * std::sin(0.11 * r + 0.3 * seed) * std::cos(0.07 * c) + 15.0 * noise +
                    spike + (col > 30 ? 60.0 : 0.0));
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
    const multigrain::StitchField field{static_cast<int>(layout.last_col()),
                                        static_cast<int>(layout.last_row()),
                                        static_cast<int>(layout.blocks_x()),
                                        layout.block_log2(),
                                        layout.wraps,
                                        layout.poles()};
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
    if (layout.has_fringe(n.row, size)) {
      const auto row = static_cast<int>(layout.fringe_row());
      const int end = n.col + static_cast<int>(layout.cells_x(n.col, size, 0));
      for (int west = n.col; west < end; west += 1 << a) {
        for (int i = west + 1; i < std::min(west + (1 << a), end); ++i)
          add({west, row}, {layout.fringe_first ? i + 1 : i, row}, {layout.fringe_first ? i : i + 1, row});
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

  /// Where a planet's vertex is drawn: on the lattice.
  glm::dvec3 position(StitchVertex v) const {
    const multigrain::Lattice lattice(field_);
    return on_lattice(lattice, lattice.round(field_.position(v.row, v.col, height(v))));
  }
  static glm::dvec3 on_lattice(const multigrain::Lattice& lattice, const glm::ivec4& at) {
    const glm::dvec3 steps(at.w & 1023, at.w >> 10 & 1023, at.w >> 20 & 1023);
    return lattice.cell() * glm::dvec3(at) + lattice.quantum() * steps;
  }

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
    for (size_t i = 0; i < 3; ++i) p[i] = position(t[i]);
    const double on_edge = forest_.quantum() / field_.radius;
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
          least = std::min(least, glm::dot(normal, ray) + on_edge * glm::length(normal));
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

/// Once round, from the first row's latitude on.
Field band(int64_t rows, int64_t cols, double north, unsigned seed) {
  FieldFrame frame = synthetic::planet(33, cols, 20000.0);
  frame.rows = rows;
  frame.lat0 = north;
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
          {"patch", patch(30, 41, 15), shape(16, 3, 16)},
          {"cap", band(14, 64, 90.0, 16), shape(16, 3, 16)},
          {"southern band", band(13, 51, -12.0, 17), shape(16, 3, 16)}};
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

/// Draws random cuts; appends bound / truth of each node that is off.
void check_cuts(const Opened& opened, int rounds, std::mt19937& random, std::vector<double>& ratios) {
  const Forest& forest = *opened.forest;
  const Surface surface(opened);
  // Of the truth itself, which is known in double: thin triangles of a planet lose a few digits.
  const double rounding = opened.field->planet ? 1e-12 * opened.field->radius : 0.0;
  for (int round = 0; round < rounds; ++round) {
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
      // Where all is drawn, what is left is the lattice, of which the bound knows only the worst.
      if (truth > std::max(rounding, 100.0 * forest.quantum())) ratios.push_back(bound / truth);
    }
    check_watertight(opened, triangles);
  }
}

}  // namespace

TEST_CASE("no triangle of any cut is farther from the samples than its bound, and the surface is closed") {
  for (const Case& c : cases()) {
    CAPTURE(c.name);
    std::mt19937 random(7);
    std::vector<double> ratios;
    check_cuts(open(c.field, c.options), c.field->planet ? 6 : 25, random, ratios);
    if (ratios.empty()) continue;
    std::sort(ratios.begin(), ratios.end());
    CHECK(ratios[ratios.size() / 2] <= 1.05);
    CHECK(ratios.back() <= 3.0);
  }
}

TEST_CASE(
    "a border row that great circles would leave has all its samples, and the store's count of triangles") {
  std::mt19937 random(3);
  int64_t fringed = 0;
  for (const Case& c : cases()) {
    CAPTURE(c.name);
    const Opened opened = open(c.field, c.options);
    const Forest& forest = *opened.forest;
    const Surface surface(opened);
    const int64_t row = forest.layout.fringe_row();
    for (int round = 0; round < 4; ++round) {
      StrideMap map(static_cast<size_t>(forest.layout.blocks_x() * forest.layout.blocks_y()));
      const std::vector<Selected> cut = random_cut(forest, random);
      for (const Selected& s : cut) forest.mark(forest.node[s.node], s.k, map);
      std::set<int64_t> met;
      for (const Selected& s : cut) {
        const Node& n = forest.node[s.node];
        const std::vector<Triangle> drawn = surface.triangles(s, map);
        CHECK(drawn.size() <= forest.at(n, s.k).triangles);
        for (const Triangle& t : drawn) {
          for (const StitchVertex& v : t) {
            if (v.row == row) met.insert(surface.key(v));
          }
        }
      }
      if (row < 0) continue;
      fringed += met.size() == static_cast<size_t>(c.field->cols);
      CHECK(met.size() == static_cast<size_t>(c.field->cols));
    }
  }
  CHECK(fringed == 12);
}

TEST_CASE("fields and layouts of any size: bounds hold, or the layout is refused") {
  std::mt19937 random(11);
  const auto pick = [&](int from, int to) { return from + static_cast<int>(random() % (to - from + 1u)); };
  std::vector<double> ratios;
  int built = 0;
  for (int i = 0; i < 150; ++i) {
    const unsigned seed = 100u + static_cast<unsigned>(i);
    const bool planet = i % 3 == 0;
    const int rows = pick(planet ? 3 : 2, 40), cols = pick(planet ? 3 : 2, 40);
    const Field field = planet ? globe(rows, cols, seed) : flat(rows, cols, seed);
    const int64_t chart = pick(1, 6), levels = pick(1, 5), most = pick(1, 6);
    CAPTURE(rows);
    CAPTURE(cols);
    CAPTURE(planet);
    try {
      const Opened opened = open(field, shape(int64_t{1} << chart, levels, int64_t{1} << most));
      ++built;
      check_cuts(opened, 2, random, ratios);
    } catch (const InvalidInput& error) {
      CHECK(testing::says(error.what(), "the limit is chart = "));
    }
  }
  CHECK(built >= 50);
}

TEST_CASE("errors nest: a node's own under split and refinement, strips in both strides") {
  for (const Case& c : cases()) {
    CAPTURE(c.name);
    const Opened opened = open(c.field, c.options);
    const Forest& forest = *opened.forest;
    for (const Node& n : forest.node) {
      for (int k = n.least; k <= n.most; ++k) {
        const float error = forest.at(n, k).error;
        if (k > n.least) CHECK(error <= forest.at(n, k - 1).error);
        for (uint32_t i = n.first_child; i < n.first_child + n.children; ++i) {
          const Node& child = forest.node[i];
          for (int l = child.least; l <= child.most; ++l) {
            if (forest.stride_log2(child, l) <= forest.stride_log2(n, k))
              CHECK(forest.at(child, l).error <= error);
          }
        }
      }
      for (uint32_t i = n.first_child; i < n.first_child + n.children; ++i) {
        for (int a = 0; a < 3; ++a) {
          CHECK(forest.node[i].lo[a] >= n.lo[a]);
          CHECK(forest.node[i].hi[a] <= n.hi[a]);
        }
      }
    }
    const multigrain::BlockErrors& e = forest.errors;
    for (int64_t block = 0; block < forest.layout.blocks_x() * forest.layout.blocks_y(); ++block) {
      CHECK(e.own_error(block, 0) <= 3.0 * forest.quantum());  // on slopes of up to 70 degrees
      for (int edge = 0; edge < 4; ++edge) {
        for (int b = 1; b < e.strides; ++b) {
          for (int a = 0; a < b; ++a) {
            CHECK(e.strip_error(block, edge, a, b) <= e.own_error(block, b));
            if (a > 0) CHECK(e.strip_error(block, edge, a - 1, b) <= e.strip_error(block, edge, a, b));
            if (b + 1 < e.strides)
              CHECK(e.strip_error(block, edge, a, b) <= e.strip_error(block, edge, a, b + 1));
          }
        }
      }
    }
  }
}

TEST_CASE("the forest covers the field once at every level, and its tiles hold the heights") {
  for (const Case& c : cases()) {
    CAPTURE(c.name);
    const Opened opened = open(c.field, c.options);
    const Forest& forest = *opened.forest;
    const multigrain::Layout& layout = forest.layout;
    std::vector<int64_t> cells(static_cast<size_t>(layout.levels));
    const multigrain::Tiles tiles(layout);
    for (const Node& n : forest.node) {
      const int size = layout.node_log2(n.level);
      cells[n.level] += layout.cells_x(n.col, size, 0) * layout.cells_y(n.row, size, 0);
      for (int k = n.least; k <= n.most; ++k) {
        const int64_t id = tiles.id(forest.stride_log2(n, k), n.row, n.col);
        const multigrain::Tile tile = tiles.at(id);
        const std::vector<float> heights = forest.tile(id);
        REQUIRE(static_cast<int64_t>(heights.size()) == tile.samples());
        // The far corner of the node's grid.
        const int64_t j =
            ((n.row - tile.row) >> tile.stride_log2) + layout.cells_y(n.row, size, tile.stride_log2);
        const int64_t i =
            ((n.col - tile.col) >> tile.stride_log2) + layout.cells_x(n.col, size, tile.stride_log2);
        REQUIRE(j < tile.rows);
        REQUIRE(i < tile.cols);
        const int64_t row = std::min<int64_t>(n.row + (int64_t{1} << size), layout.last_row());
        const int64_t col = std::min<int64_t>(n.col + (int64_t{1} << size), layout.last_col());
        const bool pole = layout.pole_last && row == layout.last_row();
        CHECK(heights[static_cast<size_t>(j * tile.cols + i)] ==
              c.field->at(row, pole || col == c.field->cols ? 0 : col));
      }
    }
    for (const int64_t count : cells) CHECK(count == layout.last_row() * layout.last_col());
  }
}

TEST_CASE("positions of a planet are on its lattice, one for each sample, whichever tile has it") {
  for (const Case& c : cases()) {
    if (!c.field->planet) continue;
    CAPTURE(c.name);
    const Opened opened = open(c.field, c.options);
    const multigrain::Lattice lattice(*c.field);
    CHECK(opened.forest->quantum() == lattice.quantum());
    CHECK((c.field->radius + c.field->z_max) / lattice.quantum() <= 0x1p40);
    CHECK((c.field->radius + c.field->z_max) / lattice.quantum() > 0x1p39);
    const multigrain::Layout& layout = opened.forest->layout;
    const multigrain::Tiles tiles(layout);
    std::map<int64_t, glm::ivec4> known;
    for (int64_t id = 0; id < tiles.count(); ++id) {
      const multigrain::Tile tile = tiles.at(id);
      if (!opened.forest->store->has_page(multigrain::kHeights, id)) continue;
      const auto positions = lattice.positions(tiles, tile, opened.forest->tile(id));
      for (int64_t i = 0; i < tile.samples(); ++i) {
        const StitchVertex at{static_cast<int>(tiles.source_col(tile, i % tile.cols)),
                              static_cast<int>(tiles.source_row(tile, i / tile.cols))};
        const Surface surface(opened);
        const glm::ivec4 found = positions[static_cast<size_t>(i)];
        const auto [place, added] = known.insert({surface.key(at), found});
        REQUIRE((added || place->second == found));
        const glm::dvec3 exact = c.field->position(at.row, at.col, surface.height(at));
        REQUIRE(glm::distance(Surface::on_lattice(lattice, found), exact) <= lattice.error());
      }
    }
  }
}

TEST_CASE("an eye on the lattice: its cell and what is beyond it, and no difference overflows") {
  const Field field = globe(9, 16, 51);
  const multigrain::Lattice lattice(*field);
  for (const double reach : {0.0, 1e-9, 3.0, 20000.0, 21000.0, 1e9, 1e30}) {
    const glm::dvec3 eye = reach * glm::dvec3(0.6, -0.8, 1.0);
    const multigrain::Lattice::Eye found = lattice.eye(eye);
    for (int i = 0; i < 3; ++i) {
      CHECK(std::abs(int64_t{found.cell[i]}) < int64_t{1} << 30);
      const double rest = eye[i] - lattice.cell() * found.cell[i];
      CHECK(found.rest[i] == static_cast<float>(rest));
      if (reach <= 20000.0) CHECK((rest >= 0.0 && rest < lattice.cell()));
    }
  }
}

TEST_CASE(
    "a planet's occluder: nothing is drawn in it, and what it hides the source's own horizon hides too") {
  std::mt19937 random(17);
  std::uniform_real_distribution<double> any(-1.0, 1.0);
  int64_t culled = 0, kept = 0;
  for (const Case& c : cases()) {
    CAPTURE(c.name);
    const Opened opened = open(c.field, c.options);
    const Forest& forest = *opened.forest;
    if (!c.field->planet) {
      CHECK(forest.occluder.radius == 0.0);
      continue;
    }
    if (!(forest.occluder.radius > 0.0)) continue;  // blocks of a hemisphere
    const double source = c.field->radius + c.field->z_min;
    CHECK(forest.occluder.radius < source);
    const Surface surface(opened);
    for (int round = 0; round < 4; ++round) {
      const std::vector<Selected> cut = random_cut(forest, random);
      StrideMap map(static_cast<size_t>(forest.layout.blocks_x() * forest.layout.blocks_y()));
      for (const Selected& s : cut) forest.mark(forest.node[s.node], s.k, map);
      glm::dvec3 eye(any(random), any(random), any(random));
      const double away[] = {1.0 + c.field->z_max / source, 1.2, 4.0, 0.5};  // the last one: inside
      eye *= away[round] * source / glm::length(eye);
      const Horizon own(forest.occluder.radius, eye), of_source(source, eye);
      for (const Selected& s : cut) {
        const bool hidden = own.hides(forest.occluder.nodes[s.node]);
        CHECK_FALSE((hidden && round == 3));
        (hidden ? culled : kept) += 1;
        for (const Triangle& t : surface.triangles(s, map)) {
          glm::dvec3 p[3];
          for (size_t i = 0; i < 3; ++i) p[i] = surface.position(t[i]);
          for (int i = 0; i < 5; ++i) {  // points of the triangle
            const double u = 0.5 + 0.5 * any(random), v = (1.0 - u) * (0.5 + 0.5 * any(random));
            const glm::dvec3 at = p[0] + u * (p[1] - p[0]) + v * (p[2] - p[0]);
            REQUIRE(glm::length(at) > forest.occluder.radius);
            if (!hidden) continue;
            REQUIRE(own.hides(at - eye));
            // A sample that the triangle is compared with there, as high as any.
            const glm::dvec3 sample = (c.field->radius + c.field->z_max) / glm::length(at) * at;
            REQUIRE(own.hides(sample - eye));
            REQUIRE(of_source.hides(sample - eye));
          }
        }
        if (!hidden) continue;
        const Node& n = forest.node[s.node];
        for (uint32_t child = n.first_child; child < n.first_child + n.children; ++child)
          REQUIRE(own.hides(forest.occluder.nodes[child]));
      }
    }
  }
  CHECK(culled > 100);
  CHECK(kept > 100);
}

TEST_CASE("a block's errors are its own: the same in a larger field, with one thread or two") {
  const Field small = flat(65, 65, 21), large = flat(70, 75, 21);
  const multigrain::Layout one = multigrain::make_layout(*small, 5, 2, 16);
  const multigrain::Layout two = multigrain::make_layout(*large, 5, 2, 16);
  set_thread_count(1);
  const auto a = measure_errors(*small, one, multigrain::Bounds::kDrawn, {});
  const auto b = measure_errors(*large, two, multigrain::Bounds::kDrawn, {});
  set_thread_count(2);
  const auto c = measure_errors(*large, two, multigrain::Bounds::kDrawn, {});
  set_thread_count(0);
  CHECK(b.own == c.own);
  CHECK(b.strips == c.strips);
  for (int64_t y = 0; y < one.blocks_y(); ++y) {
    for (int64_t x = 0; x < one.blocks_x(); ++x) {
      if (y + 1 < one.blocks_y() && x + 1 < one.blocks_x()) {
        const int64_t i = y * one.blocks_x() + x, j = y * two.blocks_x() + x;
        for (int s = 0; s < a.strides; ++s) CHECK(a.own_error(i, s) == b.own_error(j, s));
        for (int edge = 0; edge < 4; ++edge)
          CHECK(a.strip_error(i, edge, 1, 3) == b.strip_error(j, edge, 1, 3));
      }
    }
  }
}

TEST_CASE("a plane has no error but rounding, level ground none at all") {
  const Field plane = synthetic::field(
      synthetic::flat(70, 50), [](int64_t r, int64_t c) { return static_cast<double>(3 * r - 2 * c); });
  const Field level = synthetic::field(synthetic::flat(70, 50), [](int64_t, int64_t) { return 12.5; });
  const multigrain::Layout layout = multigrain::make_layout(*plane, 6, 3, 64);
  for (const float e : measure_errors(*plane, layout, multigrain::Bounds::kDrawn, {}).own) CHECK(e <= 1e-3f);
  for (const auto bounds : {multigrain::Bounds::kDrawn, multigrain::Bounds::kBilinear}) {
    const auto errors = measure_errors(*level, layout, bounds, {});
    for (const float e : errors.own) CHECK(e == 0.0f);
    for (const float e : errors.strips) CHECK(e == 0.0f);
  }
}

TEST_CASE("bilinear: a saddle fits exactly, though its triangles do not") {
  const Field saddle = synthetic::field(synthetic::flat(33, 33),
                                        [](int64_t r, int64_t c) { return static_cast<double>(r * c); });
  const multigrain::Layout layout = multigrain::make_layout(*saddle, 4, 2, 16);
  const auto paper = measure_errors(*saddle, layout, multigrain::Bounds::kBilinear, {});
  const auto drawn = measure_errors(*saddle, layout, multigrain::Bounds::kDrawn, {});
  for (int64_t i = 0; i < layout.blocks_x() * layout.blocks_y(); ++i) {
    CHECK(paper.own_error(i, 2) <= 1e-30f);
    CHECK(drawn.own_error(i, 2) >= 4.0f);  // the middle of a cell of 4 x 4: 16 / 4
    CHECK(drawn.own_error(i, 2) <= 4.001f);
  }
  CHECK(*std::max_element(paper.strips.begin(), paper.strips.end()) == 0.0f);
}

TEST_CASE("finest_error: what is left out is within it, and so is the finest cut") {
  const Field field = synthetic::field(synthetic::flat(129, 129, 10.0), [](int64_t r, int64_t c) {
    return c > 80 ? 40.0 * std::sin(0.9 * static_cast<double>(r)) : 0.001 * static_cast<double>(r * r % 17);
  });
  const OptionValues all = shape(64, 3, 64);
  OptionValues some = all;
  some["finest_error"] = 0.5;
  const Opened whole = open(field, all), less = open(field, some);
  CHECK(less.forest->resolution.size() < whole.forest->resolution.size());
  CHECK(less.forest->vertices() < whole.forest->vertices());
  CHECK(whole.forest->vertices() == 129 * 129);
  StrideMap map(static_cast<size_t>(less.forest->layout.blocks_x() * less.forest->layout.blocks_y()));
  std::vector<Selected> cut;
  for (uint32_t i = 0; i < less.forest->node.size(); ++i) {
    const Node& n = less.forest->node[i];
    if (n.children == 0) cut.push_back({i, n.most});
  }
  for (const Selected& s : cut) less.forest->mark(less.forest->node[s.node], s.k, map);
  bool coarse = false;
  for (const Selected& s : cut) {
    CHECK(less.forest->drawn_error(less.forest->node[s.node], s.k, map) <= 0.5);
    coarse = coarse || less.forest->stride_log2(less.forest->node[s.node], s.k) > 0;
  }
  CHECK(coarse);
}

TEST_CASE("options that no layout can have are refused, and say what can") {
  const Field field = flat(600, 700, 31);
  const auto message = [&](const OptionValues& options) {
    try {
      open(field, options);
    } catch (const InvalidInput& error) {
      return std::string(error.what());
    }
    return std::string("no error");
  };
  CHECK(testing::says(message({{"chart", int64_t{100}}}), "chart = 100 is not a power of two"));
  CHECK(testing::says(message({{"chart", int64_t{1}}}), "chart = 1 is below the limit of 2"));
  CHECK(testing::says(message({{"node_resolution", int64_t{48}}}),
                      "node_resolution = 48 is not a power of two"));
  CHECK(testing::says(message(shape(512, 2, 64)), "limit is chart = 128"));
  const Field sphere = globe(65, 128, 32);
  CHECK_THROWS_AS(open(sphere, shape(128, 2, 64)), InvalidInput);
}

TEST_CASE("a build that was stopped goes on to the same store") {
  const Field field = flat(150, 170, 41);
  const testing::TemporaryFolder folder;
  const auto build = [&](const std::string& name, BuildMode mode, const Progress& progress) {
    return build_store(*field, multigrain_method(), shape(64, 3, 16), folder / name, mode, progress)
        ->content_hash();
  };
  const std::string whole = build("a.lod", BuildMode::kNew, {});
  const auto stop = [](const std::string& stage, double share) {
    if (stage == "heights" && share > 0.4) throw Interrupted();
  };
  CHECK_THROWS_AS(build("b.lod", BuildMode::kNew, stop), Interrupted);
  CHECK(build("b.lod", BuildMode::kResume, {}) == whole);
}
