// SPDX-License-Identifier: MIT
// How far the source is from each sample of the pattern, along the interpolated normal (Bauman, Livny,
// El-Sana, section 3.1), in lengths of that normal, which is not made unit again. The control mesh is as it
// is stored, relative to the source's centre; so is all below. A sample is good where the line cuts a source
// triangle that faces along the normal, no farther away than half the longest edge of the sample's faces, and
// has collapsed onto a vertex of its face or of one that touches it: other sheets may be nearer. A
// good one that rises more steeply than kSteepest from a neighbour, while the source is much closer elsewhere
// (kMuchCloser), lies on the wrong sheet. What is not good is repaired: by the closest source point, where
// that faces along the normal and is no farther aside than a step of the pattern; else by the mean of good
// neighbours. An interpolated normal below kShortestNormal is no direction, and its sample not good: normals
// within the half-sphere give none.
#pragma once

#include "geometry/mesh_surface.h"
#include "methods/subdivision/pattern.h"
#include "subdivision/displace.h"

namespace lodlab::subdivision {

inline constexpr double kSteepest = 2.0;
inline constexpr double kMuchCloser = 0.25;
inline constexpr double kShortestNormal = kLeastCosine / 2.0;

enum class Sampling { kIntersection, kInterpolation };

/// A source to be asked, its vertices at equal positions as one, relative to the middle of its box.
struct SourceSurface {
  explicit SourceSurface(const Mesh& source);
  glm::dvec3 centre;
  WeldedMesh mesh;
  MeshSurface surface;
};

struct Displacement {
  std::vector<Samples::Place> places;
  std::vector<float> heights;  ///< a sample's, in lengths of its normal
  std::vector<uint32_t> near;  ///< a source triangle near each sample's end
  int64_t missed = 0;          ///< no triangle within reach faced along the normal
  int64_t wrong_sheet = 0;
  int64_t averaged = 0;  ///< of both, those repaired from neighbours

  double repaired_share() const {
    return static_cast<double>(missed + wrong_sheet) / static_cast<double>(heights.size());
  }
  glm::dvec3 end(size_t sample, float height) const {
    return displaced(places[sample].position, places[sample].normal, height);
  }
};

/// kInterpolation: the triangles of the pattern round a sample are its neighbourhood's cells. In each the
/// source's triangles lie, in the mean, above or below the plane through the intersections at its corners; a
/// sample moves from its intersection by what its cells are off, interpolated by inverse distance. (The paper
/// takes the cells' elevations themselves: at a vertex of the control mesh, over which elevations form a
/// cone, that cuts off the tip.)
/// Tells of progress as "sample".
Displacement displace(const SourceSurface& source, const ControlMesh& control, const Samples& samples,
                      Sampling sampling, const Progress& progress);

}  // namespace lodlab::subdivision
