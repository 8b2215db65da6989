// SPDX-License-Identifier: MIT
// The control mesh as stores keep it and the GPU reads it: floats, in the order of meshoptimizer's vertex
// cache. What is displaced and bounded is this one, so that nothing is rounded after it was measured.
#pragma once

#include "methods/subdivision/control_mesh.h"

namespace lodlab::subdivision {

/// Positions relative to `centre`, the middle of the source's box; they and normals rounded to floats.
/// Neighbours that round to one place are moved apart by steps of a float as large as the farthest
/// coordinate: a control edge has a length. InvalidInput where the mesh is too small for that.
ControlMesh stored(const ControlMesh& control, const glm::dvec3& centre);

}  // namespace lodlab::subdivision
