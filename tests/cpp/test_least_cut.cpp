// SPDX-License-Identifier: MIT
// The cheapest cut of a tree, against all cuts of random ones, under limits of triangles, of nodes, of both.
#include "method/least_cut.h"

#include <doctest/doctest.h>

#include <algorithm>
#include <random>
#include <tuple>

using namespace lodlab;

namespace {

using Items = std::vector<LeastCut::Item>;
using Cost = LeastCut::Cost;

/// Breadth first. Children of nodes that are culled leave holes in the numbers.
Items random_tree(std::mt19937& random) {
  const auto any = [&](int64_t count) {
    return static_cast<int64_t>(random() % static_cast<uint64_t>(count));
  };
  Items items;
  uint32_t number = 0;
  const auto add = [&](int32_t parent) {
    items.push_back({number, parent, 1 + any(9), any(4) > 0});
    number += 1 + static_cast<uint32_t>(any(2));
  };
  for (int64_t roots = 1 + any(3); roots-- > 0;) add(-1);
  for (size_t i = 0; i < items.size() && items.size() < 14; ++i) {
    for (int64_t children = any(4); children-- > 0;) add(static_cast<int32_t>(i));
  }
  return items;
}

/// Costs of all cuts of all trees below these roots.
std::vector<Cost> all_cuts(const Items& items, int32_t parent) {
  std::vector<Cost> sums{{0, 0}};
  for (size_t i = 0; i < items.size(); ++i) {
    if (items[i].parent != parent) continue;
    std::vector<Cost> own{{items[i].triangles, 1}};
    if (items[i].splits) {
      for (const Cost& below : all_cuts(items, static_cast<int32_t>(i))) own.push_back(below);
    }
    std::vector<Cost> more;
    for (const Cost& a : sums) {
      for (const Cost& b : own) more.push_back({a.triangles + b.triangles, a.nodes + b.nodes});
    }
    sums = std::move(more);
  }
  return sums;
}

/// What the nodes that are split leave on the cut. Only items that may be split are, and below split ones.
Cost drawn(const Items& items, const std::vector<uint32_t>& split) {
  Cost cost;
  std::vector<bool> parted(items.size());
  for (size_t i = 0; i < items.size(); ++i) {
    const bool reached = items[i].parent < 0 || parted[static_cast<size_t>(items[i].parent)];
    parted[i] = std::binary_search(split.begin(), split.end(), items[i].node);
    CHECK((!parted[i] || (reached && items[i].splits)));
    if (reached && !parted[i]) cost = {cost.triangles + items[i].triangles, cost.nodes + 1};
  }
  return cost;
}

}  // namespace

TEST_CASE("a cut that keeps the limits is found where there is one, and else the cheapest") {
  std::mt19937 random(1);
  int fronts = 0, missed = 0;
  for (int round = 0; round < 3000; ++round) {
    const Items items = random_tree(random);
    const std::vector<Cost> cuts = all_cuts(items, -1);
    const Cost some = cuts[random() % cuts.size()];
    const int64_t less = static_cast<int64_t>(random() % 3), none = LeastCut::kNone;
    for (const LeastCut::Limits limits :
         {LeastCut::Limits{some.triangles - less, none}, LeastCut::Limits{none, some.nodes - less},
          LeastCut::Limits{some.triangles, some.nodes},
          LeastCut::Limits{some.triangles - less, some.nodes}}) {
      const LeastCut found(items, limits);
      CHECK(std::is_sorted(found.split().begin(), found.split().end()));
      const Cost cost = drawn(items, found.split());
      CHECK(cost.triangles == found.cost().triangles);
      CHECK(cost.nodes == found.cost().nodes);
      const bool possible =
          std::any_of(cuts.begin(), cuts.end(), [&](const Cost& c) { return limits.keep(c); });
      CHECK(limits.keep(cost) == possible);
      if (possible) {
        fronts += limits.triangles != none && limits.nodes != none;
        continue;
      }
      ++missed;
      const auto order = [&](const Cost& c) {
        const int64_t nodes = limits.nodes == none ? 0 : std::max(c.nodes, limits.nodes);
        return limits.triangles == none ? std::tuple(c.nodes, c.triangles) : std::tuple(nodes, c.triangles);
      };
      for (const Cost& other : cuts) CHECK(order(other) >= order(cost));
    }
  }
  CHECK(fronts > 1000);
  CHECK(missed > 1000);
}
