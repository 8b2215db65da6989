// SPDX-License-Identifier: MIT
// How far the drawn surface is from the source, over all of the source's samples: no subsampling.
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "geometry/view.h"
#include "instrument/drawn_surface.h"

namespace lodlab::instrument {

inline constexpr double kUndefined = std::numeric_limits<double>::quiet_NaN();

struct SampleError {
  double max = kUndefined;  ///< source units, over all non-void samples; inf with any hole
  double rms = kUndefined;
  int64_t holes = 0;    ///< non-void samples that nothing covers
  int64_t samples = 0;  ///< non-void samples, holes included
};

/// Without projection: the whole cut.
SampleError sample_error(const HeightField& field, const DrawnSurface& surface);

/// The largest screen distance, pixels, between a non-void sample inside the frustum (hidden or not) and
/// its correspondent: the drawn point at the same horizontal position, on planets in the same direction.
/// inf when a sample inside the frustum is a hole; nan when no sample is inside it.
double sample_error_px(const HeightField& field, const SampleGrid& grid, const DrawnSurface& surface,
                       const Camera& camera);

struct Jump {
  double px = kUndefined;     ///< largest screen distance; nan when no sample qualifies
  double world = kUndefined;  ///< largest distance, source units
  int64_t samples = 0;        ///< samples inside the frustum that both surfaces cover
};

/// How far the drawn surface jumps from `before` to `after` under this camera, at the non-void samples
/// inside the frustum that both cover.
Jump surface_jump(const HeightField& field, const SampleGrid& grid, const DrawnSurface& before,
                  const DrawnSurface& after, const Camera& camera);

struct NodeError {
  uint32_t node = 0;
  double max = 0.0;  ///< largest deviation of its surface triangles from the samples they cover
};

/// Per node of the capture, in order of node; nodes that cover no non-void sample are left out.
std::vector<NodeError> node_errors(const HeightField& field, const SampleGrid& grid,
                                   const render::Captured& captured);

}  // namespace lodlab::instrument
