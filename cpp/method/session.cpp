// SPDX-License-Identifier: MIT
// What sessions of all methods share.
#include "method/method.h"
#include "store/format.h"

namespace lodlab {

std::string Session::digest(const Cut& cut) const {
  struct Drawn {
    uint32_t node, resolution;
    float morph;
    uint32_t visible;
  };
  std::vector<Drawn> drawn;
  drawn.reserve(cut.claim->nodes.size());
  for (const CutNode& n : cut.claim->nodes) drawn.push_back({n.node, n.resolution, n.morph, n.visible});
  return store::digest_of(as_bytes(drawn));
}

}  // namespace lodlab
