// SPDX-License-Identifier: MIT
// Selection: the least precision that the budget asks for, then the cut at that precision. Each patch decides
// by its own four edges (section 3, Level of Detail); METHOD.md has the metric and the proof.
#include <algorithm>

#include "method/map_paging.h"
#include "methods/seamless/paging.h"
#include "methods/seamless/selector.h"
#include "methods/seamless/session.h"

namespace lodlab::seamless {

/// The precision that the budget asks for; a given rho is taken as it is, but for hard budgets.
Selector::Cheapest SeamlessSession::asked_for(Selector& selector, const Budget& budget,
                                              const Selector::Limits& limits) const {
  const double asked =
      metric_.rho > 0.0 ? metric_.rho : selector.fineness_for(budget.pixel_error.value_or(0.0));
  if (!budget.triangles && !budget.nodes) return {asked, true, {}};
  const Selector::Cheapest found = selector.within(limits, asked);
  return found.fits ? found : selector.cheapest(limits, asked, nullptr);
}

Cut SeamlessSession::select(const Request& request) {
  const Camera camera = make_camera(request.view);
  const Budget& budget = request.budget;
  const Projector projector(projection_, camera);
  Selector selector(*hierarchy_, mesh_, metric_, projector, &camera, scratch_);
  Selector::Limits limits;
  limits.triangles = budget.triangles.value_or(limits.triangles);
  limits.nodes = budget.nodes.value_or(limits.nodes);
  const Selector::Cheapest asked = asked_for(selector, budget, limits);
  if (paging_->streams()) ask_for(selector, asked.fineness, camera.eye);
  const double drawn = paging_->streams() ? stand_in(selector, limits, asked) : asked.fineness;
  Cut cut{request, nullptr, Claim{}};
  Claim& claim = *cut.claim;
  if (!asked.fits) {
    claim.least_triangles = asked.cost.triangles;
    claim.least_nodes = asked.cost.nodes;
  }
  claim.promises_bound = promises_bound();
  collect(selector, Precision::of(drawn), claim);
  scratch_.leaves = claim.nodes.size();
  if (paging_->streams()) {
    for (const CutNode& picked : claim.nodes) {
      if (picked.visible) paging_->touch(picked.node, 2.0);
    }
  }
  maps_->next_frame();
  maps_->select(camera, claim);
  claim.adapt_steps = selector.traversed;
  claim.tau = budget.pixel_error.value_or(claim.predicted_px);
  claim.budget_met = claim.within(budget);
  return cut;
}

/// Streaming: what a visible patch draws must be there. Where what stands in for it breaks a hard budget, the
/// cheapest cut of what is there is drawn.
double SeamlessSession::stand_in(Selector& selector, const Selector::Limits& limits,
                                 const Selector::Cheapest& asked) {
  const double drawn = stand_in_within(selector, limits, asked.fineness);
  if (drawn == asked.fineness && selector.blocks() == 0) return drawn;
  if (limits.keep(selector.count(drawn, limits))) return drawn;
  selector.unblock();
  selector.stand_in_for(Precision::of(asked.fineness));
  const Selector::Missing missing = [this](const Patch& p) { return !paging_->resident(hierarchy_->id(p)); };
  return selector.cheapest(limits, asked.fineness, &missing).fineness;
}

/// Where a patch is missing, its parent is kept from splitting, and so is what the claim ties to it. Each
/// round blocks a patch above a missing one, so this ends at the root, which is always there. Hard budgets
/// are found again, as coarser patches leave some of them.
double SeamlessSession::stand_in_within(Selector& selector, const Selector::Limits& limits, double asked) {
  constexpr size_t kMostBlocks = 64;  // each costs all edges a look; beyond them everything becomes coarser
  double most = asked, fineness = asked;
  while (true) {
    const Precision precision = Precision::of(fineness);
    parents_.clear();
    selector.traverse(precision, Selector::Scope::kVisible, [&](const Selector::Active& a) {
      if (!paging_->resident(a.id)) parents_.push_back(hierarchy_->id(hierarchy_->layout.parent(a.patch)));
      return true;
    });
    if (parents_.empty()) return fineness;
    std::sort(parents_.begin(), parents_.end());
    parents_.erase(std::unique(parents_.begin(), parents_.end()), parents_.end());
    if (selector.blocks() + parents_.size() > kMostBlocks) {
      selector.unblock();
      fineness = most = selector.coarser(fineness);
    } else {
      for (const int64_t id : parents_) selector.block(hierarchy_->layout.at(id), precision);
    }
    if (limits.any()) fineness = selector.within(limits, most).fineness;
  }
}

/// What the frame should draw is kept, whatever stands in for some of it; what of that is missing comes
/// first, from the top down, then what lies outside the frustum, then the windows round the eye.
void SeamlessSession::ask_for(Selector& selector, double asked, const glm::dvec3& eye) {
  paging_->next_frame();
  int finest = 0;
  selector.traverse(Precision::of(asked), Selector::Scope::kWhole, [&](const Selector::Active& a) {
    finest = std::max(finest, a.patch.level);
    const double priority = a.visible ? 2.0 : 0.5;
    int64_t id = a.id;
    for (; !paging_->resident(id); id = paging_->parent(id)) paging_->need(id, priority);
    paging_->touch(id, priority);
    return true;
  });
  paging_->follow(eye, finest);
  paging_->ask();
}

void SeamlessSession::collect(Selector& selector, const Precision& precision, Claim& claim) const {
  const Layout& layout = hierarchy_->layout;
  claim.nodes.reserve(scratch_.leaves + scratch_.leaves / 4);
  selector.traverse(precision, Selector::Scope::kWhole, [&](const Selector::Active& a) {
    const Patch& p = a.patch;
    const double error = a.visible ? selector.error(p, a.k) : selector.unseen_error(a);
    const bool missing = a.visible && selector.blocked(p, precision);
    claim.nodes.push_back({static_cast<uint32_t>(a.id), static_cast<uint32_t>(pack(a.k, layout.resolutions)),
                           1.0f, a.visible, missing, error});
    if (!a.visible) return true;
    claim.predicted_px = selector.pixels(p, error, claim.predicted_px);
    claim.triangles += mesh_.triangles(a.k, layout.clip_x(p), layout.clip_y(p));
    ++claim.visible_nodes;
    claim.missing_nodes += missing;
    return true;
  });
}

}  // namespace lodlab::seamless
