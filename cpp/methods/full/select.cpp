// SPDX-License-Identifier: MIT
// There is nothing to select: the one node, whatever the view and the budget.
#include "base/errors.h"
#include "methods/full/full.h"

namespace lodlab::full {

Cut OneNodeSession::everything() const {
  Cut cut;
  Claim& claim = cut.claim.emplace();
  claim.nodes = {CutNode{}};
  claim.tau = 0.0;
  claim.triangles = triangles_;
  claim.visible_nodes = 1;
  return cut;
}

Cut OneNodeSession::select(const Request& request) {
  make_camera(request.view);  // refuses views that are none
  Cut cut = everything();
  cut.request = request;
  return cut;
}

Cut OneNodeSession::cut(const std::vector<int64_t>& nodes, const std::vector<int32_t>& resolutions) const {
  if (nodes.empty()) throw InvalidInput("cut: node 0 is missing; the cut does not cover the source");
  for (const int64_t node : nodes) {
    if (node != 0)
      throw InvalidInput("cut: there is no node " + std::to_string(node) + "; `full` has node 0 alone");
  }
  if (nodes.size() > 1)
    throw InvalidInput("cut: node 0 is listed " + std::to_string(nodes.size()) + " times; the nodes overlap");
  if (!resolutions.empty() && (resolutions.size() != 1 || resolutions[0] != 0)) {
    throw InvalidInput("cut: `full` has resolution 0 alone");
  }
  return everything();
}

}  // namespace lodlab::full
