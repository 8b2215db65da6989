// SPDX-License-Identifier: MIT
// How far what is drawn may be from the source, and the other way: for each control face, and for each level
// of line (pattern.h). A triangle between samples of a face is covered by the bound of its longest line,
// whatever its shape, and however its neighbours are split: so a renderer that draws only lines whose bounds
// are within a budget keeps to it, where each line's decision knows that line alone. Those inside a face have
// the face's bounds, those on a control edge the edge's: the larger of its two faces'. Bounds fall with the
// level.
//
// A bound is the finest surface's distance to the source, both ways, and of a border's from the source's,
// plus what the coarser triangles are off from the finest ones at equal weights. METHOD.md derives the second
// from the range of what is left of the samples' ends when an affine map is subtracted.
#pragma once

#include "methods/subdivision/displacement.h"

namespace lodlab::subdivision {

/// The finest distances are found to within this share of each face's, upwards.
inline constexpr double kSlack = 0.2;

struct Bounds {
  int levels = 0;
  std::vector<double> face;      ///< `levels` a face, the coarsest first
  std::vector<double> sampling;  ///< the paper's error of each face: from its patch to the flat control face
  double average = 0.0;  ///< the paper's: from the source's vertices to the finest surface, their mean
};

/// The finest surface: a vertex a sample, in the floats that the GPU draws, n^2 triangles a face. Relative to
/// the source's centre.
WeldedMesh displaced(const Samples& samples, const Displacement& displacement,
                     std::span<const float> heights);

/// What a face's triangles are off from its finest ones at equal weights, at most: for each level. `ends`: of
/// the samples of the face, in the pattern's order.
std::vector<double> coarsening(const Pattern& pattern, std::span<const glm::dvec3> ends);

/// `heights`: as they decode. Tells of progress as "bound".
Bounds bounds(const SourceSurface& source, const ControlMesh& control, const Samples& samples,
              const Displacement& displacement, std::span<const float> heights, const Progress& progress);

}  // namespace lodlab::subdivision
