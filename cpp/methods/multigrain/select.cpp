// SPDX-License-Identifier: MIT
// Selection: which algorithm serves which budget, and what the cut promises.
#include <string>

#include "base/errors.h"
#include "method/map_paging.h"
#include "methods/multigrain/adapt.h"

namespace lodlab::multigrain {
namespace {

/// A hair inside the target: an error and its inverse are rounded apart.
constexpr double kInside = 1.0 - 1e-12;

Adapt serving(Adapt adapt, const Budget& budget) {
  if (adapt == Adapt::kExact) return adapt;
  if (adapt == Adapt::kAuto) return budget.triangles ? Adapt::kLevel : Adapt::kTopDown;
  const bool spends = adapt == Adapt::kQuad || adapt == Adapt::kLevel;
  if (spends && !budget.triangles) {
    throw Unsupported(std::string("select: adapt=") + (adapt == Adapt::kQuad ? "quad" : "level") +
                      " spends a budget of triangles, and none is set");
  }
  if (!spends && budget.triangles) {
    throw Unsupported(std::string("select: adapt=") + (adapt == Adapt::kDual ? "dual" : "topdown") +
                      " knows pixel_error and nodes, and a budget of triangles is set: adapt=level");
  }
  return adapt;
}

}  // namespace

void Adapter::select(Adapt adapt, const Camera& camera, const Budget& budget, Claim& claim) {
  adapt = serving(adapt, budget);
  ++frames_;
  projector_ = Projector(projection_, camera);
  horizon_ = forest_.horizon(camera);
  frame_ = Frame{};
  frame_.camera = &camera;
  if (budget.pixel_error) frame_.target = *budget.pixel_error * kInside;
  if (budget.triangles) frame_.triangles = *budget.triangles;
  if (budget.nodes) frame_.nodes = *budget.nodes;
  steps_ = 0;
  local_ = budget.triangles.has_value();
  frame_.fits = adapt == Adapt::kExact || coarsest_fits();
  if (adapt == Adapt::kExact) {
    select_exact();
  } else if (!frame_.fits) {
    start_coarsest();
  } else if (adapt == Adapt::kQuad) {
    select_quad();
  } else if (adapt == Adapt::kLevel) {
    select_level();
  } else if (adapt == Adapt::kDual) {
    select_dual();
  } else {
    select_topdown();
  }
  if (adapt != Adapt::kLevel || !frame_.fits) {  // the level is that of the stitched cut
    stitched_from_ = moves_.size();
    stitch_it();
  }
  draw_it();
  if (paging_ != nullptr) page();
  write(budget, claim);
  undo(stitched_from_);
}

Cut MultigrainSession::select(const Request& request) {
  const Camera camera = make_camera(request.view);
  Cut cut{request, nullptr, Claim{}};
  cut.claim->promises_bound =
      projection_ != Projection::kPaper && forest_->store->meta("bounds") != "bilinear";
  paging_->residency().next_frame();
  maps_->next_frame();
  adaptation_->select(adapt_, camera, request.budget, *cut.claim);
  maps_->select(camera, *cut.claim);
  return cut;
}

void MultigrainSession::reset() { adaptation_->reset(); }

}  // namespace lodlab::multigrain
