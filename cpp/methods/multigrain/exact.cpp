// SPDX-License-Identifier: MIT
// Fronts: for each number of nodes the fewest triangles of a subtree, all errors within the one that is
// tried. A node's front is the sum of its children's, (min, +), with the node itself beside it. A subtree
// whose leanest and sparsest cuts are equal has one point; points that leave too little to the rest of the
// forest are dropped. A front has at most as many points as the subtree has leaves, or as there may be nodes,
// so that all of them together have at most leaves x (2 levels + log2 roots), and take that many x nodes
// sums.
#include "methods/multigrain/exact.h"

#include <algorithm>
#include <tuple>

namespace lodlab::multigrain {
namespace {

constexpr int64_t kNever = int64_t{1} << 60;  // what no cut reaches; four of them are no overflow

}  // namespace

Exact::Exact(const Forest& forest, Projection projection, const Camera& camera)
    : forest_(forest), visible_(forest.node.size(), 0), pixels_(forest.resolution.size(), 0.0) {
  const Projector projector(projection, camera);
  const Horizon horizon = forest.horizon(camera);
  for (size_t id = 0; id < forest.node.size(); ++id) {
    const Node& n = forest.node[id];
    if (n.parent >= 0 && !visible_[static_cast<size_t>(n.parent)]) continue;  // boxes and cones nest
    visible_[id] = camera.sees({{n.lo[0], n.lo[1], n.lo[2]}, {n.hi[0], n.hi[1], n.hi[2]}}) &&
                   !(forest.occluder.radius > 0.0 && horizon.hides(forest.occluder.nodes[id]));
    if (!visible_[id]) continue;
    const Projector::Place place = projector.place(n.lo, n.hi);
    for (int k = n.least; k <= n.most; ++k) {
      pixels_[n.first_resolution + static_cast<size_t>(k - n.least)] =
          projector.project(forest.at(n, k).error, place);
    }
  }
  list_seen();
}

Exact::Exact(const Forest& forest, std::vector<uint8_t> visible, std::vector<double> pixels)
    : forest_(forest), visible_(std::move(visible)), pixels_(std::move(pixels)) {
  list_seen();
}

void Exact::list_seen() {
  costs_.resize(forest_.node.size());
  for (uint32_t id = 0; id < forest_.node.size(); ++id) {
    if (visible_[id]) seen_.push_back(id);
    if (visible_[id] && id < forest_.roots) seen_roots_.push_back(id);
  }
}

std::optional<double> Exact::least_error(const Limits& limits, double target) {
  tried_ = 0;
  if (reaches(target, limits)) return target;
  std::vector<double> errors;
  for (const uint32_t id : seen_) {
    const Node& n = forest_.node[id];
    const auto row = pixels_.begin() + n.first_resolution;
    std::copy_if(row, row + n.most - n.least + 1, std::back_inserter(errors),
                 [&](double pixels) { return pixels > target; });
  }
  std::sort(errors.begin(), errors.end());
  errors.erase(std::unique(errors.begin(), errors.end()), errors.end());
  const auto least = std::partition_point(errors.begin(), errors.end(),
                                          [&](double error) { return !reaches(error, limits); });
  if (least == errors.end()) return std::nullopt;
  return *least;
}

/// The resolution within the error that has the fewest triangles, the finest of them; -1: none.
int Exact::cheapest(const Node& n, double error) const {
  int best = -1;
  for (int k = n.least; k <= n.most; ++k) {
    if (pixels_[n.first_resolution + static_cast<size_t>(k - n.least)] > error) continue;
    if (best < 0 || forest_.at(n, k).triangles <= forest_.at(n, best).triangles) best = k;
  }
  return best;
}

/// The leanest and the sparsest cut of every subtree: linear in the nodes that are seen.
void Exact::weigh(double error) {
  const auto add = [](Cost& sum, const Cost& cost) {
    sum.triangles = std::min(sum.triangles + cost.triangles, kNever);
    sum.nodes = std::min(sum.nodes + cost.nodes, kNever);
  };
  for (auto at = seen_.rbegin(); at != seen_.rend(); ++at) {
    const Node& n = forest_.node[*at];
    Costs& costs = costs_[*at];
    const int k = cheapest(n, error);
    costs.own = k < 0 ? Cost{kNever, kNever} : Cost{forest_.at(n, k).triangles, 1};
    costs.lean = costs.sparse = costs.own;
    if (n.children == 0) continue;
    Cost lean, sparse;
    for (uint32_t c = n.first_child; c < n.first_child + n.children; ++c) {
      add(lean, costs_[c].lean);
      add(sparse, costs_[c].sparse);
    }
    if (std::tie(lean.triangles, lean.nodes) < std::tie(costs.lean.triangles, costs.lean.nodes))
      costs.lean = lean;
    if (std::tie(sparse.nodes, sparse.triangles) < std::tie(costs.sparse.nodes, costs.sparse.triangles))
      costs.sparse = sparse;
  }
  lean_ = sparse_ = Cost{};
  for (const uint32_t id : seen_roots_) {
    add(lean_, costs_[id].lean);
    add(sparse_, costs_[id].sparse);
  }
}

/// Whether a cut within the error keeps the limits. Mostly the leanest or the sparsest cut tells.
bool Exact::reaches(double error, const Limits& limits) {
  ++tried_;
  weigh(error);
  if (lean_.triangles >= kNever || lean_.triangles > limits.triangles || sparse_.nodes > limits.nodes)
    return false;
  if (lean_.nodes <= limits.nodes || sparse_.triangles <= limits.triangles) return true;
  entries_.clear();
  const Range front = front_of_all(seen_roots_.data(), seen_roots_.data() + seen_roots_.size(), limits);
  return front.begin < front.end;
}

/// `room`: what the rest of the forest leaves to this subtree at most.
Exact::Range Exact::front_of(uint32_t id, const Limits& room) {
  const Costs& costs = costs_[id];
  if (costs.lean.nodes == costs.sparse.nodes) {
    entries_.push_back({costs.lean.triangles, costs.lean.nodes, kLean, id});
    return {entries_.size() - 1, entries_.size()};
  }
  const Node& n = forest_.node[id];
  uint32_t children[4];
  size_t count = 0;
  for (uint32_t c = n.first_child; c < n.first_child + n.children; ++c) {
    if (visible_[c]) children[count++] = c;
  }
  const Range front = front_of_all(children, children + count, room);
  return costs.own.triangles <= room.triangles && room.nodes >= 1 ? insert_own(front, id) : front;
}

Exact::Range Exact::front_of_all(const uint32_t* first, const uint32_t* last, const Limits& room) {
  if (first == last) {
    entries_.push_back({0, 0, kNothing, 0});
    return {entries_.size() - 1, entries_.size()};
  }
  if (last - first == 1) return front_of(*first, room);
  const uint32_t* const middle = first + (last - first) / 2;
  const auto left_by = [&](const uint32_t* from, const uint32_t* to) {
    Limits left = room;
    for (; from != to; ++from) {
      left.triangles -= costs_[*from].lean.triangles;
      left.nodes -= costs_[*from].sparse.nodes;
    }
    return left;
  };
  const Range a = front_of_all(first, middle, left_by(middle, last));
  const Range b = front_of_all(middle, last, left_by(first, middle));
  return sum(a, b, room);
}

Exact::Range Exact::sum(const Range& a, const Range& b, const Limits& room) {
  const size_t begin = entries_.size();
  if (a.begin == a.end || b.begin == b.end) return {begin, begin};
  const int64_t least = entries_[a.begin].nodes + entries_[b.begin].nodes;
  const int64_t most = std::min(entries_[a.end - 1].nodes + entries_[b.end - 1].nodes, room.nodes);
  if (most < least) return {begin, begin};
  sums_.assign(static_cast<size_t>(most - least + 1), {kNever, 0, 0, 0});
  for (size_t i = a.begin; i < a.end; ++i) {
    for (size_t j = b.begin; j < b.end; ++j) {
      const int64_t nodes = entries_[i].nodes + entries_[j].nodes;
      if (nodes > most) break;
      const int64_t triangles = entries_[i].triangles + entries_[j].triangles;
      Entry& best = sums_[static_cast<size_t>(nodes - least)];
      if (triangles < best.triangles)
        best = {triangles, nodes, static_cast<uint32_t>(i), static_cast<uint32_t>(j)};
    }
  }
  int64_t fewest = kNever;
  for (const Entry& entry : sums_) {
    if (entry.triangles >= fewest) continue;
    fewest = entry.triangles;
    if (fewest <= room.triangles) entries_.push_back(entry);
  }
  return {begin, entries_.size()};
}

/// The front is the last one; the node itself takes the place of points that are no better.
Exact::Range Exact::insert_own(Range front, uint32_t id) {
  const Cost own = costs_[id].own;
  const auto begin = entries_.begin() + static_cast<std::ptrdiff_t>(front.begin);
  auto from = std::find_if(begin, entries_.end(), [](const Entry& e) { return e.nodes > 1; });
  if (from != begin && (from - 1)->triangles <= own.triangles) return front;
  if (from != begin && (from - 1)->nodes == 1) --from;
  const auto to =
      std::find_if(from, entries_.end(), [&](const Entry& e) { return e.triangles < own.triangles; });
  entries_.insert(entries_.erase(from, to), {own.triangles, 1, kOwn, id});
  return {front.begin, entries_.size()};
}

std::vector<Exact::Choice> Exact::cut(double error, int64_t nodes) {
  weigh(error);
  entries_.clear();
  std::vector<int8_t> k(forest_.node.size(), -1);  // of visible nodes on the cut
  if (lean_.nodes <= nodes) {
    for (const uint32_t id : seen_roots_) choose_lean(id, error, k);
  } else {
    const Limits limits{sparse_.triangles, nodes};
    const Range front = front_of_all(seen_roots_.data(), seen_roots_.data() + seen_roots_.size(), limits);
    choose(entries_[front.end - 1], error, k);
  }
  std::vector<Choice> out;
  for (uint32_t id = 0; id < forest_.roots; ++id) list(id, k, out);
  return out;
}

void Exact::choose(const Entry& entry, double error, std::vector<int8_t>& k) const {
  if (entry.left == kNothing) return;
  if (entry.left == kOwn) {
    k[entry.right] = static_cast<int8_t>(cheapest(forest_.node[entry.right], error));
  } else if (entry.left == kLean) {
    choose_lean(entry.right, error, k);
  } else {
    choose(entries_[entry.left], error, k);
    choose(entries_[entry.right], error, k);
  }
}

void Exact::choose_lean(uint32_t id, double error, std::vector<int8_t>& k) const {
  const Costs& costs = costs_[id];
  const Node& n = forest_.node[id];
  if (costs.lean.triangles == costs.own.triangles && costs.lean.nodes == costs.own.nodes) {
    k[id] = static_cast<int8_t>(cheapest(n, error));
    return;
  }
  for (uint32_t c = n.first_child; c < n.first_child + n.children; ++c) {
    if (visible_[c]) choose_lean(c, error, k);
  }
}

/// What of a subtree is on the cut.
void Exact::list(uint32_t id, const std::vector<int8_t>& k, std::vector<Choice>& out) const {
  const Node& n = forest_.node[id];
  if (!visible_[id]) {
    out.push_back({id, n.least});
  } else if (k[id] >= 0) {
    out.push_back({id, k[id]});
  } else {
    for (uint32_t c = n.first_child; c < n.first_child + n.children; ++c) list(c, k, out);
  }
}

}  // namespace lodlab::multigrain
