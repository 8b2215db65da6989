// SPDX-License-Identifier: MIT
// What follows a control mesh that is deformed: its normals, and the source.
//
// A face turns by the rotation nearest to what deforms it: that of its plane, and in the plane the rotation
// of its edges' polar decomposition. A control vertex's normal turns with the faces round it, in the mean by
// their area at rest. A source vertex has weights over a face and a height, P = sum w_i (P_i + h N_i) as
// displace.h has it, and what that leaves turns with the face; so rigid motions carry both rigidly, and
// nothing moves at rest.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <memory>
#include <span>
#include <vector>

#include "geometry/mesh.h"
#include "method/method.h"

namespace lodlab::subdivision {

/// The control mesh at rest, as it is stored and drawn: relative to the middle of the source's box.
struct RestControl {
  glm::dvec3 middle;
  std::vector<glm::vec3> positions, normals;  ///< a vertex's; normals are unit ones
  std::vector<Face> faces;
};

struct PosedControl {
  std::vector<glm::vec3> positions, normals;  ///< relative to the middle, as at rest
  /// Faces that turn from a normal at their corners, or have no area, and do not at rest; and the first one.
  int64_t folded = 0, first_folded = -1;
};

/// The normals of control points that have moved to `positions`; where none has, bit for bit those at rest.
std::vector<glm::vec3> posed_normals(const RestControl& rest, std::span<const glm::vec3> positions);

/// InvalidInput for another number of control points. One where it is at rest keeps its stored floats.
PosedControl posed_control(const RestControl& rest, const Pose& pose);

/// Where the control points are at rest, source units: the pose of control(), told bit for bit by
/// posed_control().
std::vector<glm::dvec3> rest_pose(const RestControl& rest);

/// How a source hangs on a control mesh.
class Binding final : public Carrier {
 public:
  /// A vertex is bound to the face that it is least far from along the interpolated normal, of those with it
  /// over their inside and a normal along its own; where there is none, to the closest point.
  Binding(std::shared_ptr<const RestControl> rest, std::shared_ptr<const Mesh> source);

  const Mesh& source() const { return *source_; }

  /// Vertices' own normals are left out.
  std::shared_ptr<const Mesh> carry(const Pose& pose) const override;

  /// Share of the source's vertices that lie over the inside of no face.
  double aside() const;

 private:
  struct Bound {
    uint32_t face = 0;
    double u = 0.0, v = 0.0;  ///< weights of the face's corners 1 and 2
    double height = 0.0;      ///< in lengths of the interpolated normal
    glm::dvec3 left{0.0};     ///< what these leave
    bool inside = false;
  };
  class Binder;

  std::shared_ptr<const RestControl> rest_;
  std::shared_ptr<const Mesh> source_;
  std::vector<Bound> bound_;
};

}  // namespace lodlab::subdivision
