// SPDX-License-Identifier: MIT
// Adaptation without GL: hard budgets, targets, ends, fixed cuts, and the heap.
#include <doctest/doctest.h>

#include <set>
#include <tuple>

#include "base/errors.h"
#include "multigrain_forests.h"

using namespace lodlab;
using namespace lodlab::multigrain;

TEST_CASE("the heap keeps its order whatever is pushed, changed and erased") {
  Random random(1);
  Heap heap(64);
  std::set<std::tuple<double, double, uint32_t>> model;
  std::vector<Key> keys(64);
  for (int i = 0; i < 20000; ++i) {
    const auto id = static_cast<uint32_t>(random() % 64);
    const auto entry = [&] { return std::tuple{-keys[id].first, -keys[id].second, id}; };
    if (heap.holds(id)) model.erase(entry());
    if (random() % 3 == 0) {
      heap.erase(id);
    } else {
      keys[id] = {static_cast<double>(random() % 5), static_cast<double>(random() % 5)};
      heap.set(id, keys[id]);
      model.insert(entry());
    }
    REQUIRE(heap.size() == model.size());
    if (!model.empty()) REQUIRE(heap.top() == std::get<2>(*model.begin()));
    if (i % 5000 == 4999) {  // filled in bulk
      heap.clear();
      REQUIRE(!heap.holds(id));
      for (const auto& [first, second, other] : model) heap.append(other, {-first, -second});
      heap.order();
    }
  }
}

TEST_CASE("hard budgets hold in every frame of random views, budgets and algorithms") {
  Random random(7);
  int met = 0, frames = 0;
  for (const auto& forest : forests()) {
    Adapter adapter(*forest, Projection::kStrict);
    for (int i = 0; i < 2000; ++i) {
      const View view = random_view(*forest, random);
      Budget budget;
      if (random() % 2) budget.nodes = static_cast<int64_t>(std::exp(uniform(random, 0.0, 7.0)));
      if (random() % 2) budget.pixel_error = std::exp(uniform(random, -3.0, 4.0));
      if (random() % 3 || !(budget.nodes || budget.pixel_error))
        budget.triangles = static_cast<int64_t>(std::exp(uniform(random, 0.0, 13.0)));
      const Adapt adapt = budget.triangles ? Adapt::kQuad : random() % 2 ? Adapt::kDual : Adapt::kTopDown;
      const Selected cut = select(adapter, adapt, view, budget);
      check_hard(*forest, cut, budget);
      if (i % 20 == 0) check_cut(*forest, cut, budget);
      met += cut.budget_met;
      ++frames;
    }
  }
  MESSAGE(met << " of " << frames << " budgets met");
  CHECK(met > frames / 3);
}

TEST_CASE("a pixel error that can be reached is reached, edges included") {
  Random random(8);
  const auto all = forests();
  for (const auto& forest : all) {
    Adapter adapter(*forest, Projection::kStrict);
    const bool whole = forest != all.back();  // that one has a finest_error
    for (int i = 0; i < 150; ++i) {
      const View view = random_view(*forest, random);
      const Budget budget = budget_of(std::exp(uniform(random, -3.0, 4.0)), {}, {});
      for (const Adapt adapt : {Adapt::kTopDown, Adapt::kDual}) {
        const Selected cut = select(adapter, adapt, view, budget);
        check_cut(*forest, cut, budget);
        if (whole) CHECK(cut.budget_met);
        const Projector projector(Projection::kStrict, make_camera(view));
        for (const CutNode& c : cut.nodes) {
          const Node& n = forest->node[c.node];
          const double error = forest->at(n, static_cast<int>(c.resolution)).error;
          if (!c.visible || projector.project(error, projector.place(n.lo, n.hi)) <= *budget.pixel_error)
            continue;
          CHECK(static_cast<int>(c.resolution) == n.most);
          CHECK(error <= 1.5);
        }
      }
    }
  }
}

TEST_CASE("dual: along a path it keeps what top-down keeps, in few steps") {
  auto all = forests();
  all.push_back(fractal_forest(1025, 8, 5, 8));
  for (const auto& forest : all) {
    for (const auto& nodes :
         {std::optional<int64_t>(), std::optional<int64_t>(60), std::optional<int64_t>(300)}) {
      Adapter coherent(*forest, Projection::kStrict), fresh(*forest, Projection::kStrict);
      std::vector<double> steps, from_roots, more_triangles, more_nodes;
      for (int i = 0; i < 120; ++i) {
        const View view = i == 60 ? flight(*forest, 900) : flight(*forest, i);  // one jump, there and back
        const Budget budget = budget_of(2.0, {}, nodes);
        const Selected dual = select(coherent, Adapt::kDual, view, budget);
        const Selected down = select(fresh, Adapt::kTopDown, view, budget);
        check_hard(*forest, dual, budget);
        if (i % 10 == 0) check_cut(*forest, dual, budget);
        if (!nodes) CHECK(dual.budget_met == down.budget_met);
        CHECK(dual.tau <= std::max(2.0, down.tau));
        steps.push_back(static_cast<double>(dual.adapt_steps));
        from_roots.push_back(static_cast<double>(down.adapt_steps));
        more_triangles.push_back(static_cast<double>(dual.triangles) /
                                 static_cast<double>(std::max<int64_t>(1, down.triangles)));
        more_nodes.push_back(static_cast<double>(dual.visible_nodes) /
                             static_cast<double>(std::max<int64_t>(1, down.visible_nodes)));
      }
      MESSAGE(forest->node.size() << " nodes, budget " << nodes.value_or(0) << ": steps " << median(steps)
                                  << " (top-down " << median(from_roots) << "), triangles x "
                                  << median(more_triangles) << ", nodes x " << median(more_nodes));
      CHECK(median(more_triangles) < 1.1);
    }
  }
}

TEST_CASE("a still camera has a fixed cut after the first frames") {
  Random random(10);
  int most = 0;
  std::vector<double> fixed_after;
  for (const auto& forest : forests()) {
    for (const Adapt adapt : {Adapt::kTopDown, Adapt::kDual, Adapt::kQuad}) {
      Adapter adapter(*forest, Projection::kStrict);
      for (int i = 0; i < 60; ++i) {
        const View view = random_view(*forest, random);
        Budget budget;
        if (random() % 2) budget.nodes = static_cast<int64_t>(std::exp(uniform(random, 2.0, 6.0)));
        if (adapt == Adapt::kQuad)
          budget.triangles = static_cast<int64_t>(std::exp(uniform(random, 5.0, 12.0)));
        if (adapt != Adapt::kQuad || random() % 2) budget.pixel_error = std::exp(uniform(random, -2.0, 3.0));
        Selected last = select(adapter, adapt, view, budget);
        int changed = 0;
        for (int frame = 1; frame <= 100; ++frame) {
          Selected next = select(adapter, adapt, view, budget);
          if (!same(last, next)) changed = frame;
          last = std::move(next);
          if (frame - changed > 12) break;
        }
        most = std::max(most, changed + 1);
        fixed_after.push_back(changed + 1);
      }
    }
  }
  MESSAGE("fixed after k frames: median " << median(fixed_after) << ", largest " << most);
  CHECK(median(fixed_after) == 1.0);
  CHECK(most <= 8);
}

TEST_CASE("budgets within one node of a threshold settle, and a budget that grows never costs error") {
  Random random(11);
  for (const auto& forest : forests()) {
    Adapter adapter(*forest, Projection::kStrict);
    for (int i = 0; i < 12; ++i) {
      const View view = random_view(*forest, random);
      const Selected found =
          select(adapter, Adapt::kQuad, view,
                 budget_of({}, static_cast<int64_t>(std::exp(uniform(random, 6.0, 11.0))), 200));
      for (const int64_t around : {-8, -1, 0, 1, 8}) {
        const Budget budget = budget_of({}, std::max<int64_t>(1, found.triangles + around),
                                        std::max<int64_t>(1, found.visible_nodes + around % 2));
        Selected last = select(adapter, Adapt::kQuad, view, budget);
        int changed = 0;
        for (int frame = 1; frame < 20; ++frame) {
          Selected next = select(adapter, Adapt::kQuad, view, budget);
          if (!same(last, next)) changed = frame;
          last = std::move(next);
        }
        CHECK(changed <= 3);
      }
    }
  }
}

TEST_CASE("reset forgets; without it the way to a view may change its error, by no more than this") {
  Random random(12);
  double worst = 1.0;
  std::vector<double> spread;
  for (const auto& forest : forests()) {
    for (int i = 0; i < 8; ++i) {
      const View view = random_view(*forest, random);
      const Budget budget = budget_of({}, static_cast<int64_t>(std::exp(uniform(random, 6.0, 11.0))), 150);
      Adapter fresh(*forest, Projection::kStrict), used(*forest, Projection::kStrict);
      const Selected wanted = select(fresh, Adapt::kQuad, view, budget);
      double low = wanted.tau, high = wanted.tau;
      for (int path = 0; path < 20; ++path) {
        for (int k = 0; k < 3; ++k) select(used, Adapt::kQuad, random_view(*forest, random), budget);
        const Selected reached = select(used, Adapt::kQuad, view, budget);
        low = std::min(low, reached.tau);
        high = std::max(high, reached.tau);
        used.reset();
        CHECK(same(select(used, Adapt::kQuad, view, budget), wanted));
      }
      if (low <= 0.0) continue;
      spread.push_back(high / low);
      worst = std::max(worst, high / low);
    }
  }
  MESSAGE("largest error by 20 ways to a view: x " << median(spread) << " in the median, x " << worst
                                                   << " at most");
  CHECK(median(spread) < 1.5);
}

TEST_CASE("an algorithm that does not serve the budget says so; auto serves all") {
  const auto forest = random_forest(200, 200, 6, 3, 6, 5);
  Adapter adapter(*forest, Projection::kStrict);
  const View view = flight(*forest, 0);
  for (const Adapt adapt : {Adapt::kTopDown, Adapt::kDual}) {
    CHECK_THROWS_WITH_AS(select(adapter, adapt, view, budget_of(1.0, 1000, {})),
                         doctest::Contains("triangles"), Unsupported);
  }
  CHECK_THROWS_WITH_AS(select(adapter, Adapt::kQuad, view, budget_of(1.0, {}, 10)),
                       doctest::Contains("triangles"), Unsupported);
  for (const Budget& budget :
       {budget_of(1.0, {}, {}), budget_of({}, 1000, {}), budget_of({}, {}, 20), budget_of(1.0, 1000, 20),
        budget_of(std::numeric_limits<double>::infinity(), {}, {}),
        budget_of(1e-300, std::numeric_limits<int64_t>::max(), 1)}) {
    const Selected cut = select(adapter, Adapt::kAuto, view, budget);
    check_cut(*forest, cut, budget);
    check_hard(*forest, cut, budget);
  }
}

TEST_CASE("eyes anywhere, in boxes and on their corners: errors nest, and are numbers") {
  const auto forest = random_forest(513, 769, 8, 5, 8, 1);
  Random random(14);
  for (int i = 0; i < 100000; ++i) {
    const auto id = static_cast<uint32_t>(forest->roots + random() % (forest->node.size() - forest->roots));
    const Node& n = forest->node[id];
    const Node& parent = forest->node[static_cast<size_t>(n.parent)];
    View view;
    for (int axis = 0; axis < 3; ++axis) {
      const double at[] = {n.lo[axis], n.hi[axis], 0.5 * (n.lo[axis] + n.hi[axis]),
                           uniform(random, n.lo[axis] - 5.0, n.hi[axis] + 5.0)};
      view.eye[axis] = at[random() % 4];
    }
    view.target = view.eye + glm::dvec3(uniform(random, -1.0, 1.0), uniform(random, -1.0, 1.0), -0.5);
    const Camera camera = make_camera(view);
    for (const Projection kind : {Projection::kStrict, Projection::kVertical}) {
      const Projector projector(kind, camera);
      const double own = projector.project(forest->at(n, n.most).error, projector.place(n.lo, n.hi));
      const double coarse = projector.project(forest->at(n, n.least).error, projector.place(n.lo, n.hi));
      const double above =
          projector.project(forest->at(parent, parent.least).error, projector.place(parent.lo, parent.hi));
      if (!(own <= coarse && std::isfinite(coarse) && coarse <= above * (1.0 + 1e-12))) {
        CAPTURE(id);
        CHECK(own <= coarse);
        CHECK(coarse <= above);
      }
    }
  }
}
