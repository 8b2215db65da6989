// SPDX-License-Identifier: MIT
// The ruler of meshes: a point corresponds to the closest one of the other surface, both ways. The tree of
// the source is built once, by the first figure that asks.
#pragma once

#include <mutex>

#include "geometry/mesh.h"
#include "geometry/mesh_surface.h"
#include "instrument/ruler.h"

namespace lodlab::instrument {

class MeshRuler final : public Ruler {
 public:
  /// InvalidInput without a source.
  explicit MeshRuler(std::shared_ptr<const Mesh> source);

  const Mesh& source() const override { return *source_; }
  std::unique_ptr<Laid> lay(Shown shown) const override;
  bool has_holes() const override { return false; }
  /// An edge lies on the source's own border where its ends and its middle are within its node's bound of
  /// edges of the source that are not there once in each direction: a bound is one of the border, too. As
  /// often one way as the other is no crack: sheets touch.
  int64_t crack_edges(const render::Captured& captured, const NodeBound& bound) const override;
  Orientation orientation(const render::Captured& captured, const NodeBound& bound) const override;
  bool stands_free(const render::Captured& captured, const Camera& camera) const override;
  bool has_voids() const override { return false; }
  glm::dvec3 middle() const override { return centre_; }
  double slack(const glm::dvec3& eye) const override;
  void check_near(const glm::dvec3& eye) const override;

  /// Where coordinates of surface() are from.
  const glm::dvec3& centre() const { return centre_; }
  const MeshSurface& surface() const;

 private:
  const MeshSurface& border() const;  ///< segments, as triangles that are none

  std::shared_ptr<const Mesh> source_;
  glm::dvec3 centre_;
  mutable std::once_flag welded_once_, border_once_;
  mutable WeldedMesh welded_, segments_;
  mutable std::unique_ptr<MeshSurface> surface_, border_;
};

}  // namespace lodlab::instrument
