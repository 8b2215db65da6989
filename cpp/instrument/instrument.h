// SPDX-License-Identifier: MIT
// The instrument of one height field: what every measurement of it (measurement.h) shares, and the reference
// pictures that cuts are compared with.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>

#include "geometry/height_rows.h"
#include "geometry/view.h"
#include "instrument/flip.h"
#include "instrument/sample_grid.h"
#include "instrument/screen.h"
#include "render/frame.h"

namespace lodlab::instrument {

/// Sources above this many samples get no reference picture and no picture columns.
inline constexpr int64_t kMostPictureSamples = 32'000'000;

/// What the source at full resolution looks like in one view.
struct Reference {
  Camera camera;
  render::Picture shade;    ///< with depth
  render::Picture classes;  ///< Show::kClass, wider by a margin with depth, less voids: see crack_pixels.h

  /// What FLIP sees of `shade`; made by the first cut that is compared, for all others too.
  const Seen& seen() const;
  /// Bytes that all of it takes.
  int64_t bytes() const;

 private:
  mutable std::once_flag once_;
  mutable Seen seen_;
};

class Instrument {
 public:
  /// Of a source that is read by rows it measures band by band, reading all rows for every measurement.
  explicit Instrument(std::shared_ptr<const FieldSource> source);

  const FieldSource& source() const { return *source_; }
  /// Calls visit(part, its grid) for bands of rows, fields by themselves, that have each sample once.
  void for_parts(const std::function<void(const HeightField&, const SampleGrid&)>& visit) const;
  const SampleGrid& grid() const { return grid_; }

  /// Draws the reference of a view; null above kMostPictureSamples.
  std::shared_ptr<const Reference> reference(const Camera& camera, const render::DrawCall& draw_full) const;

  /// Which samples of the source count in a view; it refers to the camera.
  InView in_view(const Camera& camera) const;

  /// world_slack() at the sample of the source farthest from the eye (by its bounding box).
  double slack(const glm::dvec3& eye) const;

  /// Refuses (InvalidInput) an eye so far away that neighbouring samples fall together: nothing can be told
  /// apart there.
  void check_near(const glm::dvec3& eye) const;

 private:
  std::shared_ptr<const FieldSource> source_;
  SampleGrid grid_;
};

}  // namespace lodlab::instrument
