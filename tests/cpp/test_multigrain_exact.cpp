// SPDX-License-Identifier: MIT
// The optimum of a forest against all of its cuts, one by one, and against the queues.
#include <doctest/doctest.h>

#include <map>

#include "methods/multigrain/exact.h"
#include "multigrain_forests.h"

using namespace lodlab;
using namespace lodlab::multigrain;

namespace {

constexpr double kNone = std::numeric_limits<double>::infinity();

/// A forest of at most 3 levels and 3 resolutions under a view, both made up.
struct Made {
  Forest forest;
  std::vector<uint8_t> visible;
  std::vector<double> pixels;

  explicit Made(Random& random) {
    forest.roots = static_cast<uint32_t>(1 + random() % 3);
    const int levels = 1 + static_cast<int>(random() % 3);
    for (uint32_t i = 0; i < forest.roots; ++i) add(random, -1, 0);
    for (uint32_t id = 0; id < forest.node.size(); ++id) {
      if (forest.node[id].level + 1 == levels || random() % 8 == 0) continue;
      forest.node[id].first_child = static_cast<uint32_t>(forest.node.size());
      forest.node[id].children = static_cast<uint8_t>(1 + random() % 4);
      for (int c = 0; c < forest.node[id].children; ++c)
        add(random, static_cast<int32_t>(id), forest.node[id].level + 1);
    }
  }

 private:
  /// Errors nest: no child's, at its finest, is above its parent's there; a resolution's no coarser one's.
  void add(Random& random, int32_t parent, int level) {
    Node n{};
    n.parent = parent;
    n.level = static_cast<uint8_t>(level);
    n.least = static_cast<uint8_t>(1 + random() % 2);
    n.most = static_cast<uint8_t>(n.least + random() % 3);
    n.first_resolution = static_cast<uint32_t>(forest.resolution.size());
    double top = 64.0, finest = 8.0;
    if (parent >= 0) {
      const Node& above = forest.node[static_cast<size_t>(parent)];
      top = pixels[above.first_resolution];
      finest = pixels[above.first_resolution + static_cast<size_t>(above.most - above.least)];
    }
    std::vector<double> errors;
    for (int k = n.least; k <= n.most; ++k) errors.push_back(std::floor(uniform(random, 0.0, top + 1.0)));
    std::sort(errors.rbegin(), errors.rend());
    errors.back() = std::min(errors.back(), std::floor(uniform(random, 0.0, finest + 1.0)));
    auto triangles = static_cast<uint32_t>(1 + random() % (8u << (4 - 2 * level)));
    for (const double error : errors) {
      forest.resolution.push_back({static_cast<float>(error), triangles});
      pixels.push_back(error);
      triangles += static_cast<uint32_t>(1 + random() % (3 * triangles));
    }
    visible.push_back((parent < 0 || visible[static_cast<size_t>(parent)]) && random() % 5 > 0);
    forest.node.push_back(n);
  }
};

/// For each number of triangles and nodes that some cut has: its smallest largest error.
using Cuts = std::map<std::pair<int64_t, int64_t>, double>;

void keep(Cuts& cuts, std::pair<int64_t, int64_t> cost, double error) {
  const auto [at, fresh] = cuts.insert({cost, error});
  if (!fresh) at->second = std::min(at->second, error);
}

Cuts combine(const Cuts& a, const Cuts& b) {
  Cuts out;
  for (const auto& [x, ex] : a) {
    for (const auto& [y, ey] : b) keep(out, {x.first + y.first, x.second + y.second}, std::max(ex, ey));
  }
  return out;
}

/// All cuts of a subtree, one by one; of those that cost the same only the best is remembered.
Cuts enumerate(const Made& made, uint32_t id) {
  const Node& n = made.forest.node[id];
  Cuts out;
  for (int k = n.least; k <= n.most; ++k) {
    const size_t row = n.first_resolution + static_cast<size_t>(k - n.least);
    if (made.visible[id]) {
      keep(out, {made.forest.resolution[row].triangles, 1}, made.pixels[row]);
    } else {
      keep(out, {0, 0}, 0.0);
    }
  }
  if (n.children == 0) return out;
  Cuts below{{{0, 0}, 0.0}};
  for (uint32_t c = n.first_child; c < n.first_child + n.children; ++c)
    below = combine(below, enumerate(made, c));
  for (const auto& [cost, error] : below) keep(out, cost, error);
  return out;
}

double best_of(const Cuts& cuts, const Exact::Limits& limits) {
  double best = kNone;
  for (const auto& [cost, error] : cuts) {
    if (cost.first <= limits.triangles && cost.second <= limits.nodes) best = std::min(best, error);
  }
  return best;
}

/// What a cut costs; it covers every root once.
std::pair<std::pair<int64_t, int64_t>, double> cost_of(const Made& made,
                                                       const std::vector<Exact::Choice>& cut) {
  const auto& nodes = made.forest.node;
  std::vector<int> on(nodes.size(), 0);
  std::pair<int64_t, int64_t> cost{0, 0};
  double error = 0.0;
  for (const auto& [id, k] : cut) {
    REQUIRE((k >= nodes[id].least && k <= nodes[id].most));
    ++on[id];
    if (!made.visible[id]) {
      CHECK(k == nodes[id].least);
      continue;
    }
    const size_t row = nodes[id].first_resolution + static_cast<size_t>(k - nodes[id].least);
    cost.first += made.forest.resolution[row].triangles;
    ++cost.second;
    error = std::max(error, made.pixels[row]);
  }
  for (size_t id = 0; id < nodes.size(); ++id) {  // from each leaf up to its root: one node of the cut
    if (nodes[id].children > 0) continue;
    int covered = 0;
    for (auto at = static_cast<int32_t>(id); at >= 0; at = nodes[static_cast<size_t>(at)].parent)
      covered += on[static_cast<size_t>(at)];
    CHECK(covered == 1);
  }
  return {cost, error};
}

}  // namespace

TEST_CASE("the optimum of 1,000 forests is the best of all their cuts") {
  Random random(3);
  int reached = 0, out_of_reach = 0, fronts = 0;
  for (int i = 0; i < 1000; ++i) {
    const Made made(random);
    Cuts all{{{0, 0}, 0.0}};
    for (uint32_t id = 0; id < made.forest.roots; ++id) all = combine(all, enumerate(made, id));
    int64_t most_triangles = 1, most_nodes = 1;
    for (const auto& [cost, error] : all) {
      most_triangles = std::max(most_triangles, cost.first);
      most_nodes = std::max(most_nodes, cost.second);
    }
    Exact exact(made.forest, made.visible, made.pixels);
    for (int budget = 0; budget < 12; ++budget) {
      Exact::Limits limits;
      if (random() % 6) {  // mostly small ones, which cost something
        const double share = uniform(random, 0.0, 1.0);
        limits.triangles = 1 + static_cast<int64_t>(share * share * static_cast<double>(most_triangles));
      }
      if (random() % 4) limits.nodes = 1 + static_cast<int64_t>(random() % static_cast<uint64_t>(most_nodes));
      const double target = random() % 2 ? std::floor(uniform(random, 0.0, 40.0)) : 0.0;
      const double best = best_of(all, limits);
      const auto found = exact.least_error(limits, target);
      REQUIRE(found.has_value() == (best < kNone));
      ++(found ? reached : out_of_reach);
      if (!found) continue;
      CHECK(*found == std::max(best, target));
      const auto [cost, error] = cost_of(made, exact.cut(*found, limits.nodes));
      CHECK(error <= *found);
      CHECK(cost.first <= limits.triangles);
      CHECK(cost.second <= limits.nodes);
      // No cut within the error and the nodes has fewer triangles; the leanest without limit may have more
      // nodes.
      int64_t fewest = std::numeric_limits<int64_t>::max(), leanest = fewest, nodes_of_leanest = 0;
      for (const auto& [other, error_of_other] : all) {
        if (error_of_other > *found) continue;
        if (other.second <= limits.nodes) fewest = std::min(fewest, other.first);
        if (other.first < leanest) leanest = other.first, nodes_of_leanest = other.second;
      }
      CHECK(cost.first == fewest);
      fronts += nodes_of_leanest > limits.nodes;
    }
  }
  MESSAGE(reached << " budgets reached, " << out_of_reach << " out of reach; in " << fronts
                  << " nodes were what was short");
  CHECK(reached > 4000);
  CHECK(out_of_reach > 100);
  CHECK(fronts > 500);
}

TEST_CASE("no queue is better than the optimum, and hard budgets hold") {
  Random random(21);
  auto all = forests();
  all.push_back(fractal_forest(1025, 8, 5, 8));
  for (const auto& forest : all) {
    Adapter adapter(*forest, Projection::kStrict), optimal(*forest, Projection::kStrict);
    std::vector<double> own, drawn;
    for (int i = 0; i < 60; ++i) {
      const View view = random_view(*forest, random);
      Budget budget;
      if (random() % 3) budget.nodes = static_cast<int64_t>(std::exp(uniform(random, 2.0, 7.0)));
      if (random() % 2) budget.triangles = static_cast<int64_t>(std::exp(uniform(random, 5.0, 13.0)));
      if (!budget.triangles) budget.pixel_error = std::exp(uniform(random, -3.0, 4.0));
      Exact exact(*forest, Projection::kStrict, make_camera(view));
      Exact::Limits limits;
      limits.triangles = budget.triangles.value_or(limits.triangles);
      limits.nodes = budget.nodes.value_or(limits.nodes);
      const auto best = exact.least_error(limits);
      const Selected cut = select(optimal, Adapt::kExact, view, budget);
      check_cut(*forest, cut, budget);
      const auto [triangles, nodes] = coarsest(*forest, view);
      if (triangles <= limits.triangles && nodes <= limits.nodes) REQUIRE(best);
      if (!best) {
        check_hard(*forest, cut, budget);
        continue;
      }
      CHECK(cut.triangles <= limits.triangles);
      CHECK(cut.visible_nodes <= limits.nodes);
      CHECK(cut.tau <= std::max(*best, budget.pixel_error.value_or(0.0)) * (1.0 + 1e-9));
      for (const Adapt adapt : {Adapt::kTopDown, Adapt::kDual, Adapt::kQuad}) {
        if ((adapt == Adapt::kQuad) != budget.triangles.has_value()) continue;
        const Selected other = select(adapter, adapt, view, budget);
        const bool kept = other.triangles <= limits.triangles && other.visible_nodes <= limits.nodes;
        if (kept) CHECK(*best <= other.tau);
        if (kept && adapt == Adapt::kQuad && *best > 0.0) {
          own.push_back(other.tau / *best);
          drawn.push_back(cut.predicted_px / *best);
        }
      }
    }
    if (own.empty()) continue;
    MESSAGE(forest->node.size() << " nodes: quad x " << median(own)
                                << " of the optimum; the optimum's cut as drawn x " << median(drawn));
  }
}

TEST_CASE("targets that nodes put out of reach, and views that see nothing") {
  const auto forest = fractal_forest(257, 7, 4, 5);
  const Extent e(*forest);
  View view = flight(*forest, 40);
  Exact exact(*forest, Projection::kStrict, make_camera(view));
  const auto [triangles, nodes] = coarsest(*forest, view);
  const auto least = exact.least_error({.nodes = nodes});
  REQUIRE(least);
  CHECK(*exact.least_error({.nodes = nodes}, 0.5 * *least) == *least);
  CHECK(*exact.least_error({.nodes = nodes}, 2.0 * *least) == 2.0 * *least);
  CHECK(!exact.least_error({.triangles = 1}));
  CHECK(*exact.least_error({}) == 0.0);
  view.eye = {0.5 * e.wide, -0.5 * e.high, 10.0 * e.top};
  view.target = view.eye + glm::dvec3(0.0, 0.0, 1.0);
  view.up = {0.0, 1.0, 0.0};
  Exact nothing(*forest, Projection::kStrict, make_camera(view));
  CHECK(*nothing.least_error({.triangles = 1, .nodes = 1}) == 0.0);
  CHECK(nothing.cut(0.0, 1).size() == forest->roots);
}

TEST_CASE(
    "level: hard budgets hold, a still camera's cut is fixed, and it comes nearer to the optimum than quad") {
  Random random(31);
  auto all = forests();
  all.push_back(fractal_forest(1025, 8, 5, 8));
  int most = 0;
  for (const auto& forest : all) {
    Adapter adapter(*forest, Projection::kStrict);
    for (int i = 0; i < 300; ++i) {
      const View view = random_view(*forest, random);
      Budget budget = budget_of({}, static_cast<int64_t>(std::exp(uniform(random, 0.0, 13.0))), {});
      if (random() % 2) budget.nodes = static_cast<int64_t>(std::exp(uniform(random, 0.0, 7.0)));
      if (random() % 3 == 0) budget.pixel_error = std::exp(uniform(random, -3.0, 4.0));
      Selected last = select(adapter, Adapt::kLevel, view, budget);
      check_hard(*forest, last, budget);
      check_cut(*forest, last, budget);
      if (i % 10) continue;
      int changed = 0;
      for (int frame = 1; frame <= 60 && frame - changed <= 12; ++frame) {
        Selected next = select(adapter, Adapt::kLevel, view, budget);
        check_hard(*forest, next, budget);
        if (!same(last, next)) changed = frame;
        last = std::move(next);
      }
      most = std::max(most, changed + 1);
    }
  }
  MESSAGE("a still camera's cut is fixed after at most " << most << " frames");
  CHECK(most <= 12);
  Adapter level(*all.back(), Projection::kStrict), quad(*all.back(), Projection::kStrict);
  const Budget budget = budget_of({}, 60000, 200);
  std::vector<double> of_level, of_quad;
  for (int i = 0; i < 200; ++i) {
    const View view = flight(*all.back(), i);
    Exact exact(*all.back(), Projection::kStrict, make_camera(view));
    const double best = *exact.least_error({60000, 200});
    const Selected ours = select(level, Adapt::kLevel, view, budget),
                   theirs = select(quad, Adapt::kQuad, view, budget);
    if (best <= 0.0) continue;
    of_level.push_back(ours.predicted_px / best - 1.0);
    of_quad.push_back(theirs.predicted_px / best - 1.0);
  }
  MESSAGE("along a flight, above the optimum: level " << median(of_level) << ", quad " << median(of_quad));
  CHECK(median(of_level) < 0.1);
}
