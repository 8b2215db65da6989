// SPDX-License-Identifier: MIT
#include "method/least_cut.h"

#include <algorithm>
#include <tuple>

namespace lodlab {
namespace {

constexpr uint32_t kOwn = 0xffffffffu;   // the item itself
constexpr uint32_t kLean = 0xfffffffeu;  // the leanest cut of the item's subtree, which is the sparsest, too
constexpr uint32_t kNothing = 0xfffffffdu;

using Cost = LeastCut::Cost;

bool leaner(const Cost& a, const Cost& b) {
  return std::tie(a.triangles, a.nodes) < std::tie(b.triangles, b.nodes);
}
bool sparser(const Cost& a, const Cost& b) {
  return std::tie(a.nodes, a.triangles) < std::tie(b.nodes, b.triangles);
}
Cost operator+(const Cost& a, const Cost& b) { return {a.triangles + b.triangles, a.nodes + b.nodes}; }

}  // namespace

LeastCut::LeastCut(std::vector<Item> items, const Limits& limits)
    : items_(std::move(items)), costs_(items_.size()) {
  weigh();
  const bool triangles = limits.triangles != kNone;
  if (triangles && limits.keep(all_.lean)) {
    take(true);
  } else if (limits.keep(all_.sparse) || all_.sparse.nodes >= limits.nodes) {
    take(false);
  } else if (all_.lean.nodes <= limits.nodes) {
    take(true);
  } else {
    take_front(limits);
  }
}

/// Bottom-up: children's sums are whole when their parent comes.
void LeastCut::weigh() {
  for (size_t i = items_.size(); i-- > 0;) {
    const Item& item = items_[i];
    Costs& costs = costs_[i];
    const Cost own{item.triangles, 1};
    costs.lean_splits = item.splits && leaner(costs.lean, own);
    costs.sparse_splits = item.splits && sparser(costs.sparse, own);
    if (!costs.lean_splits) costs.lean = own;
    if (!costs.sparse_splits) costs.sparse = own;
    Costs& above = item.parent < 0 ? all_ : costs_[static_cast<size_t>(item.parent)];
    above.lean = above.lean + costs.lean;
    above.sparse = above.sparse + costs.sparse;
  }
}

void LeastCut::take(bool lean) {
  cost_ = lean ? all_.lean : all_.sparse;
  std::vector<uint8_t> split(items_.size(), 0);
  for (size_t i = 0; i < items_.size(); ++i) {
    const int32_t parent = items_[i].parent;
    if (parent >= 0 && !split[static_cast<size_t>(parent)]) continue;
    split[i] = lean ? costs_[i].lean_splits : costs_[i].sparse_splits;
    if (split[i]) split_.push_back(items_[i].node);
  }
}

uint32_t LeastCut::add(const Cost& cost, uint32_t left, uint32_t right) {
  points_.push_back({cost, left, right});
  return static_cast<uint32_t>(points_.size() - 1);
}

LeastCut::Front LeastCut::best(Front points) const {
  std::sort(points.begin(), points.end(),
            [this](uint32_t a, uint32_t b) { return sparser(points_[a].cost, points_[b].cost); });
  Front out;
  for (const uint32_t point : points) {
    if (out.empty() || points_[point].cost.triangles < points_[out.back()].cost.triangles)
      out.push_back(point);
  }
  return out;
}

/// Every pair of points within the nodes.
LeastCut::Front LeastCut::sum(const Front& a, const Front& b, const Limits& limits) {
  Front points;
  const size_t first = points_.size();
  for (const uint32_t left : a) {
    for (const uint32_t right : b) {
      const Cost cost = points_[left].cost + points_[right].cost;
      if (cost.nodes > limits.nodes) break;
      points.push_back(add(cost, left, right));
    }
  }
  Front kept = best(std::move(points));
  std::vector<Point> stay;
  for (uint32_t& point : kept) {
    stay.push_back(points_[point]);
    point = static_cast<uint32_t>(first + stay.size() - 1);
  }
  points_.resize(first);
  points_.insert(points_.end(), stay.begin(), stay.end());
  return kept;
}

/// Only subtrees whose leanest and sparsest cuts differ have more than a point.
void LeastCut::take_front(const Limits& limits) {
  const Front nothing{add({}, kNothing, 0)};
  std::vector<Front> fronts(items_.size(), nothing);
  Front all = nothing;
  for (size_t i = items_.size(); i-- > 0;) {
    const Item& item = items_[i];
    const Costs& costs = costs_[i];
    const auto at = static_cast<uint32_t>(i);
    Front front;
    if (costs.lean.nodes == costs.sparse.nodes) {
      front = {add(costs.lean, kLean, at)};
    } else {
      front = std::move(fronts[i]);
      front.push_back(add({item.triangles, 1}, kOwn, at));
      front = best(std::move(front));
    }
    Front().swap(fronts[i]);
    Front& above = item.parent < 0 ? all : fronts[static_cast<size_t>(item.parent)];
    above = sum(above, front, limits);
  }
  // The last point has the fewest triangles. What is drawn is split above.
  cost_ = points_[all.back()].cost;
  std::vector<uint8_t> ends(items_.size(), 0);  // 1: the item itself, 2: its leanest cut
  std::vector<uint32_t> rest{all.back()};
  while (!rest.empty()) {
    const Point point = points_[rest.back()];
    rest.pop_back();
    if (point.left == kNothing) continue;
    if (point.left == kOwn || point.left == kLean) {
      ends[point.right] = point.left == kOwn ? 1 : 2;
    } else {
      rest.push_back(point.left);
      rest.push_back(point.right);
    }
  }
  enum : uint8_t {
    kUnder,
    kFree,
    kLeanest
  };  // on or below the cut; above it; within a leanest cut's subtree
  std::vector<uint8_t> state(items_.size(), kUnder);
  for (size_t i = 0; i < items_.size(); ++i) {
    const int32_t parent = items_[i].parent;
    const uint8_t above = parent < 0 ? uint8_t{kFree} : state[static_cast<size_t>(parent)];
    if (above == kUnder || ends[i] == 1) continue;
    const bool leanest = above == kLeanest || ends[i] == 2;
    if (leanest && !costs_[i].lean_splits) continue;
    state[i] = leanest ? kLeanest : kFree;
    split_.push_back(items_[i].node);
  }
}

}  // namespace lodlab
