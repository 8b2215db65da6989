// SPDX-License-Identifier: MIT
// What every method asks of the nodes and resolutions of a cut by hand.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/errors.h"

namespace lodlab {

/// Resolutions are none, or one a node.
inline void check_counts(const std::vector<int64_t>& ids, const std::vector<int32_t>& resolutions) {
  if (resolutions.empty() || resolutions.size() == ids.size()) return;
  throw InvalidInput("cut: " + std::to_string(resolutions.size()) + " resolutions for " +
                     std::to_string(ids.size()) + " nodes");
}

/// The same where a node, which `what` names, has no other resolution than 0.
inline void check_zeros(const std::vector<int64_t>& ids, const std::vector<int32_t>& resolutions,
                        const char* what) {
  check_counts(ids, resolutions);
  for (size_t i = 0; i < resolutions.size(); ++i) {
    if (resolutions[i] == 0) continue;
    throw InvalidInput("cut: resolution " + std::to_string(resolutions[i]) + " of node " +
                       std::to_string(ids[i]) + ": " + what + " has one, 0");
  }
}

/// The index of a node of `count`.
inline size_t checked_node(int64_t id, int64_t count) {
  if (id >= 0 && id < count) return static_cast<size_t>(id);
  throw InvalidInput("cut: node " + std::to_string(id) + " is not within 0 to " + std::to_string(count - 1));
}

}  // namespace lodlab
