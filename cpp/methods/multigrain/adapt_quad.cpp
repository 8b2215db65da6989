// SPDX-License-Identifier: MIT
// Mode 2, the quad-queue (section 7.1): rounds of trade(), splits against merges under each node's own error,
// and balance(), resolutions against resolutions under the triangles that there are. A round that does not
// lower the score (largest error, then triangles, then nodes on the cut) is undone, and is the last.
//
// It ends: scores of a view are finitely many, and every round but the last lowers it. balance() ends: it
// lowers resolutions only of nodes that it has not raised, and raises each at most to its finest.
#include <algorithm>

#include "methods/multigrain/adapt.h"

namespace lodlab::multigrain {

void Adapter::select_quad() {
  begin();
  merges_ = true;
  level_ = std::numeric_limits<double>::infinity();
  blocked_ = kNone;
  if (nodes_ > frame_.nodes) trade();
  if (nodes_ > frame_.nodes || !balance()) {
    start_coarsest();
    balance();
  }
  Score best = score();
  for (;;) {
    const size_t mark = moves_.size();
    const int64_t before = steps_;
    level_ = 0.5 * best.worst;
    trade();
    if (steps_ == before) break;
    const bool kept = nodes_ <= frame_.nodes && balance();
    const Score now = score();
    if (!kept || !(now < best)) {
      undo(mark);
      break;
    }
    best = now;
  }
}

void Adapter::queue_resolution(uint32_t id) {
  const Spot& spot = spot_[id];
  const Node& n = node(id);
  const bool there = spot.k >= 0 && spot.visible;
  if (there && spot.k < spot.most) {
    refine_.set(id, {spot.rho, 0.0});
  } else {
    refine_.erase(id);
  }
  if (there && spot.k > n.least) {
    coarsen_.set(id, {-project(id, spot.k - 1), 0.0});
  } else {
    coarsen_.erase(id);
  }
}

/// Once a frame from the cut; from then on after the nodes that have changed.
void Adapter::bring_up_resolution_queues() {
  if (queues_up_) {
    for (const uint32_t id : changed_) queue_resolution(id);
    changed_.clear();
    return;
  }
  refine_.clear();
  coarsen_.clear();
  for (const uint32_t id : cut_) {
    const Spot& spot = spot_[id];
    if (spot.k < 0 || !spot.visible) continue;
    const Node& n = node(id);
    if (spot.k < spot.most) refine_.append(id, {spot.rho, 0.0});
    if (spot.k > n.least) coarsen_.append(id, {-project(id, spot.k - 1), 0.0});
  }
  refine_.order();
  coarsen_.order();
  changed_.clear();
  queues_up_ = true;
}

void Adapter::step(uint32_t id, int k) {
  resolve(id, k);
  changed_.pop_back();  // seen to here
  ++steps_;
  queue_resolution(id);
}

/// Coarsens, the smallest error first, until the triangles are kept and whatever stays within the target is
/// coarse; refines the largest error, at the cost of smaller ones where triangles do not suffice, until that
/// fails. Then `blocked_` is the node that failed. False: even the coarsest resolutions are too many
/// triangles.
bool Adapter::balance() {
  bring_up_resolution_queues();
  blocked_ = kNone;
  while (!coarsen_.empty() && (triangles_ > frame_.triangles || -coarsen_.key().first <= frame_.target)) {
    const uint32_t id = coarsen_.top();
    step(id, spot_[id].k - 1);
  }
  if (triangles_ > frame_.triangles) return false;
  while (!refine_.empty() && refine_.key().first > frame_.target) {
    const uint32_t id = refine_.top();
    const int64_t more = triangles(id, spot_[id].k + 1) - triangles(id, spot_[id].k);
    if (triangles_ + more > frame_.triangles && !swap_for(id)) {
      blocked_ = id;
      break;
    }
    step(id, spot_[id].k + 1);
  }
  return true;
}

/// Coarsens nodes whose errors stay below this one's until it can be refined; takes that back when it cannot.
bool Adapter::swap_for(uint32_t id) {
  const int64_t more = triangles(id, spot_[id].k + 1) - triangles(id, spot_[id].k);
  const size_t mark = moves_.size();
  bool aside = false;
  used_.clear();
  while (triangles_ + more > frame_.triangles && !coarsen_.empty() && -coarsen_.key().first < spot_[id].rho) {
    const uint32_t other = coarsen_.top();
    if (other == id) {
      coarsen_.pop();
      aside = true;
      continue;
    }
    used_.push_back(other);
    step(other, spot_[other].k - 1);
  }
  const bool enough = triangles_ + more <= frame_.triangles;
  if (!enough) {
    undo(mark);
    bring_up_resolution_queues();
    steps_ -= static_cast<int64_t>(used_.size());
  }
  if (aside) queue_resolution(id);
  return enough;
}

/// What is left goes to the largest errors that it can still lower: no less than the largest of all, which
/// stays, but the mean error does fall. What does not fit now will not fit later.
void Adapter::spend() {
  split_.clear();  // its queue is done
  const auto affordable = [this](uint32_t id) {
    const int k = spot_[id].k;
    return k >= 0 && k < spot_[id].most && spot_[id].rho > frame_.target && spot_[id].visible &&
           triangles_ + triangles(id, k + 1) - triangles(id, k) <= frame_.triangles;
  };
  for (const uint32_t id : cut_) {
    if (affordable(id)) split_.append(id, {spot_[id].rho, 0.0});
  }
  split_.order();
  while (!split_.empty()) {
    const uint32_t id = split_.top();
    if (affordable(id)) resolve(id, spot_[id].k + 1);
    if (affordable(id)) {
      split_.set(id, {spot_[id].rho, 0.0});
    } else {
      split_.pop();
    }
  }
}

}  // namespace lodlab::multigrain
