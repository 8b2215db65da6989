// SPDX-License-Identifier: MIT
// Forests for tests of adaptation, without a store: errors made up so that they nest, or a fractal's; views
// of them; and the checks that every cut must pass.
#pragma once

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "geometry/fractal.h"
#include "methods/multigrain/adapt.h"
#include "methods/multigrain/exact.h"
#include "methods/multigrain/multigrain.h"

namespace lodlab::multigrain {

using Random = std::mt19937;

inline double uniform(Random& random, double from, double to) {
  return std::uniform_real_distribution<double>(from, to)(random);
}

/// Errors of nodes from those of blocks; boxes with the same heights everywhere.
inline void fill_nodes(Forest& forest, double spacing, double low, double high, float finest_error = 0.0f) {
  const Layout& layout = forest.layout;
  forest.node = make_nodes(layout);
  forest.roots = static_cast<uint32_t>(layout.charts_x() * layout.charts_y());
  for (Node& n : forest.node) {
    const int64_t side = int64_t{1} << layout.node_log2(n.level);
    const double x0 = n.col * spacing, y1 = -n.row * spacing;
    const double x1 = static_cast<double>(std::min(n.col + side, layout.last_col())) * spacing;
    const double y0 = -static_cast<double>(std::min(n.row + side, layout.last_row())) * spacing;
    n.lo[0] = x0, n.lo[1] = y0, n.lo[2] = low, n.hi[0] = x1, n.hi[1] = y1, n.hi[2] = high;
    const int q = layout.block_log2();
    const auto error_of = [&](int k) {
      float error = 0.0f;
      for (int64_t y = n.row >> q; y < std::min((n.row + side) >> q, layout.blocks_y()); ++y) {
        for (int64_t x = n.col >> q; x < std::min((n.col + side) >> q, layout.blocks_x()); ++x)
          error =
              std::max(error, forest.errors.own_error(y * layout.blocks_x() + x, forest.stride_log2(n, k)));
      }
      return error;
    };
    // As the option finest_error leaves it: no resolution finer than the first that is within it.
    int most = n.least;
    while (most < n.most && error_of(most) > finest_error) ++most;
    if (finest_error > 0.0f) n.most = static_cast<uint8_t>(most);
    n.first_resolution = static_cast<uint32_t>(forest.resolution.size());
    for (int k = n.least; k <= n.most; ++k) {
      const float error = error_of(k);
      forest.resolution.push_back({error, static_cast<uint32_t>(triangle_count(layout, n, k))});
    }
  }
}

inline FieldFrame frame_of(int64_t rows, int64_t cols) {
  FieldFrame frame;
  frame.rows = rows;
  frame.cols = cols;
  return frame;
}

/// Errors at random: rough and smooth regions, spikes; nested as errors.h asks.
inline std::shared_ptr<const Forest> random_forest(int64_t rows, int64_t cols, int chart_log2, int levels,
                                                   int most_log2, unsigned seed, float finest_error = 0.0f) {
  auto forest = std::make_shared<Forest>();
  forest->layout = make_layout(frame_of(rows, cols), chart_log2, levels, most_log2);
  const Layout& layout = forest->layout;
  BlockErrors& errors = forest->errors;
  errors.strides = layout.block_log2() + 1;
  const int64_t wide = layout.blocks_x(), high = layout.blocks_y();
  const int pairs = BlockErrors::pairs(errors.strides);
  errors.own.resize(static_cast<size_t>(wide * high * errors.strides));
  errors.strips.resize(static_cast<size_t>(wide * high * 4 * pairs));
  Random random(seed);
  const double phase = uniform(random, 0.0, 6.0);
  for (int64_t i = 0; i < wide * high; ++i) {
    const double x = static_cast<double>(i % wide) / static_cast<double>(wide),
                 y = static_cast<double>(i / wide) / static_cast<double>(high);
    double rough = std::exp(3.0 * std::sin(7.0 * x + phase) * std::cos(5.0 * y - phase));
    if (random() % 40 == 0) rough *= 20.0;
    if (random() % 10 == 0) rough = 0.0;
    double own = 0.0;
    for (int a = 1; a < errors.strides; ++a) {
      own += rough * uniform(random, 0.01, 0.05) * std::pow(1.8, a);
      errors.own[static_cast<size_t>(i * errors.strides + a)] = static_cast<float>(own);
    }
    for (int edge = 0; edge < 4; ++edge) {
      double share = uniform(random, 0.0, 0.5);
      for (int a = 0; a < errors.strides; ++a) {
        share += uniform(random, 0.0, 0.1);
        for (int b = a + 1; b < errors.strides; ++b) {
          errors.strips[static_cast<size_t>((i * 4 + edge) * pairs + BlockErrors::pair(a, b))] =
              static_cast<float>(std::min(share, 1.0)) * errors.own_error(i, b);
        }
      }
    }
  }
  fill_nodes(*forest, 1.0, 0.0, 40.0, finest_error);
  return forest;
}

inline std::shared_ptr<const Forest> fractal_forest(int side, int chart_log2, int levels, int most_log2) {
  static std::vector<float> heights;
  heights.resize(static_cast<size_t>(side) * side);
  fractal_heights({}, 0, 0, side, side, heights.data());
  HeightField field;
  field.rows = field.cols = side;
  field.heights = heights.data();
  const auto [low, high] = std::minmax_element(heights.begin(), heights.end());
  field.z_min = *low;
  field.z_max = *high;
  auto forest = std::make_shared<Forest>();
  forest->layout = make_layout(frame_of(side, side), chart_log2, levels, most_log2);
  forest->errors = measure_errors(field, forest->layout, Bounds::kDrawn, {});
  fill_nodes(*forest, 30.0, *low, *high);
  return forest;
}

/// The forest's extent in space: from north-west to south-east, and up to the highest sample.
struct Extent {
  double wide = 0.0, high = 0.0, top = 0.0;
  explicit Extent(const Forest& forest) {
    for (uint32_t i = 0; i < forest.roots; ++i) {
      const Node& n = forest.node[i];
      wide = std::max(wide, n.hi[0]);
      high = std::max(high, -n.lo[1]);
      top = std::max(top, n.hi[2]);
    }
  }
};

inline View random_view(const Forest& forest, Random& random) {
  const Extent e(forest);
  View view;
  view.eye = {uniform(random, -0.3 * e.wide, 1.3 * e.wide), -uniform(random, -0.3 * e.high, 1.3 * e.high),
              e.top + 0.01 * e.wide * std::exp(uniform(random, 0.0, 5.0))};
  view.target = {uniform(random, 0.0, e.wide), -uniform(random, 0.0, e.high), 0.0};
  view.fov = uniform(random, 20.0, 100.0);
  view.near_plane = 1.0;
  return view;
}

/// Frame i of a flight in rounds, by steps of a two-hundredth of the field's width.
inline View flight(const Forest& forest, int i) {
  const Extent e(forest);
  const double t = 0.0125 * i;
  View view;
  view.eye = {e.wide * (0.5 + 0.4 * std::cos(t)), -e.high * (0.5 + 0.4 * std::sin(t)), e.top + 0.06 * e.wide};
  view.target = view.eye + glm::dvec3(-std::sin(t) * e.wide, -std::cos(t) * e.high, -0.25 * e.wide);
  view.near_plane = 1.0;
  return view;
}

/// What an adapter claims of a cut, and the view that it was selected for.
struct Selected : Claim {
  View view;
};

inline Selected select(Adapter& adapter, Adapt adapt, const View& view, const Budget& budget) {
  Selected cut;
  cut.view = view;
  adapter.select(adapt, make_camera(view), budget, cut);
  return cut;
}

inline Budget budget_of(std::optional<double> pixel_error, std::optional<int64_t> triangles,
                        std::optional<int64_t> nodes) {
  return {pixel_error, triangles, nodes};
}

/// Everything that is said of a cut is so: it covers, counts and bounds.
inline void check_cut(const Forest& forest, const Selected& cut, const Budget& budget) {
  const Camera camera = make_camera(cut.view);
  const Projector projector(Projection::kStrict, camera);
  StrideMap map(static_cast<size_t>(forest.layout.blocks_x() * forest.layout.blocks_y()), 255);
  int64_t triangles = 0, visible = 0, area = 0;
  double predicted = 0.0, tau = 0.0;
  bool sorted = true, in_range = true, culled_right = true, drawn_right = true;
  for (size_t i = 0; i < cut.nodes.size(); ++i) {
    const CutNode& c = cut.nodes[i];
    const Node& n = forest.node[c.node];
    sorted = sorted && (i == 0 || cut.nodes[i - 1].node < c.node);
    in_range =
        in_range && static_cast<int>(c.resolution) >= n.least && static_cast<int>(c.resolution) <= n.most;
    forest.mark(n, static_cast<int>(c.resolution), map);
    area += forest.layout.cells_x(n.col, forest.layout.node_log2(n.level), 0) *
            forest.layout.cells_y(n.row, forest.layout.node_log2(n.level), 0);
  }
  for (const CutNode& c : cut.nodes) {
    const Node& n = forest.node[c.node];
    const double drawn = forest.drawn_error(n, static_cast<int>(c.resolution), map);
    drawn_right = drawn_right && drawn == c.error;
    culled_right =
        culled_right && c.visible == camera.sees({{n.lo[0], n.lo[1], n.lo[2]}, {n.hi[0], n.hi[1], n.hi[2]}});
    if (!c.visible) continue;
    triangles += forest.at(n, static_cast<int>(c.resolution)).triangles;
    ++visible;
    predicted = std::max(predicted, projector.project(drawn, projector.place(n.lo, n.hi)));
    tau = std::max(tau, projector.project(forest.at(n, static_cast<int>(c.resolution)).error,
                                          projector.place(n.lo, n.hi)));
  }
  CHECK(sorted);
  CHECK(in_range);
  CHECK(culled_right);
  CHECK(drawn_right);
  CHECK(area == forest.layout.last_col() * forest.layout.last_row());
  CHECK(std::find(map.begin(), map.end(), 255) == map.end());
  CHECK(triangles == cut.triangles);
  CHECK(visible == cut.visible_nodes);
  CHECK(predicted == cut.predicted_px);
  CHECK(tau == cut.tau);
  const bool met = (!budget.pixel_error || predicted <= *budget.pixel_error) &&
                   (!budget.triangles || triangles <= *budget.triangles) &&
                   (!budget.nodes || visible <= *budget.nodes);
  CHECK(met == cut.budget_met);
}

/// Triangles and nodes of the roots at their least resolution.
inline std::pair<int64_t, int64_t> coarsest(const Forest& forest, const View& view) {
  const Camera camera = make_camera(view);
  std::pair<int64_t, int64_t> sum{0, 0};
  for (uint32_t i = 0; i < forest.roots; ++i) {
    const Node& n = forest.node[i];
    if (!camera.sees({{n.lo[0], n.lo[1], n.lo[2]}, {n.hi[0], n.hi[1], n.hi[2]}})) continue;
    sum.first += forest.at(n, n.least).triangles;
    ++sum.second;
  }
  return sum;
}

inline void check_hard(const Forest& forest, const Selected& cut, const Budget& budget) {
  const auto [triangles, nodes] = coarsest(forest, cut.view);
  bool can = triangles <= budget.triangles.value_or(triangles) && nodes <= budget.nodes.value_or(nodes);
  if (!can) {  // a split may cost less: children are culled
    Exact::Limits limits;
    limits.triangles = budget.triangles.value_or(limits.triangles);
    limits.nodes = budget.nodes.value_or(limits.nodes);
    can = Exact(forest, Projection::kStrict, make_camera(cut.view)).least_error(limits).has_value();
  }
  CHECK(can == !cut.least_triangles.has_value());
  if (can) {
    CHECK(cut.triangles <= budget.triangles.value_or(cut.triangles));
    CHECK(cut.visible_nodes <= budget.nodes.value_or(cut.visible_nodes));
  } else {
    CHECK(cut.triangles == cut.least_triangles);
    CHECK(cut.visible_nodes == cut.least_nodes);
    CHECK(!cut.budget_met);
  }
}

inline bool same(const Selected& a, const Selected& b) {
  return std::equal(a.nodes.begin(), a.nodes.end(), b.nodes.begin(), b.nodes.end(),
                    [](const CutNode& x, const CutNode& y) {
                      return x.node == y.node && x.resolution == y.resolution && x.visible == y.visible &&
                             x.error == y.error;
                    });
}

inline double median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2),
                   values.end());
  return values[values.size() / 2];
}

inline std::vector<std::shared_ptr<const Forest>> forests() {
  return {random_forest(513, 769, 8, 5, 8, 1),    random_forest(300, 411, 7, 5, 5, 2),
          random_forest(1025, 1025, 10, 6, 7, 3), random_forest(70, 33, 4, 1, 4, 4),
          random_forest(200, 200, 8, 3, 8, 5),    random_forest(513, 500, 8, 5, 7, 6, 1.5f)};
}

}  // namespace lodlab::multigrain
