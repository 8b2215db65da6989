// SPDX-License-Identifier: MIT
// The closest point of a triangle mesh. Embree's hierarchy of boxes finds the triangles that may hold it;
// each of them is then measured in double, so a distance is as exact as doubles are. Embree works in floats:
// what it sees is scaled to size 1 by a power of two, boxes are rounded outwards, and the search radius is
// wider than the best distance by more than its rounding can be. So no closest triangle is lost, and since of
// equally close triangles the one of smallest index counts, results depend on neither hierarchy nor threads.
// Lines are cut with triangles in double likewise, by signs that both sides of an edge compute alike: none
// slips through between two triangles.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <glm/glm.hpp>
#include <limits>
#include <memory>
#include <span>
#include <vector>

namespace lodlab {

using Triangle = std::array<glm::dvec3, 3>;

/// Positions relative to a centre that the owner chooses: near the mesh, or doubles lose what they could
/// hold.
struct WeldedMesh {
  std::vector<glm::dvec3> positions;
  std::vector<std::array<uint32_t, 3>> faces;

  int64_t triangles() const { return static_cast<int64_t>(faces.size()); }
  Triangle triangle(int64_t index) const {
    const auto& f = faces[static_cast<size_t>(index)];
    return {positions[f[0]], positions[f[1]], positions[f[2]]};
  }
};

/// Makes corners with bit-equal coordinates one vertex, and subtracts the centre.
WeldedMesh weld(std::span<const Triangle> triangles, const glm::dvec3& centre);

/// The edges of a mesh that are not there once in each direction, but for those of triangles that are
/// segments; as triangles that are segments. Other vertices are left out: they lie far from any border.
WeldedMesh unmatched_edges(const WeldedMesh& mesh);

inline constexpr uint32_t kNoTriangle = std::numeric_limits<uint32_t>::max();

struct Closest {
  double distance = std::numeric_limits<double>::infinity();
  glm::dvec3 point{std::numeric_limits<double>::quiet_NaN()};
  uint32_t triangle = kNoTriangle;
};

/// Flatter than this (sine of the angle at the first corner), a triangle's normal is mostly rounding. Its
/// inside is then left out: it is closer than its edges by less than this share of its size.
inline constexpr double kFlattest = 1e-8;

/// Where a line cuts a triangle.
struct Crossing {
  double along = 0.0;  ///< from the origin, in lengths of the direction
  uint32_t triangle = kNoTriangle;
};

/// The closest point of one triangle, which may be a segment or a point. Exactly 0 at its corners.
Closest closest_on_triangle(const Triangle& triangle, const glm::dvec3& point);

class MeshSurface {
 public:
  /// The mesh must be finite and outlive the surface. Throws Unsupported when Embree cannot build.
  explicit MeshSurface(const WeldedMesh& mesh);
  ~MeshSurface();
  MeshSurface(const MeshSurface&) = delete;
  MeshSurface& operator=(const MeshSurface&) = delete;

  const WeldedMesh& mesh() const { return mesh_; }

  /// Infinitely far, without a triangle, when the mesh is empty. `hint`: a triangle that may be close, which
  /// saves time and changes nothing. Any number of threads may ask at once.
  Closest closest(const glm::dvec3& point, uint32_t hint = kNoTriangle) const;

  /// The closest of the triangles within a distance that are as asked, else none.
  Closest closest_within(const glm::dvec3& point, double distance,
                         const std::function<bool(uint32_t triangle, double distance)>& is) const;

  /// Whether one of the triangles within a distance is as asked.
  bool any_within(const glm::dvec3& point, double distance,
                  const std::function<bool(uint32_t triangle)>& is) const;

  /// Of the triangles that a line cuts within `reach` lengths of `direction` (finite, not 0) either way,
  /// whose normal runs along it, and that are as asked, the one that is cut closest to the origin, else none.
  /// Of several as close the one ahead counts, and of those the one of smallest index. Triangles without area
  /// are not cut. An origin farther from the coordinates' zero than twice the farthest vertex may miss some:
  /// floats round it.
  Crossing closest_crossing(
      const glm::dvec3& origin, const glm::dvec3& direction, double reach,
      const std::function<bool(uint32_t triangle)>& is = [](uint32_t) { return true; }) const;

 private:
  struct Scene;
  const WeldedMesh& mesh_;
  double scale_ = 1.0;  ///< a power of two that brings the largest coordinate into [0.5, 1)
  std::unique_ptr<Scene> scene_;
};

}  // namespace lodlab
