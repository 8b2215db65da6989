// SPDX-License-Identifier: MIT
#include "instrument/fillers.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <mutex>
#include <set>

#include "base/parallel.h"
#include "geometry/angles.h"
#include "instrument/captured.h"
#include "instrument/slack.h"

namespace lodlab::instrument {
namespace {

using Place = std::array<float, 3>;

Place place_of(const render::CapturedVertex& v) { return {v.x, v.y, v.z}; }

constexpr double kOnSample = 1e-6;  ///< cells: the rounding of coordinates in double

/// The samples round a coordinate: both sides of it, or the one that it lies on within the tolerance.
struct Range {
  int64_t lo, hi;
};

Range around(double at, double tolerance, int64_t last) {
  const double near = std::floor(at + tolerance), far = std::ceil(at - tolerance);
  const auto whole = [last](double value) {
    return static_cast<int64_t>(std::clamp(value, 0.0, static_cast<double>(last)));
  };
  return {whole(std::min(near, far)), whole(std::max(near, far))};
}

bool raised(const HeightField& field, const SampleGrid& grid, const DrawnSurface& surface,
            const glm::dvec3& relative, const glm::dvec3& eye) {
  const double slack = vertex_slack(field, relative, eye);
  double row_step = field.dy, col_step = field.dx;
  double height = eye.z + relative.z;
  if (field.planet) {
    const glm::dvec3 at = eye + relative;
    height = glm::length(at) - field.radius;
    row_step = glm::length(at) * field.dlat * kRadiansPerDegree;
    col_step = std::max(std::hypot(at.x, at.y), slack) * field.dlon * kRadiansPerDegree;
  }
  const glm::dvec2 place = grid.coordinates(relative, eye);
  const Range rows = around(place.y, kOnSample + slack / row_step, field.rows - 1);
  // The last column of a planet that wraps has the first beside it.
  const Range cols = around(place.x, kOnSample + slack / col_step, field.wraps ? field.cols : field.cols - 1);
  double top = -std::numeric_limits<double>::infinity();
  for (int64_t row = rows.lo; row <= rows.hi; ++row) {
    for (int64_t i = cols.lo; i <= cols.hi; ++i) {
      const int64_t col = i % field.cols, sample = row * field.cols + col;
      if (!surface.covered(sample)) return false;
      top = std::max(top, grid.height(field, row, col) + std::abs(double{surface.deviation(sample)}));
    }
  }
  return height > top + slack + 1e-6 * std::abs(top - height);  // deviations are floats
}

}  // namespace

int64_t raised_fillers(const HeightField& field, const SampleGrid& grid, const DrawnSurface& surface,
                       const render::Captured& captured) {
  struct High {
    int64_t triangle;
    Place vertex;
  };
  std::vector<High> high;
  std::mutex mutex;
  parallel_for(captured.triangles(), 16384, [&](int64_t begin, int64_t end) {
    for (int64_t t = begin; t < end; ++t) {
      const render::CapturedVertex* v = &captured.vertices[static_cast<size_t>(3 * t)];
      if (!is_filler(v)) continue;
      for (int i = 0; i < 3; ++i) {
        if (!raised(field, grid, surface, {v[i].x, v[i].y, v[i].z}, captured.eye)) continue;
        const std::lock_guard lock(mutex);
        high.push_back({t, place_of(v[i])});
      }
    }
  });
  if (high.empty()) return 0;
  std::set<Place> shared;  // with the surface, which may peak between samples
  for (const High& h : high) shared.insert(h.vertex);
  std::set<Place> found;
  for (size_t i = 0; i < captured.vertices.size(); i += 3) {
    const render::CapturedVertex* v = &captured.vertices[i];
    const Place corner[3] = {place_of(v[0]), place_of(v[1]), place_of(v[2])};
    if (is_filler(v) || corner[0] == corner[1] || corner[1] == corner[2] || corner[2] == corner[0]) continue;
    for (const Place& at : corner) {
      if (shared.contains(at)) found.insert(at);
    }
  }
  std::set<int64_t> out;
  for (const High& h : high) {
    if (!found.contains(h.vertex)) out.insert(h.triangle);
  }
  return static_cast<int64_t>(out.size());
}

}  // namespace lodlab::instrument
