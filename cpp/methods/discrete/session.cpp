// SPDX-License-Identifier: MIT
// Selection: of each chain that is seen the coarsest level whose projected bound is within the budget; under
// a triangle budget the worst is refined until the next does not fit. Drawing: one buffer, one call.
#include <algorithm>

#include "base/errors.h"
#include "method/hand_cut.h"
#include "method/mesh_memory.h"
#include "method/projector.h"
#include "methods/discrete/discrete.h"

namespace lodlab::discrete {
namespace {

/// A chain that can be refined, by the projected bound of its level.
struct Candidate {
  double rho;
  uint32_t node;
};

bool less_urgent(const Candidate& a, const Candidate& b) {
  return a.rho != b.rho ? a.rho < b.rho : a.node > b.node;
}

class DiscreteSession : public Session {
 public:
  DiscreteSession(std::shared_ptr<const DiscreteHierarchy> hierarchy, const Options& options)
      : hierarchy_(std::move(hierarchy)),
        projection_(projection_of(options, !hierarchy_->on_mesh() && !hierarchy_->frame().planet)) {}

  Cut select(const Request& request) override {
    Cut cut{request, nullptr, pick(request, heap_)};
    return cut;
  }
  double optimum_px(const Request& request) const override;
  Cut cut(const std::vector<int64_t>& nodes, const std::vector<int32_t>& resolutions) const override;
  std::vector<Cut> audit_cuts() const override;
  void draw(const Cut& cut, render::Pass& pass) override;
  int64_t resident_bytes() const override { return gpu_ ? gpu_->bytes() : 0; }

 private:
  Claim pick(const Request& request, std::vector<Candidate>& heap) const;
  void refine(const Projector& projector, const Budget& budget, Claim& claim,
              std::vector<Candidate>& heap) const;
  const Node& node(uint32_t id) const { return hierarchy_->node[id]; }
  const Chain& chain_of(uint32_t id) const { return hierarchy_->chain[static_cast<size_t>(node(id).chain)]; }
  bool finest(uint32_t id) const { return id + 1 == chain_of(id).first + chain_of(id).levels; }

  struct Gpu {
    Gpu(const DiscreteHierarchy& hierarchy)
        : surface(hierarchy.on_mesh() ? render::make_surface(hierarchy.box)
                                      : render::make_surface(hierarchy.frame(), hierarchy.coverage())),
          memory(hierarchy.meshes()) {}
    int64_t bytes() const { return memory.bytes(); }
    std::shared_ptr<const render::Surface> surface;
    MeshMemory memory;
  };
  std::shared_ptr<const DiscreteHierarchy> hierarchy_;
  Projection projection_;
  std::vector<Candidate> heap_;
  std::vector<MeshMemory::Item> items_;
  std::unique_ptr<Gpu> gpu_;
};

/// Cuts come out sorted by node, as chains are.
Claim DiscreteSession::pick(const Request& request, std::vector<Candidate>& heap) const {
  const Camera camera = make_camera(request.view);
  const Projector projector(projection_, camera);
  const Budget& budget = request.budget;
  Claim claim;
  claim.promises_bound = projection_ != Projection::kPaper;
  claim.nodes.reserve(hierarchy_->chain.size());
  const double tau = budget.triangles ? std::numeric_limits<double>::infinity() : *budget.pixel_error;
  for (const Chain& chain : hierarchy_->chain) {
    const bool visible =
        camera.sees({{chain.lo[0], chain.lo[1], chain.lo[2]}, {chain.hi[0], chain.hi[1], chain.hi[2]}});
    uint32_t id = chain.first;
    if (visible && !budget.triangles) {
      const Projector::Place place = projector.place(chain.lo, chain.hi);
      while (!finest(id) && projector.project(node(id).error, place) > tau) ++id;
    }
    claim.nodes.push_back({id, 0, 1.0f, visible, false, node(id).error});
    if (visible) claim.triangles += node(id).triangles;
  }
  claim.tau = tau;
  if (budget.triangles) refine(projector, budget, claim, heap);
  for (const CutNode& picked : claim.nodes) {
    if (!picked.visible) continue;
    const Chain& chain = chain_of(picked.node);
    claim.predicted_px =
        std::max(claim.predicted_px, projector.project(picked.error, projector.place(chain.lo, chain.hi)));
    ++claim.visible_nodes;
  }
  claim.budget_met = claim.within(budget);
  return claim;
}

/// From the coarsest levels on: the worst is replaced by its next level until that does not fit.
void DiscreteSession::refine(const Projector& projector, const Budget& budget, Claim& claim,
                             std::vector<Candidate>& heap) const {
  const double target = budget.pixel_error.value_or(0.0);
  const int64_t most = *budget.triangles;
  if (claim.triangles > most) {
    claim.least_triangles = claim.triangles;
    claim.least_nodes = std::count_if(claim.nodes.begin(), claim.nodes.end(),
                                      [](const CutNode& picked) { return picked.visible; });
  }
  heap.clear();
  const auto add = [&](uint32_t id) {
    if (finest(id)) return;
    const Chain& chain = chain_of(id);
    heap.push_back({projector.project(node(id).error, projector.place(chain.lo, chain.hi)), id});
    std::push_heap(heap.begin(), heap.end(), less_urgent);
  };
  for (const CutNode& picked : claim.nodes) {
    if (picked.visible) add(picked.node);
  }
  claim.tau = target;
  while (!heap.empty() && heap.front().rho > target) {
    const Candidate top = heap.front();
    if (claim.triangles - node(top.node).triangles + node(top.node + 1).triangles > most) {
      claim.tau = top.rho;
      break;
    }
    std::pop_heap(heap.begin(), heap.end(), less_urgent);
    heap.pop_back();
    CutNode& picked = claim.nodes[static_cast<size_t>(node(top.node).chain)];
    claim.triangles += node(top.node + 1).triangles - node(top.node).triangles;
    picked.node = top.node + 1;
    picked.error = node(picked.node).error;
    add(picked.node);
  }
}

/// Refining the worst first is the best that chains allow.
double DiscreteSession::optimum_px(const Request& request) const {
  std::vector<Candidate> heap;
  const Claim best = pick(request, heap);
  return best.within_hard(request.budget)
             ? std::max(best.predicted_px, request.budget.pixel_error.value_or(0.0))
             : std::numeric_limits<double>::quiet_NaN();
}

Cut DiscreteSession::cut(const std::vector<int64_t>& ids, const std::vector<int32_t>& resolutions) const {
  const std::vector<Node>& nodes = hierarchy_->node;
  check_zeros(ids, resolutions, "a level");
  std::vector<int64_t> of_chain(hierarchy_->chain.size(), -1);
  for (const int64_t id : ids) {
    const size_t row = checked_node(id, static_cast<int64_t>(nodes.size()));
    int64_t& there = of_chain[static_cast<size_t>(nodes[row].chain)];
    if (there == id) throw InvalidInput("cut: node " + std::to_string(id) + " is given twice");
    if (there >= 0) {
      throw InvalidInput("cut: nodes " + std::to_string(there) + " and " + std::to_string(id) +
                         " overlap: they are levels of one part of the source");
    }
    there = id;
  }
  Claim claim;
  for (size_t c = 0; c < of_chain.size(); ++c) {
    if (of_chain[c] < 0) {
      const Chain& chain = hierarchy_->chain[c];
      throw InvalidInput("cut: gap: none of nodes " + std::to_string(chain.first) + " to " +
                         std::to_string(chain.first + chain.levels - 1) + " is given");
    }
    const auto id = static_cast<uint32_t>(of_chain[c]);
    claim.nodes.push_back({id, 0, 1.0f, true, false, node(id).error});
    claim.triangles += node(id).triangles;
    ++claim.visible_nodes;
  }
  return cut_by_hand(std::move(claim));
}

/// Every level, that of the same number of all chains together.
std::vector<Cut> DiscreteSession::audit_cuts() const {
  uint32_t most = 0;
  for (const Chain& chain : hierarchy_->chain) most = std::max(most, chain.levels);
  std::vector<Cut> out;
  for (uint32_t level = 0; level < most; ++level) {
    std::vector<int64_t> ids;
    for (const Chain& chain : hierarchy_->chain)
      ids.push_back(chain.first + std::min(level, chain.levels - 1));
    out.push_back(cut(ids, {}));
  }
  return out;
}

void DiscreteSession::draw(const Cut& cut, render::Pass& pass) {
  if (!gpu_) gpu_ = std::make_unique<Gpu>(*hierarchy_);
  items_.clear();
  for (const CutNode& picked : cut.claim->nodes) {
    if (!picked.visible && !pass.everything()) continue;
    items_.push_back({picked.node, picked.node, static_cast<uint32_t>(node(picked.node).level)});
  }
  gpu_->memory.draw(items_, *gpu_->surface, pass);
}

}  // namespace

std::unique_ptr<Session> make_session(std::shared_ptr<const DiscreteHierarchy> hierarchy,
                                      const Options& options) {
  return std::make_unique<DiscreteSession>(std::move(hierarchy), options);
}

}  // namespace lodlab::discrete
