// SPDX-License-Identifier: MIT
// Meshes made by hand: arrays that grow, and the mesh that owns a copy of them.
#pragma once

#include <memory>
#include <vector>

#include "geometry/mesh.h"

namespace lodlab::testing {

struct Arrays {
  std::vector<glm::dvec3> positions;
  std::vector<Face> faces;
};

inline std::shared_ptr<const Mesh> mesh_of(const Arrays& arrays) {
  const auto owner = std::make_shared<const Arrays>(arrays);
  return make_mesh({owner->positions, owner->faces, {}, {}, owner}, "");
}

}  // namespace lodlab::testing
