// SPDX-License-Identifier: MIT
// How far one mesh's surface is from another's: the largest distance over all points of the surface, not of
// its vertices alone (a triangle may lie farthest in its middle), and the root of the mean square over its
// area.
//
// Maximum by branch and bound. The distance to one triangle is convex: over a piece P of the surface it is
// nowhere larger than at P's corners, so for every target triangle t,
//   max over corners of d(corner, M)  <=  sup over P of d(x, M)  <=  max over corners of d(corner, t).
// Pieces whose upper bound exceeds the largest distance seen are cut: above the edges of a target triangle,
// or where two are equally far, so that each part comes to have one closest triangle, and its bounds meet.
// Root mean square by Radon's rule of seven points, of degree 5, on every triangle, cut into equal parts
// until it has its share of the points that the finer of the two meshes asks for.
#pragma once

#include "geometry/mesh_surface.h"

namespace lodlab {

/// A maximum is an attained distance: no point of the surface is farther than that by more than this share of
/// it (or, where it is next to nothing, by kLeastShare of the meshes' extent).
inline constexpr double kMaxTolerance = 1e-3;
inline constexpr double kLeastShare = 1e-9;

struct SurfaceDistance {
  double max = 0.0;  ///< within the tolerance below the true maximum
  double rms = 0.0;  ///< nan when the surface has no area
};

/// The closest point of `to` to each position of `from`.
std::vector<Closest> closest_to_vertices(const WeldedMesh& from, const MeshSurface& to);

/// From every point of `from`, which has triangles as `to` has. `at_vertices` as above; `extent`: the size of
/// both together. Throws Unsupported, naming bounds, when the maximum takes cutting more than `most_pieces`.
SurfaceDistance surface_distance(const WeldedMesh& from, const std::vector<Closest>& at_vertices,
                                 const MeshSurface& to, double extent, int64_t most_pieces);

/// Its maximum alone, in a fraction of the time; or `at_least`, where that is larger.
double largest_distance(const WeldedMesh& from, const std::vector<Closest>& at_vertices,
                        const MeshSurface& to, double extent, int64_t most_pieces, double at_least = 0.0);

/// Who is held to a point of a surface, where the other one is drawn in shares that meet and overlap: the
/// share that is closest, or, where it does not reach the point, the closest of those that do.
struct Shares {
  std::vector<uint32_t> of;   ///< each triangle's
  std::vector<double> reach;  ///< how far each is said to be
  double longest = 0.0;       ///< of these
};

/// The closest point of `to` that is held to a point, given the closest of all.
Closest held_to(const MeshSurface& to, const Shares& shares, const glm::dvec3& point, const Closest& closest);

/// The largest distance to which each share is held: every point of `from`, not its vertices alone, is within
/// the tolerance no farther from one of the shares than that share's. `at_vertices`: as above; `seen`: of
/// each share a distance attained, which these are no less than. Throws as above.
std::vector<double> shared_distances(const WeldedMesh& from, std::vector<Closest> at_vertices,
                                     const MeshSurface& to, const Shares& shares, std::vector<double> seen,
                                     double extent, int64_t most_pieces);

}  // namespace lodlab
