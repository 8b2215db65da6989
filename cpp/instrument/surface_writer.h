// SPDX-License-Identifier: MIT
// Inside of DrawnSurface: where the two rasterizers (flat, planet) leave the deviations they find.
#pragma once

#include <algorithm>
#include <atomic>

#include "instrument/drawn_surface.h"

namespace lodlab::instrument {

/// Takes the drawn heights of one triangle's samples; one a thread.
class SurfaceWriter {
 public:
  SurfaceWriter(const HeightField& field, const SampleGrid& grid, std::vector<uint32_t>& keys)
      : field_(field), grid_(grid), keys_(keys) {}

  void start_triangle() { worst_ = -1.0f; }
  float worst() const { return worst_; }

  void put(int64_t row, int64_t col, double drawn_height) {
    put_deviation(row, col, drawn_height - grid_.height(field_, row, col));
  }
  void put_deviation(int64_t row, int64_t col, double drawn_minus_source) {
    const size_t sample = static_cast<size_t>(row * field_.cols + col);
    const float deviation = static_cast<float>(drawn_minus_source);
    const uint32_t key = DrawnSurface::encode(deviation);
    const std::atomic_ref<uint32_t> slot(keys_[sample]);
    uint32_t seen = slot.load(std::memory_order_relaxed);
    while (seen < key && !slot.compare_exchange_weak(seen, key, std::memory_order_relaxed)) {
    }
    if (field_.valid == nullptr || field_.valid[sample] != 0) worst_ = std::max(worst_, std::abs(deviation));
  }

 private:
  const HeightField& field_;
  const SampleGrid& grid_;
  std::vector<uint32_t>& keys_;
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
  struct Corner {
    double col, row, z;
    double slack;  ///< cells; 0: the corner is at a sample
  };
  Corner corner(const render::CapturedVertex& vertex) const;
  void fill(const Corner (&corners)[3], SurfaceWriter& out) const;

  const FieldFrame& frame_;
  glm::dvec3 eye_;
  int64_t rows_, cols_;
  glm::dvec3 origin_;  ///< the eye relative to the first sample, in cells (x, y), and its height
  double cells_x_, cells_y_;
};

/// Rasterizes one triangle of a planet: samples' rays from the centre against it. Where a corner is at no
/// sample for sure, what is drawn may lie the slack away: there a sample deviates by what no place within the
/// slack explains.
class PlanetRasterizer {
 public:
  PlanetRasterizer(const HeightField& field, const SampleGrid& grid, const glm::dvec3& eye);
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
  struct Heights {
    float low, high;
  };
  struct Plane;
  Corner corner(const render::CapturedVertex& vertex) const;
  Range range(const Corner (&corners)[3]) const;
  /// Of the source, within the slack of a sample along its row.
  Heights source(int64_t row, int64_t col) const;
  static double to_nearest(const Corner (&corners)[3], const glm::dvec3& ray, double (&weights)[3]);

  const HeightField& field_;
  const SampleGrid& grid_;
  glm::dvec3 eye_;
  std::vector<std::vector<Heights>> together_;  ///< by row; none where columns lie apart
};

}  // namespace lodlab::instrument
