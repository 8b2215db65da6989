// SPDX-License-Identifier: MIT
// Inside of DrawnSurface: where the two rasterizers (flat, planet) leave the deviations they find.
#pragma once

#include <algorithm>
#include <atomic>

#include "geometry/scan_triangle.h"
#include "instrument/drawn_surface.h"

namespace lodlab::instrument {

/// Takes the drawn heights of one triangle's samples; one a thread.
class SurfaceWriter {
 public:
  /// `keys`: DrawnSurface's, 0 where nothing is. `unsure`: as many, kNothing where nothing is.
  SurfaceWriter(const HeightField& field, const SampleGrid& grid, std::vector<uint32_t>& keys,
                std::vector<uint32_t>& unsure)
      : field_(field), grid_(grid), keys_(keys), unsure_(unsure) {}

  static constexpr uint32_t kNothing = ~0u;

  void start_triangle() { worst_ = -1.0f; }
  float worst() const { return worst_; }

  /// A sample that the triangle covers, at a height between these: the worst counts.
  void put(int64_t row, int64_t col, double low, double high) {
    const size_t sample = static_cast<size_t>(row * field_.cols + col);
    const float deviation = this->deviation(row, col, low, high);
    keep_worst(sample, DrawnSurface::encode(deviation));
    if (field_.valid == nullptr || field_.valid[sample] != 0) worst_ = std::max(worst_, std::abs(deviation));
  }

  /// put() of neighbours in a row of a flat field, at most kMostInScan, at one height each.
  void put_row(int64_t row, int64_t col, const double* heights, int count) {
    const size_t first = static_cast<size_t>(row * field_.cols + col);
    const float* const source = field_.heights + first;
    uint32_t keys[kMostInScan];
    float size[kMostInScan], worst = worst_;
    for (int i = 0; i < count; ++i) {
      const float deviation = static_cast<float>(heights[i] - double{source[i]});
      keys[i] = DrawnSurface::encode(deviation);
      size[i] = std::abs(deviation);
    }
    for (int i = 0; i < count; ++i) {
      keep_worst(first + i, keys[i]);
      if (field_.valid == nullptr || field_.valid[first + i] != 0) worst = std::max(worst, size[i]);
    }
    worst_ = worst;
  }

  /// One that it or a neighbour covers: the best counts, where no triangle covers it for sure.
  void put_unsure(int64_t row, int64_t col, double low, double high) {
    const uint32_t key = DrawnSurface::encode(deviation(row, col, low, high));
    const std::atomic_ref<uint32_t> slot(unsure_[static_cast<size_t>(row * field_.cols + col)]);
    uint32_t seen = slot.load(std::memory_order_relaxed);
    while (seen > key && !slot.compare_exchange_weak(seen, key, std::memory_order_relaxed)) {
    }
  }

 private:
  void keep_worst(size_t sample, uint32_t key) {
    const std::atomic_ref<uint32_t> slot(keys_[sample]);
    uint32_t seen = slot.load(std::memory_order_relaxed);
    while (seen < key && !slot.compare_exchange_weak(seen, key, std::memory_order_relaxed)) {
    }
  }
  float deviation(int64_t row, int64_t col, double low, double high) const {
    const double source = grid_.height(field_, row, col);
    return static_cast<float>(low > source ? low - source : std::min(high - source, 0.0));
  }

  const HeightField& field_;
  const SampleGrid& grid_;
  std::vector<uint32_t>& keys_;
  std::vector<uint32_t>& unsure_;
  float worst_ = -1.0f;
};

/// Three vertices of one captured triangle.
using TriangleVertices = const render::CapturedVertex*;

/// Rasterizes one triangle of a flat field.
class FlatRasterizer {
 public:
  FlatRasterizer(const SampleGrid& grid, const glm::dvec3& eye);
  void draw(TriangleVertices vertices, SurfaceWriter& out) const;

 private:
  GridCorner corner(const render::CapturedVertex& vertex) const;

  const FieldFrame& frame_;
  glm::dvec3 eye_;
  int64_t rows_, cols_;
  glm::dvec3 origin_;  ///< the eye relative to the first sample, in cells (x, y), and its height
  double cells_x_, cells_y_;
};

/// Rasterizes one triangle of a planet: samples' rays from the centre against it. Where a corner is at no
/// sample for sure, the triangle belongs within the slack of where it is drawn: it covers for sure what is
/// farther inside, at any height that it has within the slack.
class PlanetRasterizer {
 public:
  PlanetRasterizer(const SampleGrid& grid, const glm::dvec3& eye) : grid_(grid), eye_(eye) {}
  void draw(TriangleVertices vertices, SurfaceWriter& out) const;

 private:
  struct Corner {
    glm::dvec3 up;  ///< from the planet's centre, of length 1
    double radius;  ///< its distance from there
    double col, row;
    double slack;  ///< radians; 0: the corner is on a sample's ray
    bool pole;
  };
  struct Range {
    int64_t row_lo, row_hi, col_lo, col_hi;  ///< columns of a planet that wraps may lie outside [0, cols)
  };
  struct Plane;
  Corner corner(const render::CapturedVertex& vertex) const;
  Range range(const Corner (&corners)[3]) const;
  static double to_nearest(const Corner (&corners)[3], const glm::dvec3& ray, double (&weights)[3]);

  const SampleGrid& grid_;
  glm::dvec3 eye_;
};

}  // namespace lodlab::instrument
