// SPDX-License-Identifier: MIT
// How far the drawn surface is from the source, over all of the source's samples: no subsampling.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <vector>

#include "geometry/view.h"
#include "instrument/drawn_surface.h"
#include "instrument/screen.h"

namespace lodlab::instrument {

inline constexpr double kUndefined = std::numeric_limits<double>::quiet_NaN();
inline constexpr double kInfinite = std::numeric_limits<double>::infinity();

struct SampleError {
  double max = kUndefined;  ///< source units, over all non-void samples; inf with any hole
  double rms = kUndefined;
  int64_t holes = 0;    ///< non-void samples that nothing covers
  int64_t samples = 0;  ///< non-void samples, holes included
};

/// Of surfaces that correspond by their closest points, from one to the other; source units.
struct TwoSided {
  double max_to_drawn = kUndefined,
         rms_to_drawn = kUndefined;  ///< from the source; inf where nothing is drawn
  double max_to_source = kUndefined, rms_to_source = kUndefined;  ///< from what is drawn
};

using NodeBound = std::function<double(uint32_t node)>;  ///< source units

/// Without projection: the whole cut.
SampleError sample_error(const HeightField& field, const DrawnSurface& surface);

/// The largest screen distance, pixels, between a non-void sample in view (InView; by other ground hidden or
/// not) and its correspondent: the drawn point at the same horizontal position, on planets in the same
/// direction. inf when a sample in view is a hole; nan when none is in view.
double sample_error_px(const HeightField& field, const SampleGrid& grid, const DrawnSurface& surface,
                       const InView& in_view);

/// The largest screen distance, pixels, by which the drawn surface jumps from `before` to `after` at the
/// non-void samples in view that both cover; nan when there are none.
double surface_jump(const HeightField& field, const SampleGrid& grid, const DrawnSurface& before,
                    const DrawnSurface& after, const InView& in_view);

struct NodeError {
  uint32_t node = 0;
  double max = 0.0;  ///< largest deviation of its surface triangles from the samples they cover
};

/// Per node of the capture, in order of node, from the worst deviation of each of its triangles (as
/// DrawnSurface leaves them); nodes that cover no non-void sample are left out.
std::vector<NodeError> worst_of_nodes(const render::Captured& captured,
                                      const std::vector<float>& worst_of_triangle);

}  // namespace lodlab::instrument
