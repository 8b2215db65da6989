// SPDX-License-Identifier: MIT
// Selection: the least precision that the budget asks for, then the cut at that precision. Each patch decides
// by its own four edges (section 3, Level of Detail); METHOD.md has the metric and the proof.
#include <algorithm>

#include "methods/seamless/selector.h"
#include "methods/seamless/session.h"

namespace lodlab::seamless {

/// The precision that the budget asks for; a given rho is taken as it is, but for hard budgets.
double SeamlessSession::fineness(Selector& selector, const Budget& budget) const {
  const double asked =
      metric_.rho > 0.0 ? metric_.rho : selector.fineness_for(budget.pixel_error.value_or(0.0));
  if (!budget.triangles && !budget.nodes) return asked;
  constexpr int64_t kNone = std::numeric_limits<int64_t>::max();
  return selector.fineness_within(budget.triangles.value_or(kNone), budget.nodes.value_or(kNone), asked);
}

Cut SeamlessSession::select(const View& view, const Budget& budget) {
  const Camera camera = make_camera(view);
  const Projector projector(projection_, camera);
  Selector selector(*hierarchy_, mesh_, metric_, projector, &camera);
  const double precision = fineness(selector, budget);
  Cut cut;
  cut.view = view;
  cut.options = options_json_;
  cut.promises_bound = promises_bound();
  collect(selector, Precision::of(precision), cut);
  cut.adapt_steps = selector.traversed;
  cut.tau = budget.pixel_error.value_or(cut.predicted_px);
  cut.budget_met = (!budget.pixel_error || cut.predicted_px <= *budget.pixel_error) &&
                   (!budget.triangles || cut.triangles <= *budget.triangles) &&
                   (!budget.nodes || cut.visible_nodes <= *budget.nodes);
  return cut;
}

void SeamlessSession::collect(Selector& selector, const Precision& precision, Cut& cut) const {
  const Layout& layout = hierarchy_->layout;
  selector.traverse(precision, Selector::Scope::kWhole, [&](const Selector::Active& a) {
    const Patch& p = a.patch;
    const Level& level = hierarchy_->level[static_cast<size_t>(p.level)];
    const auto id = static_cast<uint32_t>(level.first + p.y * level.across + p.x);
    const double error = selector.error(p, a.k);
    cut.nodes.push_back(
        {id, static_cast<uint32_t>(pack(a.k, layout.resolutions)), 1.0f, a.visible, false, error});
    if (!a.visible) return true;
    cut.predicted_px = std::max(cut.predicted_px, selector.pixels(p, error));
    cut.triangles += mesh_.triangles(a.k, layout.clip_x(p), layout.clip_y(p));
    ++cut.visible_nodes;
    return true;
  });
  std::sort(cut.nodes.begin(), cut.nodes.end(),
            [](const CutNode& a, const CutNode& b) { return a.node < b.node; });
}

}  // namespace lodlab::seamless
