// SPDX-License-Identifier: MIT
// Mode 1 from the roots (section 7.1): every node at its first resolution within the target; then the node
// whose split saves most triangles is split, those that no resolution satisfies before all others, until the
// nodes are spent or nothing is saved. Each step splits a node: it ends after at most as many as there are.
#include "methods/multigrain/adapt.h"

namespace lodlab::multigrain {

void Adapter::select_topdown() {
  start_coarsest();
  for (const uint32_t id : cut_) resolve(id, first_within(id, frame_.target));
  merges_ = false;
  trade();
}

}  // namespace lodlab::multigrain
