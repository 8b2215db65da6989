// SPDX-License-Identifier: MIT
// Cracks in the captured surface triangles, fillers left out. Triangles with two bit-equal vertices are
// dropped; then every directed edge (a, b) must have exactly one (b, a), bit for bit (-0 equals 0),
// but for the source's own boundary. No slack: a vertex that differs in its last bit is a crack. Where floats
// do not part the columns of a planet, two that fall together fold what is between: there as many opposites
// do.
#pragma once

#include <cstdint>

#include <functional>
#include <glm/glm.hpp>

#include "render/frame.h"

namespace lodlab::instrument {

/// An edge of surface triangles that is not there exactly once in each direction. Points relative to the eye.
struct UnmatchedEdge {
  glm::dvec3 low, high;
  uint32_t node;  ///< of one of its triangles
  bool balanced;  ///< as often in one direction as in the other
};

/// The number of directed edges without exactly one opposite, those left out that are excused.
int64_t crack_edges(const render::Captured& captured,
                    const std::function<bool(const UnmatchedEdge&)>& excused);

}  // namespace lodlab::instrument
