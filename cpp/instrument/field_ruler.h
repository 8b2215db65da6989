// SPDX-License-Identifier: MIT
// The ruler of height fields: the drawn surface is rasterized on the samples, and a point corresponds to the
// one above or below it (on a planet: in its direction). A field that is read by rows is measured band by
// band, reading all rows for every measurement.
#pragma once

#include "geometry/height_field.h"
#include "instrument/drawn_surface.h"
#include "instrument/ruler.h"
#include "instrument/sample_grid.h"
#include "instrument/screen.h"

namespace lodlab::instrument {

class FieldRuler final : public Ruler {
 public:
  /// InvalidInput without a source.
  explicit FieldRuler(std::shared_ptr<const FieldSource> source);

  const FieldSource& source() const override { return *source_; }
  const SampleGrid& grid() const { return grid_; }
  std::unique_ptr<Laid> lay(Shown shown) const override;
  bool has_holes() const override { return true; }
  int64_t crack_edges(const render::Captured& captured, const NodeBound& bound) const override;
  Orientation orientation(const render::Captured& captured, const NodeBound& bound) const override;
  bool stands_free(const render::Captured& captured, const Camera& camera) const override;
  bool has_voids() const override { return source_->has_voids(); }
  glm::dvec3 middle() const override;
  double slack(const glm::dvec3& eye) const override;
  void check_near(const glm::dvec3& eye) const override;

  /// Which samples of the source count in a view; it refers to the camera.
  InView in_view(const Camera& camera) const { return InView(*source_, has_voids(), camera); }
  /// Calls visit(part, its grid) for bands of rows, fields by themselves, that have each sample once.
  void for_parts(const std::function<void(const HeightField&, const SampleGrid&)>& visit) const;

 private:
  std::shared_ptr<const FieldSource> source_;
  SampleGrid grid_;
};

/// The number of directed edges without exactly one opposite. Edges along the outer border of the grid
/// (a planet that wraps has no first and last column, and none along a pole) are not counted.
int64_t crack_edges(const SampleGrid& grid, const render::Captured& captured);

/// The deviation at fractional grid coordinates (col, row), clamped to the field.
double interpolated_deviation(const FieldFrame& frame, const DrawnSurface& surface, const glm::dvec2& place);

/// Moves points along local up by `times` the deviation of the drawn surface there (1: from the source to
/// what is drawn; -1: back). All that is given must outlive it.
Correspondence along_up(const FieldFrame& frame, const SampleGrid& grid, const DrawnSurface& surface,
                        const glm::dvec3& eye, double times);

}  // namespace lodlab::instrument
