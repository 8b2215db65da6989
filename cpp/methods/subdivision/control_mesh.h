// SPDX-License-Identifier: MIT
// The control mesh of a source (Bauman, Livny, El-Sana, section 3): edges collapse in the order of their
// quadric errors, unless the normals of a vertex - those of its triangles, and those of all source triangles
// that collapsed onto it - would no longer lie inside one half-sphere. So along a vertex's normal, and along
// what is interpolated between those of a face, the face and the source triangles of its vertices are all
// seen from outside. The surface keeps its components, handles and border loops.
#pragma once

#include <vector>

#include "base/options.h"
#include "base/progress.h"
#include "geometry/mesh.h"

namespace lodlab::subdivision {

/// The cosine of the angle between a control vertex's normal and the normals that it stands for is no less.
inline constexpr double kLeastCosine = 0.1;

struct ControlMesh {
  /// Relative to `centre`: what doubles lose far from the origin is not lost.
  std::vector<glm::dvec3> positions;
  glm::dvec3 centre{0.0};
  /// Unit, a vertex's: along which displacement runs, interpolated over faces.
  std::vector<glm::dvec3> normals;
  std::vector<Face> faces;
  std::vector<uint32_t> onto;  ///< the vertex onto which each of the source collapsed; ~0 for those unused
  bool reached_target = true;  ///< false: no valid collapse remains
};

/// With at most `target_faces`, or as few as can be. Vertices at equal positions are one, but for those that
/// a repair has split; triangles without area have no normal. A source vertex whose own triangles are
/// within acos(kLeastCosine) of no axis counts for nothing, and where it stays nothing is promised of its
/// normal.
/// `poses`: the source in sample poses; collapses cost more where these bend it.
/// InvalidInput, with counts, where the source is not manifold or not oriented, for a target below 1, and for
/// a pose whose vertices are not as many as the source's, or whose triangles are not the same.
ControlMesh control_mesh(const Mesh& source, int64_t target_faces, const Progress& progress,
                         const Meshes& poses = {});

}  // namespace lodlab::subdivision
