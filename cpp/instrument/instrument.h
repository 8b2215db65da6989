// SPDX-License-Identifier: MIT
// The instrument on one height field: everything that an accuracy pass measures of one drawn cut.
// It never trusts a method: it draws the cut, captures what the drawing program emits, and measures that.
// Belongs to the thread that owns the GL context.
#pragma once

#include <cstdint>
#include <memory>

#include "geometry/view.h"
#include "instrument/drawn_surface.h"
#include "instrument/sample_error.h"
#include "render/frame.h"

namespace lodlab::instrument {

/// Sources above this many samples get no reference picture and no picture columns.
inline constexpr int64_t kMostPictureSamples = 32'000'000;

/// What the source at full resolution looks like in one view.
struct Reference {
  Camera camera;
  render::Picture shade;    ///< with depth
  render::Picture classes;  ///< Show::kClass, wider by a margin: see crack_pixels.h
};

/// The accuracy columns of instrument.md. nan: undefined (nothing inside the frustum, nothing drawn in the
/// reference, or not asked for); inf: a hole, or for psnr_db equal pictures.
struct Accuracy {
  double predicted_px = kUndefined;
  double measured_px_max = kUndefined, measured_px_p99 = kUndefined, measured_px_rms = kUndefined;
  double measured_max = kUndefined, measured_rms = kUndefined;
  int64_t hole_samples = 0, measured_samples = 0, crack_edges = 0;
  double crack_pixels = kUndefined, crack_mask_share = kUndefined;
  double capture_mismatch_pixels = kUndefined, psnr_db = kUndefined;
};

class Instrument {
 public:
  explicit Instrument(std::shared_ptr<const HeightField> field);

  const HeightField& field() const { return *field_; }

  /// Draws the reference of a view; null above kMostPictureSamples.
  std::shared_ptr<const Reference> reference(const Camera& camera, const render::DrawCall& draw_full) const;

  struct Wanted {
    double predicted_px = kUndefined;      ///< the method's claim, passed through
    const Reference* reference = nullptr;  ///< null: the columns that compare with it are nan
    bool pictures = true;                  ///< false: no picture is drawn at all; geometric columns only
  };
  /// Measures a drawn cut. Throws InvalidInput for a vertex that is not finite, naming its node, and for
  /// a reference of another view.
  Accuracy measure(const Camera& camera, const render::DrawCall& draw_cut,
                   const render::FieldResources& resources, const Wanted& wanted) const;

  /// From one captured surface to another, under the camera.
  Jump jump(const Camera& camera, const render::Captured& before, const render::Captured& after) const;
  std::vector<NodeError> node_errors(const render::Captured& captured) const;

  /// world_slack() at the sample of the source farthest from the eye (by its bounding box).
  double slack(const glm::dvec3& eye) const;

 private:
  void check_near(const glm::dvec3& eye) const;

  std::shared_ptr<const HeightField> field_;
  SampleGrid grid_;
};

}  // namespace lodlab::instrument
