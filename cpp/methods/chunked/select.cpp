// SPDX-License-Identifier: MIT
// Selection: top-down on the projected error (Ulrich 2002, section 10), or by a priority queue under hard
// budgets; morph weights for the error that the cut is allowed (METHOD.md: why not formula 4).
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "base/errors.h"
#include "method/hand_cut.h"
#include "methods/chunked/session.h"

namespace lodlab::chunked {
namespace {

Box box_of(const Node& node) {
  return {{node.lo[0], node.lo[1], node.lo[2]}, {node.hi[0], node.hi[1], node.hi[2]}};
}

bool less_urgent(double rho_a, uint32_t a, double rho_b, uint32_t b) {
  return rho_a != rho_b ? rho_a < rho_b : a > b;
}

}  // namespace

Cut ChunkedSession::select(const Request& request) {
  const Camera camera = make_camera(request.view);
  const Projector projector(projection_, camera);
  const Budget& budget = request.budget;
  Cut cut{request, nullptr, Claim{}};
  Claim& claim = *cut.claim;
  claim.promises_bound = projection_ != Projection::kPaper && morph_ != Morph::kFormula4;
  residency_.next_frame();
  picked_.clear();
  split_.clear();
  held_.clear();
  wants_.clear();
  if (budget.triangles || budget.nodes) {
    LeastCut::Limits limits;
    limits.triangles = budget.triangles.value_or(limits.triangles);
    limits.nodes = budget.nodes.value_or(limits.nodes);
    select_by_priority(camera, projector, limits, budget.pixel_error.value_or(0.0), claim);
  } else {
    select_top_down(camera, projector, *budget.pixel_error, claim);
  }
  claim.nodes = picked_;
  finish(projector, budget, claim);
  if (residency_.streams()) request_children(claim, projector);
  return cut;
}

/// In streaming runs a node can be refined only when all its children are there.
bool ChunkedSession::refinable(uint32_t node) {
  const Node& parent = hierarchy_->node[node];
  for (uint32_t c = parent.first_child; c < parent.first_child + parent.children; ++c) {
    if (!residency_.resident(c)) return false;
  }
  return true;
}

/// Breadth first, so that the cut comes out sorted by node.
void ChunkedSession::select_top_down(const Camera& camera, const Projector& projector, double tau,
                                     Claim& claim) {
  const std::vector<Node>& nodes = hierarchy_->node;
  claim.tau = tau;
  queue_.resize(hierarchy_->roots);
  for (uint32_t i = 0; i < hierarchy_->roots; ++i) queue_[i] = i;
  for (size_t head = 0; head < queue_.size(); ++head) {
    const uint32_t id = queue_[head];
    const Node& node = nodes[id];
    if (residency_.streams()) residency_.touch(id);
    const bool visible = camera.sees(box_of(node));
    const bool wanted = visible && node.children > 0 &&
                        projector.project(node.error, projector.place(node.lo, node.hi)) > tau;
    if (wanted && refinable(id)) {
      for (uint32_t c = 0; c < node.children; ++c) queue_.push_back(node.first_child + c);
    } else {
      picked_.push_back({id, 0, 1.0f, visible, wanted});
    }
  }
}

/// Where the roots are over a hard budget: what to split for the cheapest cut, of what is there.
void ChunkedSession::find_least(const Camera& camera, const LeastCut::Limits& limits, Claim& claim) {
  const std::vector<Node>& nodes = hierarchy_->node;
  std::vector<LeastCut::Item> items, there;
  const auto add = [&](uint32_t id, int32_t parent) {
    if (camera.sees(box_of(nodes[id])))
      items.push_back({id, parent, submitted_triangles(nodes[id]), nodes[id].children > 0});
  };
  for (uint32_t i = 0; i < hierarchy_->roots; ++i) add(i, -1);
  for (size_t i = 0; i < items.size(); ++i) {
    const Node& node = nodes[items[i].node];
    for (uint32_t c = 0; c < node.children; ++c) add(node.first_child + c, static_cast<int32_t>(i));
  }
  if (residency_.streams()) {
    there = items;
    for (LeastCut::Item& item : there) item.splits = item.splits && refinable(item.node);
  }
  const LeastCut least(std::move(items), limits);
  split_ = least.split();
  if (!limits.keep(least.cost())) {
    claim.least_triangles = least.cost().triangles;
    claim.least_nodes = least.cost().nodes;
  }
  if (!residency_.streams()) return;
  const LeastCut drawn(std::move(there), limits);
  if (!limits.keep(drawn.cost())) want_least(split_);
  split_ = drawn.split();
}

/// Asks for what the cheapest cut lacks, from the top down, and keeps what there is of it.
void ChunkedSession::want_least(const std::vector<uint32_t>& split) {
  held_ = split;
  for (const uint32_t id : split) {
    if (!residency_.resident(id)) continue;
    residency_.touch(id);
    const Node& node = hierarchy_->node[id];
    for (uint32_t c = node.first_child; c < node.first_child + node.children; ++c) {
      if (residency_.resident(c)) {
        residency_.touch(c);
      } else {
        wants_.push_back({c, std::numeric_limits<double>::infinity()});
      }
    }
  }
}

/// Refines the visible node with the largest projected error until the next does not fit. Culled nodes
/// stay coarse: they are not submitted. It starts from the roots, or where they do not fit from the cheapest
/// claim.
void ChunkedSession::select_by_priority(const Camera& camera, const Projector& projector,
                                        const LeastCut::Limits& limits, double target, Claim& claim) {
  const std::vector<Node>& nodes = hierarchy_->node;
  const auto less = [](const Candidate& a, const Candidate& b) {
    return less_urgent(a.rho, a.node, b.rho, b.node);
  };
  heap_.clear();
  LeastCut::Cost cost;
  const auto add = [&](uint32_t id) {
    const Node& node = nodes[id];
    if (residency_.streams()) residency_.touch(id);
    if (!camera.sees(box_of(node))) {
      picked_.push_back({id, 0, 1.0f, false, false});
      return;
    }
    cost.triangles += submitted_triangles(node);
    ++cost.nodes;
    const double rho = projector.project(node.error, projector.place(node.lo, node.hi));
    if (node.children == 0) {
      picked_.push_back({id, 0, 1.0f, true, false});
    } else {
      heap_.push_back({rho, id});
      std::push_heap(heap_.begin(), heap_.end(), less);
    }
  };
  const auto start = [&](const auto& self, uint32_t id) -> void {
    if (!std::binary_search(split_.begin(), split_.end(), id)) return add(id);
    if (residency_.streams()) residency_.touch(id);
    const Node& node = nodes[id];
    for (uint32_t c = 0; c < node.children; ++c) self(self, node.first_child + c);
  };
  for (uint32_t i = 0; i < hierarchy_->roots; ++i) add(i);
  if (!limits.keep(cost)) {
    find_least(camera, limits, claim);
    picked_.clear();
    heap_.clear();
    cost = {};
    for (uint32_t i = 0; i < hierarchy_->roots; ++i) start(start, i);
  }
  claim.tau = target;
  while (!heap_.empty()) {
    const Candidate top = heap_.front();
    if (top.rho <= target) break;
    const Node& node = nodes[top.node];
    LeastCut::Cost more{cost.triangles - submitted_triangles(node), cost.nodes - 1};
    for (uint32_t c = node.first_child; c < node.first_child + node.children; ++c) {
      if (!camera.sees(box_of(nodes[c]))) continue;
      more.triangles += submitted_triangles(nodes[c]);
      ++more.nodes;
    }
    if (!limits.keep(more)) {
      claim.tau = top.rho;
      break;
    }
    std::pop_heap(heap_.begin(), heap_.end(), less);
    heap_.pop_back();
    if (!refinable(top.node)) {
      claim.tau = std::max(claim.tau, top.rho);
      picked_.push_back({top.node, 0, 1.0f, true, true});
      continue;
    }
    cost.triangles -= submitted_triangles(node);
    --cost.nodes;
    for (uint32_t c = 0; c < node.children; ++c) add(node.first_child + c);
  }
  for (const Candidate& rest : heap_) {
    const bool held = std::binary_search(held_.begin(), held_.end(), rest.node);
    picked_.push_back({rest.node, 0, 1.0f, true, held});
  }
  std::sort(picked_.begin(), picked_.end(),
            [](const CutNode& a, const CutNode& b) { return a.node < b.node; });
}

/// Morph weights, counts and the claim. Half-way between its own surface and its parent's a chunk is at
/// most t delta + (1 - t) delta_parent off; t is the least morph that keeps this within delta*(tau).
void ChunkedSession::finish(const Projector& projector, const Budget& budget, Claim& claim) const {
  for (CutNode& picked : claim.nodes) {
    const Node& node = hierarchy_->node[picked.node];
    const Projector::Place place = projector.place(node.lo, node.hi);
    const double span = node.parent_error - node.error;
    double t = 1.0;
    if (node.parent >= 0 && morph_ == Morph::kBudget && span > 0.0) {
      // A hair inside the budget, and rounded towards the chunk's own surface: never over tau.
      // Its parent's surface, which is exact, is drawn as far as it may be: errors nest with what floats
      // round.
      const double exact = projector.inverse(claim.tau * (1.0 - 1e-12), place);
      const double allowed = exact - hierarchy_->quantizer.rounding();
      t = node.parent_error <= exact ? 0.0 : std::clamp((node.parent_error - allowed) / span, 0.0, 1.0);
      if (t > 0.0 && static_cast<float>(t) < t) t = std::nextafter(static_cast<float>(t), 1.0f);
    } else if (node.parent >= 0 && morph_ == Morph::kFormula4 && claim.tau > 0.0) {
      t = std::clamp(2.0 * projector.project(node.error, place) / claim.tau - 1.0, 0.0, 1.0);
    }
    picked.morph = static_cast<float>(t);
    picked.error = drawn_error(node, picked.morph);
    if (!picked.visible) continue;
    claim.predicted_px = std::max(claim.predicted_px, projector.project(picked.error, place));
    claim.triangles += submitted_triangles(node);
    claim.filler_triangles += skirts_ ? (node.indices - node.surface_indices) / 3 : 0;
    ++claim.visible_nodes;
    claim.missing_nodes += picked.missing;
  }
  claim.budget_met = claim.within(budget);
}

/// Children are requested when their parent is drawn, the most wanted first.
void ChunkedSession::request_children(const Claim& claim, const Projector& projector) {
  for (const CutNode& picked : claim.nodes) {
    const Node& node = hierarchy_->node[picked.node];
    if (!picked.visible || node.children == 0) continue;
    const double rho = projector.project(node.error, projector.place(node.lo, node.hi));
    for (uint32_t c = node.first_child; c < node.first_child + node.children; ++c) {
      if (residency_.resident(c)) {
        residency_.touch(c);
      } else {
        wants_.push_back({c, rho});
      }
    }
  }
  residency_.want(std::move(wants_));
}

Cut ChunkedSession::cut(const std::vector<int64_t>& ids, const std::vector<int32_t>& resolutions) const {
  const std::vector<Node>& nodes = hierarchy_->node;
  check_zeros(ids, resolutions, "a chunk");
  std::vector<uint8_t> chosen(nodes.size(), 0);
  for (const int64_t id : ids) {
    if (chosen[checked_node(id, static_cast<int64_t>(nodes.size()))]++)
      throw InvalidInput("cut: node " + std::to_string(id) + " is given twice");
  }
  // Ids rise with depth: a node is covered when an ancestor is chosen.
  std::vector<uint8_t> covered(nodes.size(), 0);
  Claim claim;
  for (size_t i = 0; i < nodes.size(); ++i) {
    const Node& node = nodes[i];
    covered[i] = node.parent >= 0 &&
                 (covered[static_cast<size_t>(node.parent)] || chosen[static_cast<size_t>(node.parent)]);
    if (chosen[i] && covered[i]) {
      throw InvalidInput("cut: node " + std::to_string(i) + " overlaps an ancestor that is also given");
    }
    if (!chosen[i] && !covered[i] && node.children == 0) {
      throw InvalidInput("cut: gap: nothing given covers leaf node " + std::to_string(i) + " at row " +
                         std::to_string(node.row) + ", column " + std::to_string(node.col));
    }
    if (!chosen[i]) continue;
    claim.nodes.push_back({static_cast<uint32_t>(i), 0, 1.0f, true, false, node.error});
    claim.triangles += submitted_triangles(node);
    claim.filler_triangles += skirts_ ? (node.indices - node.surface_indices) / 3 : 0;
    ++claim.visible_nodes;
  }
  return cut_by_hand(std::move(claim));
}

/// Each level with the leaves above it, at its own surface, at its parent's and half-way. Between those the
/// surface is their linear mix at every sample, so its distance is no larger than the mix of theirs. Skirts
/// are no surface, and edges have one state.
std::vector<Cut> ChunkedSession::audit_cuts() const {
  const std::vector<Node>& nodes = hierarchy_->node;
  std::vector<Cut> out;
  for (int level = 0; level < hierarchy_->levels; ++level) {
    std::vector<int64_t> ids;
    for (size_t i = 0; i < nodes.size(); ++i) {
      if (nodes[i].level == level || (nodes[i].level < level && nodes[i].children == 0))
        ids.push_back(static_cast<int64_t>(i));
    }
    for (const float morph : {1.0f, 0.5f, 0.0f}) {
      if (level == 0 && morph < 1.0f) break;  // a root has no parent to come from
      Cut level_cut = cut(ids, {});
      for (CutNode& picked : level_cut.claim->nodes) {
        const Node& node = nodes[picked.node];
        if (node.level < level) continue;
        picked.morph = morph;
        picked.error = drawn_error(node, morph);
      }
      out.push_back(std::move(level_cut));
    }
  }
  return out;
}

}  // namespace lodlab::chunked
