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
#include "instrument/orientation.h"
#include "instrument/pixel_error.h"
#include "instrument/reference.h"
#include "instrument/ruler.h"
#include "render/frame.h"

namespace lodlab::instrument {

/// What is measured.
struct Subject {
  Camera camera{};
  bool on_screen = true;  ///< false: of the camera the eye alone counts, and pixel columns are nan
  render::DrawCall draw;  ///< the cut
  std::shared_ptr<const render::Captured> captured;  ///< not null: it is no cut, and these are its triangles
  render::DrawCall draw_before;                      ///< the cut of the frame before; may be empty
  std::string drawn_by;                              ///< for messages
  NodeBound bound;             ///< empty: nothing is claimed, and what is measured is taken
  bool bound_promised = true;  ///< false: what is measured is taken where it is more
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
  Measurement(std::shared_ptr<const Ruler> ruler, std::shared_ptr<const render::Surface> resources,
              Subject subject);
  Measurement(const Measurement&) = delete;
  Measurement& operator=(const Measurement&) = delete;

  double predicted_px() const { return subject_.predicted_px; }
  double optimum_gap();
  double measured_px_max();
  double measured_px_p99() { return pixels().p99; }
  double measured_px_rms() { return pixels().rms; }
  double measured_max() { return laid_->samples().max; }
  double measured_rms() { return laid_->samples().rms; }
  std::optional<int64_t> hole_samples();
  int64_t measured_samples() { return laid_->samples().samples; }
  int64_t crack_edges() { return ruler_->crack_edges(whole(), bound()); }
  double crack_pixels() { return cracks().pixels; }
  double crack_mask_share() { return cracks().mask_share; }
  double capture_mismatch_pixels();
  double psnr_db();
  double ssim();
  double flip();
  double pop_px_max() { return laid_->jump_px_max(); }
  double pop_area();
  int64_t inverted_triangles() { return orientation().inverted; }
  std::optional<int64_t> slanted_filler_triangles() { return orientation().slanted_fillers; }
  std::optional<int64_t> raised_filler_triangles() { return laid_->raised_fillers(); }
  double measured_max_source_to_drawn() { return laid_->two_sided().max_to_drawn; }
  double measured_max_drawn_to_source() { return laid_->two_sided().max_to_source; }
  double measured_rms_source_to_drawn() { return laid_->two_sided().rms_to_drawn; }
  double measured_rms_drawn_to_source() { return laid_->two_sided().rms_to_source; }
  double drawn_triangles();

  const Camera& camera() const { return subject_.camera; }
  const std::shared_ptr<const Reference>& reference() const { return subject_.reference; }
  /// The picture as drawn, with depth.
  const render::Picture& drawn();
  /// error_picture() of it.
  std::vector<float> error_px();
  std::vector<NodeError> node_errors() { return laid_->node_errors(); }

 private:
  const render::Captured& whole();
  const NodeBound& bound();
  bool compares();  // with the reference picture
  const PixelError& pixels();
  const CrackPixels& cracks();
  const Orientation& orientation();

  std::shared_ptr<const Ruler> ruler_;
  std::shared_ptr<const render::Surface> resources_;
  Subject subject_;
  std::unique_ptr<Laid> laid_;  // refers to this
  std::optional<render::Captured> whole_;
  std::optional<render::Picture> drawn_;
  std::optional<PixelError> pixels_;
  std::optional<CrackPixels> cracks_;
  std::optional<Orientation> orientation_;
  std::optional<double> px_max_;
};

}  // namespace lodlab::instrument
