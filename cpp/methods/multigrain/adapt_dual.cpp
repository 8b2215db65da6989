// SPDX-License-Identifier: MIT
// Splits against merges: mode 1 from the last frame's cut, and the second phase of the quad-queue.
//
// Every node has a threshold in pixels: the target, or, in the quad-queue, its own error as it is. A split
// gives children their first resolution within it, a merge the parent its first within the largest of its
// children's. The split queue holds what a split saves in triangles, the merge queue what a merge costs.
// A node is pressed when its error is above what is wanted and only a split can lower it: pressed nodes are
// split first, the worst first, whatever it costs.
//
// trade() ends: what it has split it does not merge again, so that it merges and splits any node at most
// once.
#include <algorithm>

#include "methods/multigrain/adapt.h"

namespace lodlab::multigrain {
namespace {

/// A threshold that is a node's own error is met by that very error, whatever the rounding.
constexpr double kHair = 1e-12;
constexpr int64_t kNever = std::numeric_limits<int64_t>::min();

}  // namespace

void Adapter::select_dual() {
  begin();
  for (const uint32_t id : cut_) {
    if (spot_[id].k >= 0) resolve(id, first_within(id, frame_.target));
  }
  merges_ = true;
  trade();
  const Score coherent = score();
  if (coherent.worst == 0.0 && nodes_ <= frame_.nodes) return;
  // The nodes do not suffice: from the roots they may serve better. The better cut is kept.
  const bool allowed_nodes = nodes_ <= frame_.nodes;
  work_.clear();
  for (const uint32_t id : cut_) {
    if (spot_[id].k >= 0) work_.push_back(id);
  }
  select_topdown();
  if (!allowed_nodes || score() < coherent) return;
  forget();
  moves_.clear();
  for (const uint32_t id : work_) put(id, first_within(id, frame_.target));
}

bool Adapter::pressed(uint32_t id, int k, double rho) const {
  const Node& n = node(id);
  if (n.children == 0) return false;
  if (!local_) return rho > frame_.target;
  return id == blocked_ || (k == n.most && rho >= level_ && forest_.stride_log2(n, k) > 0);
}

/// The fewest triangles for a node within so many pixels, as far as fewest() and the grandchildren tell.
int64_t Adapter::fewest_below(uint32_t id, int k, double pixels) {
  const Node& n = node(id);
  const int64_t all = fewest(id, k);
  if (spot_[id].inside || n.children == 0) return all;
  int64_t seen = 0;  // what the view leaves of it
  for (uint32_t c = n.first_child; c < n.first_child + n.children; ++c) {
    const int child_k = first_within(c, pixels);
    if (spot_[c].visible) seen += fewest(c, child_k);
  }
  return std::min(all, seen);
}

/// What a split saves in triangles, and how many nodes it adds. Where all children need as fine a stride, the
/// gain may lie below them, at the price of more nodes.
void Adapter::weigh_split(uint32_t id) {
  Spot& spot = spot_[id];
  if (spot.saved_in == frames_ && spot.saved_theta == spot.theta && spot.saved_k == spot.k) return;
  const Node& n = node(id);
  int64_t saved = triangles(id, spot.k);
  int more = -1;
  bool worse = false;  // finest_error leaves nodes without the resolutions that their parents have
  int8_t k[4];
  for (uint32_t c = 0; c < n.children; ++c) {
    k[c] = static_cast<int8_t>(first_within(n.first_child + c, spot.theta));
    if (!spot_[n.first_child + c].visible) continue;
    saved -= triangles(n.first_child + c, k[c]);
    ++more;
    worse = worse || (forest_.at(node(n.first_child + c), k[c]).error > forest_.at(n, spot.k).error &&
                      project(n.first_child + c, k[c]) > spot.theta);
  }
  if (worse) {
    saved = kNever;
  } else if (saved <= 0) {
    saved = triangles(id, spot.k);
    for (uint32_t c = 0; c < n.children; ++c) {
      if (spot_[n.first_child + c].visible) saved -= fewest_below(n.first_child + c, k[c], spot.theta);
    }
    saved /= 4;
  }
  spot.saved = saved;
  spot.more = static_cast<int8_t>(more);
  spot.saved_in = frames_;
  spot.saved_theta = spot.theta;
  spot.saved_k = spot.k;
}

/// The place of a split in the queue; none when there is nothing to gain. A node above the target that waits
/// for its heights stays as it is: its children would wait for the same ones.
std::optional<Key> Adapter::split_key(uint32_t id) {
  const Spot& spot = spot_[id];
  if (node(id).children == 0 || !spot.visible) return std::nullopt;
  if (!local_ && spot.rho > frame_.target && starved(id)) return std::nullopt;
  weigh_split(id);
  const bool press = pressed(id, spot.k, spot.rho);
  if (spot.saved == kNever || (!press && spot.saved <= 0)) return std::nullopt;
  const double free_first = spot.more <= 0 ? 1e15 : 0.0;  // what needs no more nodes goes before what does
  return Key{press ? spot.rho : 0.0, static_cast<double>(spot.saved) + free_first};
}

/// What a merge costs; none while a child is not on the cut, or when this trade has split the node.
std::optional<Key> Adapter::merge_key(uint32_t id) {
  const Node& n = node(id);
  Spot& spot = look(id);
  if (spot.children_on != n.children || spot.split_in == trades_) return std::nullopt;
  double theta = frame_.target;
  int64_t cost = 0;
  int visible = 0;
  for (uint32_t c = n.first_child; c < n.first_child + n.children; ++c) {
    if (!spot_[c].visible) continue;
    theta = std::max(theta, spot_[c].theta);
    cost -= triangles(c, spot_[c].k);
    ++visible;
  }
  // A box may be seen though none of its children's is: nothing says then what its error may be.
  const int k = local_ && visible == 0 ? n.least : first_within(id, theta);
  double bad = 0.0;
  if (spot.visible) {
    const double rho = project(id, k);
    cost += triangles(id, k);
    if (rho > theta || pressed(id, k, rho)) bad = rho;
  }
  spot.theta = theta;
  spot.merge_k = static_cast<int8_t>(k);
  spot.fewer = static_cast<int8_t>(visible - (spot.visible ? 1 : 0));
  return Key{-bad, -static_cast<double>(cost)};
}

/// Steps, each the best that there is: fewer nodes while there are too many; merges that cost nothing;
/// splits; where nodes do not suffice, a split paid for by merges.
void Adapter::trade() {
  ++trades_;
  split_.clear();
  merge_.clear();
  for (const uint32_t id : cut_) {
    Spot& spot = spot_[id];
    if (spot.k >= 0) spot.theta = local_ ? std::max(spot.rho * (1.0 + kHair), frame_.target) : frame_.target;
  }
  for (const uint32_t id : cut_) {
    if (spot_[id].k < 0) continue;
    if (const auto key = split_key(id)) split_.append(id, *key);
    const int32_t parent = node(id).parent;
    if (!merges_ || parent < 0 || node(static_cast<uint32_t>(parent)).first_child != id) continue;
    if (const auto key = merge_key(static_cast<uint32_t>(parent))) merge_.append(parent, *key);
  }
  split_.order();
  merge_.order();
  for (;;) {
    if (!merge_.empty()) {
      const Key best = merge_.key();
      if (nodes_ > frame_.nodes || (best.first == 0.0 && best.second >= 0.0)) {
        trade_merge(merge_.top());
        continue;
      }
    }
    if (split_.empty()) break;
    const uint32_t id = split_.top();
    if (nodes_ + spot_[id].more <= frame_.nodes) {
      trade_split(id);
    } else if (!exchange(id)) {
      split_.pop();
    }
  }
}

/// A node that came onto the cut enters the queues, and so may its parent.
void Adapter::offer(uint32_t id) {
  if (const auto key = split_key(id)) split_.set(id, *key);
}

void Adapter::trade_split(uint32_t id) {
  const double theta = spot_[id].theta;
  const Node& n = node(id);
  split_.erase(id);
  if (n.parent >= 0) merge_.erase(static_cast<uint32_t>(n.parent));
  spot_[id].split_in = trades_;
  split(id, [&](uint32_t child) {
    spot_[child].theta = theta;
    return first_within(child, theta);
  });
  ++steps_;
  for (uint32_t c = n.first_child; c < n.first_child + n.children; ++c) offer(c);
}

void Adapter::trade_merge(uint32_t id) {
  const Node& n = node(id);
  merge_.erase(id);
  for (uint32_t c = n.first_child; c < n.first_child + n.children; ++c) split_.erase(c);
  merge(id, spot_[id].merge_k);
  ++steps_;
  offer(id);
  if (n.parent < 0) return;
  const auto parent = static_cast<uint32_t>(n.parent);
  if (const auto key = merge_key(parent)) merge_.set(parent, *key);
}

/// Splits a node for which there are not nodes enough after merges that make room and cost less than it
/// saves; for a pressed node, merges that leave all errors below its own. False: there are none.
bool Adapter::exchange(uint32_t id) {
  const Node& n = node(id);
  const bool press = split_.key().first > 0.0;
  int64_t room = frame_.nodes - nodes_ - spot_[id].more;
  double left = split_.key().second;  // more than 0 nodes: no bonus in it
  aside_.clear();
  used_.clear();
  aside_keys_.clear();
  while (room < 0 && !merge_.empty()) {
    const uint32_t parent = merge_.top();
    const Key key = merge_.key();
    if (press ? -key.first >= spot_[id].rho : key.first < 0.0 || left + key.second <= 0.0) break;
    merge_.pop();
    aside_.push_back(parent);
    aside_keys_.push_back(key);
    if (static_cast<int32_t>(parent) == n.parent || spot_[parent].fewer <= 0) continue;
    used_.push_back(parent);
    room += spot_[parent].fewer;
    left += key.second;
  }
  for (size_t i = 0; i < aside_.size(); ++i) merge_.set(aside_[i], aside_keys_[i]);
  if (room < 0) return false;
  for (const uint32_t parent : used_) trade_merge(parent);
  trade_split(id);
  return true;
}

}  // namespace lodlab::multigrain
