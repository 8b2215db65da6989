// SPDX-License-Identifier: MIT
// One drawn cut, measured. Every figure is a function here, named as its column in instrument.md; what
// several need (the captured triangles, the drawn surface, the picture) is made by the first that asks.
//
// The instrument never trusts a method: it draws the cut, captures what the drawing program emits, and
// measures that. nan: undefined (nothing inside the frustum, nothing drawn in the reference, no frame
// before, or not asked for); inf: a hole, or for psnr_db equal pictures.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "instrument/crack_pixels.h"
#include "instrument/drawn_surface.h"
#include "instrument/instrument.h"
#include "instrument/orientation.h"
#include "instrument/pixel_error.h"
#include "instrument/sample_error.h"
#include "render/frame.h"

namespace lodlab::instrument {

/// What is measured.
struct Subject {
  Camera camera;
  render::DrawCall draw;         ///< the cut
  render::DrawCall draw_before;  ///< the cut of the frame before; may be empty
  std::string drawn_by;          ///< for messages
  double predicted_px = kUndefined;
  std::function<double()> optimum_px;          ///< the least that it could be; may take long; may be empty
  std::shared_ptr<const Reference> reference;  ///< null: the columns that compare with it are nan
  bool pictures = true;                        ///< false: no picture is drawn; geometric columns only
};

/// Belongs to the thread that owns the GL context. Figures throw InvalidInput for a drawn vertex that is not
/// finite, naming method and node.
class Measurement {
 public:
  /// InvalidInput for a reference of another view, and for an eye too far away to part samples.
  Measurement(std::shared_ptr<const Instrument> instrument,
              std::shared_ptr<const render::FieldResources> resources, Subject subject);

  double predicted_px() const { return subject_.predicted_px; }
  double optimum_gap();
  double measured_px_max();
  double measured_px_p99() { return pixels().p99; }
  double measured_px_rms() { return pixels().rms; }
  double measured_max() { return samples().max; }
  double measured_rms() { return samples().rms; }
  int64_t hole_samples() { return samples().holes; }
  int64_t measured_samples() { return samples().samples; }
  int64_t crack_edges();
  double crack_pixels() { return cracks().pixels; }
  double crack_mask_share() { return cracks().mask_share; }
  double capture_mismatch_pixels();
  double psnr_db();
  double ssim();
  double flip();
  double pop_px_max();
  double pop_area();
  int64_t inverted_triangles() { return orientation().inverted; }
  int64_t slanted_filler_triangles() { return orientation().slanted_fillers; }
  int64_t raised_filler_triangles();
  double drawn_triangles();

  const Camera& camera() const { return subject_.camera; }
  const std::shared_ptr<const Reference>& reference() const { return subject_.reference; }
  /// The picture as drawn, with depth.
  const render::Picture& drawn();
  /// error_picture() of it.
  std::vector<float> error_px();
  std::vector<NodeError> node_errors();

 private:
  /// Figures over samples of a source that is read by rows: made together, in one pass over it.
  struct ByRows {
    SampleError samples;
    double px_max = kUndefined, pop_px_max = kUndefined;
  };
  const render::Captured& whole();
  const DrawnSurface& surface();
  const DrawnSurface* before();
  const SampleError& samples();
  const ByRows& by_rows();
  bool compares();  // with the reference picture
  const PixelError& pixels();
  const CrackPixels& cracks();
  const Orientation& orientation();
  DrawnSurface rasterize(const HeightField& field, const SampleGrid& grid, const render::Captured& captured,
                         std::vector<float>* worst) const;
  bool in_memory() const { return instrument_->source().whole() != nullptr; }
  /// Unsupported where the source is read by rows.
  const HeightField& field() const;
  const SampleGrid& grid() const { return instrument_->grid(); }

  std::shared_ptr<const Instrument> instrument_;
  std::shared_ptr<const render::FieldResources> resources_;
  Subject subject_;
  std::optional<render::Captured> whole_;
  std::optional<DrawnSurface> surface_, before_;
  std::vector<float> worst_of_triangle_;  ///< made with surface_
  std::optional<render::Picture> drawn_;
  std::optional<ByRows> by_rows_;
  std::optional<SampleError> samples_;
  std::optional<PixelError> pixels_;
  std::optional<CrackPixels> cracks_;
  std::optional<Orientation> orientation_;
  std::optional<double> px_max_;
};

}  // namespace lodlab::instrument
