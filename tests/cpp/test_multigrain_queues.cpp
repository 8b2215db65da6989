// SPDX-License-Identifier: MIT
// How good the queues' cuts are, how steady and how fast: against plain greedy cuts, and against the optimum
// for nodes without limit, which is a lower bound for any number of them.
#include <doctest/doctest.h>

#include <ctime>
#include <set>
#include <string>

#include "multigrain_forests.h"

using namespace lodlab;
using namespace lodlab::multigrain;

namespace {

/// The hierarchy's nodes under one view: what the rulers below look at.
struct Ruler {
  const Forest& forest;
  Camera camera;
  Projector projector;
  std::vector<Projector::Place> place;
  std::vector<uint8_t> visible;

  Ruler(const Forest& f, const View& view)
      : forest(f), camera(make_camera(view)), projector(Projection::kStrict, camera) {
    for (const Node& n : f.node) {
      place.push_back(projector.place(n.lo, n.hi));
      visible.push_back(camera.sees({{n.lo[0], n.lo[1], n.lo[2]}, {n.hi[0], n.hi[1], n.hi[2]}}));
    }
  }
  double rho(uint32_t id, int k) const {
    return visible[id] ? projector.project(forest.at(forest.node[id], k).error, place[id]) : 0.0;
  }
  int64_t triangles(uint32_t id, int k) const {
    return visible[id] ? forest.at(forest.node[id], k).triangles : 0;
  }
  /// Fewest triangles with own errors within so many pixels, nodes without limit.
  int64_t fewest(uint32_t id, double pixels) const {
    const Node& n = forest.node[id];
    if (!visible[id]) return 0;
    int64_t best = int64_t{1} << 40;
    for (int k = n.most; k >= n.least && rho(id, k) <= pixels; --k) best = triangles(id, k);
    if (n.children == 0) return best;
    int64_t sum = 0;
    for (uint32_t c = n.first_child; c < n.first_child + n.children; ++c) sum += fewest(c, pixels);
    return std::min(best, sum);
  }
  /// The smallest largest error that so many triangles reach, nodes without limit, to a part in 200.
  double optimum(int64_t budget) const {
    double low = 1e-4, high = 1e7;
    while (high > 1.005 * low) {
      const double middle = std::sqrt(low * high);
      int64_t sum = 0;
      for (uint32_t i = 0; i < forest.roots; ++i) sum += fewest(i, middle);
      (sum <= budget ? high : low) = middle;
    }
    return high;
  }
  /// Refines the largest error until the triangles are spent: roots alone.
  double greedy_roots(int64_t budget) const {
    std::vector<int> k;
    int64_t spent = 0;
    for (uint32_t i = 0; i < forest.roots; ++i) {
      k.push_back(forest.node[i].least);
      spent += triangles(i, k.back());
    }
    for (;;) {
      uint32_t worst = 0;
      for (uint32_t i = 1; i < forest.roots; ++i) {
        if (rho(i, k[i]) > rho(worst, k[worst])) worst = i;
      }
      const double error = rho(worst, k[worst]);
      if (k[worst] == forest.node[worst].most) return error;
      spent += triangles(worst, k[worst] + 1) - triangles(worst, k[worst]);
      if (spent > budget) return error;
      ++k[worst];
    }
  }
  /// Splits the largest error until triangles or nodes are spent: one resolution a level, as `per_side`
  /// cells.
  double greedy_levels(int64_t budget, int64_t nodes, int per_side) const {
    const auto k_of = [&](uint32_t id) {
      return std::clamp<int>(per_side, forest.node[id].least, forest.node[id].most);
    };
    std::multiset<std::pair<double, uint32_t>> cut;
    int64_t spent = 0, count = 0;
    for (uint32_t i = 0; i < forest.roots; ++i) {
      cut.insert({rho(i, k_of(i)), i});
      spent += triangles(i, k_of(i));
      count += visible[i];
    }
    for (;;) {
      const auto worst = std::prev(cut.end());
      const Node& n = forest.node[worst->second];
      if (n.children == 0) return worst->first;
      spent -= triangles(worst->second, k_of(worst->second));
      --count;
      for (uint32_t c = n.first_child; c < n.first_child + n.children; ++c) {
        spent += triangles(c, k_of(c));
        count += visible[c];
      }
      if (spent > budget || count > nodes) return worst->first;
      cut.erase(worst);
      for (uint32_t c = n.first_child; c < n.first_child + n.children; ++c) cut.insert({rho(c, k_of(c)), c});
    }
  }
};

}  // namespace

TEST_CASE("quad: the largest error against greedy cuts and the optimum") {
  auto all = forests();
  all.push_back(fractal_forest(1025, 8, 5, 8));
  Random random(9);
  for (const auto& forest : all) {
    std::vector<double> of_roots, of_levels, gap, steps, limited;
    for (int i = 0; i < 40; ++i) {
      const View view = random_view(*forest, random);
      const Ruler ruler(*forest, view);
      const auto [least, nodes] = coarsest(*forest, view);
      if (nodes == 0) continue;
      const auto budget =
          std::max<int64_t>(least, static_cast<int64_t>(std::exp(uniform(random, 6.0, 12.0))));
      Adapter adapter(*forest, Projection::kStrict);
      const Selected free = select(adapter, Adapt::kQuad, view, budget_of({}, budget, {}));
      adapter.reset();
      const int64_t most_nodes = std::max<int64_t>(nodes, 100);
      const Selected cut = select(adapter, Adapt::kQuad, view, budget_of({}, budget, most_nodes));
      const double roots = ruler.greedy_roots(budget);
      double levels = std::numeric_limits<double>::infinity();
      for (int k = 3; k <= 5; ++k) levels = std::min(levels, ruler.greedy_levels(budget, most_nodes, k));
      CHECK(cut.tau <= roots * (1.0 + 1e-9));
      steps.push_back(static_cast<double>(cut.adapt_steps));
      if (roots <= 0.0 || free.tau <= 0.0 || levels <= 0.0) continue;
      of_roots.push_back(cut.tau / roots);
      of_levels.push_back(cut.tau / levels);
      gap.push_back(free.tau / ruler.optimum(budget));
      limited.push_back(cut.tau / ruler.optimum(budget));
    }
    if (of_roots.empty()) continue;  // one level
    MESSAGE(forest->node.size() << " nodes: error x " << median(of_roots) << " of greedy on roots, x "
                                << median(of_levels) << " of one resolution a level, x " << median(gap)
                                << " of the optimum (nodes without limit), x " << median(limited)
                                << " of it with 100 nodes; steps " << median(steps));
    CHECK(*std::max_element(of_roots.begin(), of_roots.end()) <= 1.0 + 1e-9);
    CHECK(median(of_levels) <= 1.0);
  }
}

/// Processor time of this thread: the machine may be busy.
static double processor_us() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e6 * static_cast<double>(now.tv_sec) + 1e-3 * static_cast<double>(now.tv_nsec);
}

/// Microseconds of select() along a flight, warm; printed, not asserted.
TEST_CASE("select at 400 nodes and 2 M triangles, timed") {
  for (const auto& forest : {random_forest(4097, 4097, 10, 6, 8, 6), fractal_forest(2049, 9, 6, 8)}) {
    struct Case {
      std::string name;
      Adapt adapt;
      Budget budget;
    };
    const Case cases[] = {{"topdown", Adapt::kTopDown, budget_of(1.0, {}, 400)},
                          {"dual", Adapt::kDual, budget_of(1.0, {}, 400)},
                          {"quad", Adapt::kQuad, budget_of({}, 2000000, 400)},
                          {"quad, small", Adapt::kQuad, budget_of({}, 100000, 400)}};
    for (const Case& c : cases) {
      Adapter adapter(*forest, Projection::kStrict);
      std::vector<double> us, steps, on_cut, visible, triangles;
      for (int i = 0; i < 600; ++i) {
        const View view = flight(*forest, i);
        Selected cut;
        const double start = processor_us();
        const Camera camera = make_camera(view);
        adapter.select(c.adapt, camera, c.budget, cut);
        if (i < 20) continue;
        us.push_back(processor_us() - start);
        steps.push_back(static_cast<double>(cut.adapt_steps));
        on_cut.push_back(static_cast<double>(cut.nodes.size()));
        visible.push_back(static_cast<double>(cut.visible_nodes));
        triangles.push_back(static_cast<double>(cut.triangles));
      }
      std::sort(us.begin(), us.end());
      std::sort(steps.begin(), steps.end());
      MESSAGE(c.name << ": median " << median(us) << " us, p99 " << us[us.size() * 99 / 100] << " us; steps "
                     << median(steps) << ", p99 " << steps[steps.size() * 99 / 100] << "; " << median(visible)
                     << " nodes of " << median(on_cut) << ", " << median(triangles) << " triangles");
      CHECK(median(visible) > 0.0);
    }
  }
}

TEST_CASE("a view forward, back, forward, and one that trembles: what changes and changes back") {
  const auto forest = fractal_forest(1025, 8, 5, 8);
  for (const Adapt adapt : {Adapt::kTopDown, Adapt::kDual, Adapt::kQuad}) {
    Adapter adapter(*forest, Projection::kStrict);
    const Budget budget = adapt == Adapt::kQuad ? budget_of({}, 100000, 200) : budget_of(2.0, {}, 200);
    Random random(13);
    int changes = 0;
    Selected last;
    for (int i = 0; i < 300; ++i) {
      View view = flight(*forest, 40);  // trembles by about a pixel
      view.target += glm::dvec3(uniform(random, -1.0, 1.0), uniform(random, -1.0, 1.0), 0.0) * 20.0;
      Selected next = select(adapter, adapt, view, budget);
      if (i > 0) {
        for (const CutNode& c : next.nodes) {
          const auto old = std::lower_bound(last.nodes.begin(), last.nodes.end(), c.node,
                                            [](const CutNode& n, uint32_t id) { return n.node < id; });
          changes += c.visible &&
                     (old == last.nodes.end() || old->node != c.node || old->resolution != c.resolution);
        }
      }
      last = std::move(next);
    }
    MESSAGE(static_cast<int>(adapt) << ": " << changes / 299.0 << " of " << last.visible_nodes
                                    << " nodes change a frame under a trembling view");
    CHECK(changes / 299.0 < 0.5 * static_cast<double>(last.visible_nodes));
  }
}
