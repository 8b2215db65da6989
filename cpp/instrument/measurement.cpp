// SPDX-License-Identifier: MIT
#include "instrument/measurement.h"

#include <algorithm>
#include <cmath>

#include "base/errors.h"
#include "instrument/picture_difference.h"
#include "instrument/pixel_error.h"
#include "instrument/ssim.h"

namespace lodlab::instrument {
namespace {

void check_view(const Reference& reference, const Camera& camera) {
  const Camera& r = reference.camera;
  if (r.width != camera.width || r.height != camera.height) {
    throw InvalidInput("measure: the reference is " + std::to_string(r.width) + " x " +
                       std::to_string(r.height) + " pixels; the view is " + std::to_string(camera.width) +
                       " x " + std::to_string(camera.height));
  }
  if (r.eye == camera.eye && r.forward == camera.forward && r.right == camera.right && r.K == camera.K &&
      r.near_plane == camera.near_plane) {
    return;
  }
  throw InvalidInput("measure: the reference is of another view");
}

/// A value that is made on first use.
template <class T, class Make>
const T& kept(std::optional<T>& slot, const Make& make) {
  if (!slot) slot.emplace(make());
  return *slot;
}

}  // namespace

Measurement::Measurement(std::shared_ptr<const Ruler> ruler, std::shared_ptr<const render::Surface> resources,
                         Subject subject)
    : ruler_(std::move(ruler)), resources_(std::move(resources)), subject_(std::move(subject)) {
  const Camera& camera = subject_.camera;
  ruler_->check_near(camera.eye);
  std::function<render::Captured()> before;
  if (subject_.draw_before)
    before = [this] { return render::capture(subject_.camera, subject_.draw_before, true); };
  if (!subject_.bound) {
    subject_.bound = [](uint32_t) { return 0.0; };
    subject_.bound_promised = false;
  }
  if (!subject_.bound_promised) {
    subject_.bound = [this, claimed = std::move(subject_.bound)](uint32_t node) {
      return std::max(claimed(node), measured_max());
    };
  }
  laid_ = ruler_->lay({camera, [this]() -> const render::Captured& { return whole(); }, before,
                       subject_.drawn_by, subject_.bound});
  if (!subject_.pictures) subject_.reference = nullptr;
  if (subject_.reference != nullptr) check_view(*subject_.reference, subject_.camera);
}

// What several figures need ---------------------------------------------------------------------------------

/// What is measured is known before many threads ask.
const NodeBound& Measurement::bound() {
  if (!subject_.bound_promised) measured_max();
  return subject_.bound;
}

const render::Captured& Measurement::whole() {
  if (subject_.captured != nullptr) return *subject_.captured;
  return kept(whole_, [&] { return render::capture(subject_.camera, subject_.draw, true); });
}

const render::Picture& Measurement::drawn() {
  return kept(drawn_,
              [&] { return render::draw_picture(subject_.camera, render::Show::kShade, subject_.draw); });
}

double Measurement::optimum_gap() {
  if (!subject_.optimum_px) return kUndefined;
  const double optimum = subject_.optimum_px();
  return subject_.predicted_px == optimum ? 0.0 : subject_.predicted_px / optimum - 1.0;
}

double Measurement::measured_px_max() {
  if (!subject_.on_screen) return kUndefined;
  return kept(px_max_, [&] { return laid_->px_max(); });
}

std::optional<int64_t> Measurement::hole_samples() {
  if (!ruler_->has_holes()) return std::nullopt;
  return laid_->samples().holes;
}

const Orientation& Measurement::orientation() {
  return kept(orientation_, [&] { return ruler_->orientation(whole(), bound()); });
}

// Figures over pixels ---------------------------------------------------------------------------------------

const PixelError& Measurement::pixels() {
  return kept(pixels_, [&] {
    if (subject_.reference == nullptr) return PixelError{};
    return pixel_error(laid_->to_drawn(), subject_.reference->shade, subject_.camera);
  });
}

double Measurement::pop_area() {
  if (subject_.reference == nullptr || !subject_.draw_before) return kUndefined;
  return jumping_share(laid_->to_drawn_before(), laid_->to_drawn(), subject_.reference->shade,
                       subject_.camera);
}

std::vector<float> Measurement::error_px() {
  return error_picture(laid_->to_source(), drawn(), subject_.camera);
}

/// Two empty pictures are no agreement.
bool Measurement::compares() {
  if (subject_.reference == nullptr) return false;
  const auto shows = [](const render::Picture& picture) {
    return std::any_of(picture.depth.begin(), picture.depth.end(), [](float d) { return std::isfinite(d); });
  };
  return shows(subject_.reference->shade) || shows(drawn());
}

double Measurement::psnr_db() {
  return compares() ? lodlab::instrument::psnr_db(drawn(), subject_.reference->shade) : kUndefined;
}

double Measurement::ssim() {
  return compares() ? lodlab::instrument::ssim(drawn(), subject_.reference->shade) : kUndefined;
}

double Measurement::flip() {
  return compares() ? lodlab::instrument::flip(seen(drawn()), subject_.reference->seen()) : kUndefined;
}

double Measurement::drawn_triangles() {
  return subject_.pictures ? static_cast<double>(drawn().triangles) : kUndefined;
}

/// The capture that everything above is measured on, drawn again from a plain buffer: inside the frustum it
/// must be what was drawn with culling.
double Measurement::capture_mismatch_pixels() {
  if (!subject_.pictures || subject_.captured != nullptr) return kUndefined;
  const render::Picture again = render::replay_depth(whole(), subject_.camera, *resources_);
  return static_cast<double>(depth_mismatch_pixels(drawn(), again));
}

const CrackPixels& Measurement::cracks() {
  return kept(cracks_, [&]() -> CrackPixels {
    if (subject_.reference == nullptr) return {};
    const Camera camera = with_margin(subject_.camera);
    const render::Picture& wanted = subject_.reference->classes;
    double error_px =
        std::fmax(pixels().finite_max, pixel_error(laid_->to_drawn(), wanted, camera).finite_max);
    const auto classes = [&](const Camera& from) {
      return render::draw_picture(from, render::Show::kClass, subject_.draw, false);
    };
    render::Picture picture = classes(camera);
    const auto found = [&] {
      return lodlab::instrument::crack_pixels(picture, wanted, subject_.camera.width, subject_.camera.height,
                                              error_px);
    };
    CrackPixels out = found();
    for (int i = 0; i < 4 && out.pixels > 0; ++i) {
      const double right = i % 2 == 0 ? kNudge : -kNudge, down = i / 2 == 0 ? kNudge : -kNudge;
      take_back_slivers(picture, classes(nudged(camera, right, down)));
      out = found();
    }
    if (out.pixels > 0) {  // what moved into sight may hide what did not
      error_px = std::fmax(error_px, finite_max(this->error_px()));
      out = found();
    }
    if (out.pixels > 0 && !ruler_->stands_free(whole(), camera)) out.pixels = kUndefined;
    return out;
  });
}

}  // namespace lodlab::instrument
