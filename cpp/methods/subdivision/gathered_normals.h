// SPDX-License-Identifier: MIT
// The normals of the source triangles round the vertices that collapsed onto one another: for each vertex all
// of them, as lists that join, and a cone that holds them. Cones are merged without looking at the lists, so
// they come to be wider than need be; where one is too wide its axis is sought anew among the normals.
#pragma once

#include <span>
#include <vector>

#include "geometry/mesh_edges.h"
#include "methods/subdivision/normal_cone.h"

namespace lodlab::subdivision {

class GatheredNormals {
 public:
  /// `normals`: unit, a triangle's; 0 of those that have none. A vertex whose own normals are within
  /// acos(`least`) of no axis is given none.
  GatheredNormals(std::span<const Face> faces, std::vector<glm::dvec3> normals, int64_t vertices,
                  double least);

  const NormalCone& cone(uint32_t vertex) const { return cones_[vertex]; }

  /// The merged cone of two vertices, if its axis is within acos(`least`) of all their normals and of `more`;
  /// else one whose axis is; else (as far as it is sought) none: false.
  bool merge(uint32_t a, uint32_t b, std::span<const glm::dvec3> more, double least, NormalCone& out) const;
  /// As above for one vertex, whose own cone is tried first.
  bool turn(uint32_t vertex, std::span<const glm::dvec3> more, double least, NormalCone& out) const;
  void give(uint32_t vertex, const NormalCone& cone) { cones_[vertex] = cone; }
  /// Joins the list of b to that of a.
  void join(uint32_t a, uint32_t b, const NormalCone& cone);

  /// The middle of a vertex's normals and more of them: the largest angle to any is about as small as can be,
  /// and never larger than from the axis of its cone.
  glm::dvec3 middle(uint32_t vertex, std::span<const glm::dvec3> more) const;

  template <class Do>
  void each_member(uint32_t vertex, const Do& visit) const {
    for (uint32_t m = vertex; m != kEnd; m = next_[m]) visit(m);
  }

 private:
  static constexpr uint32_t kEnd = ~uint32_t{0};
  struct Lowest {
    double cosine = 2.0;
    glm::dvec3 normal{0.0};
  };
  bool fit(uint32_t a, uint32_t b, std::span<const glm::dvec3> more, double least, NormalCone& out) const;
  Lowest lowest(const glm::dvec3& axis, uint32_t a, uint32_t b, std::span<const glm::dvec3> more) const;
  double best_axis(glm::dvec3& axis, uint32_t a, uint32_t b, std::span<const glm::dvec3> more,
                   double enough) const;

  std::vector<glm::dvec3> normals_;
  std::vector<uint32_t> begin_, around_;  ///< triangles round source vertices
  std::vector<uint32_t> next_, last_;     ///< of lists of source vertices
  std::vector<NormalCone> cones_;
};

}  // namespace lodlab::subdivision
