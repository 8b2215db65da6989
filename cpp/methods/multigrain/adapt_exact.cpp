// SPDX-License-Identifier: MIT
// The optimum's cut (exact.h), drawn like any other: stitching may cost it more than the optimum's error.
#include <algorithm>

#include "methods/multigrain/adapt.h"
#include "methods/multigrain/exact.h"

namespace lodlab::multigrain {

void Adapter::select_exact() {
  Exact exact(forest_, projection_, *frame_.camera);
  const auto error = exact.least_error({frame_.triangles, frame_.nodes}, frame_.target);
  steps_ = exact.tried();
  if (!error) {
    frame_.fits = coarsest_fits();
    return start_coarsest();
  }
  start_coarsest();
  forget();
  for (const auto& [id, k] : exact.cut(*error, frame_.nodes)) put(id, std::min<int>(k, most(id)));
}

double MultigrainSession::optimum_px(const Request& request) const {
  const Budget& budget = request.budget;
  Exact::Limits limits;
  limits.triangles = budget.triangles.value_or(limits.triangles);
  limits.nodes = budget.nodes.value_or(limits.nodes);
  Exact exact(*forest_, projection_, make_camera(request.view));
  return exact.least_error(limits, budget.pixel_error.value_or(0.0))
      .value_or(std::numeric_limits<double>::quiet_NaN());
}

}  // namespace lodlab::multigrain
