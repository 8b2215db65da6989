// SPDX-License-Identifier: MIT
#include "instrument/instrument.h"

#include <algorithm>
#include <cstdio>
#include <string>

#include "base/errors.h"
#include "geometry/angles.h"
#include "geometry/bounds.h"
#include "instrument/crack_edges.h"
#include "instrument/crack_pixels.h"
#include "instrument/picture_difference.h"
#include "instrument/pixel_error.h"
#include "instrument/slack.h"

namespace lodlab::instrument {
namespace {

std::shared_ptr<const HeightField> not_null(std::shared_ptr<const HeightField> field) {
  if (field == nullptr) throw InvalidInput("instrument: no height field to measure against");
  return field;
}

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

/// The drawn frame against its own capture, and against the reference where there is one.
void measure_pictures(const Camera& camera, const render::DrawCall& draw_cut,
                      const render::FieldResources& resources, const Reference* reference, Accuracy& out) {
  const render::Picture drawn = render::draw_picture(camera, render::Show::kShade, draw_cut);
  {
    const render::Captured visible = render::capture(camera, draw_cut, false);
    const render::Picture again = render::replay(visible, camera, resources, render::Show::kShade);
    out.capture_mismatch_pixels = static_cast<double>(depth_mismatch_pixels(drawn, again));
  }
  if (reference == nullptr) return;
  out.psnr_db = psnr_db(drawn, reference->shade);
  render::Picture classes = render::draw_picture(camera, render::Show::kClass, draw_cut, false);
  CrackPixels cracks = crack_pixels(classes, reference->classes, out.measured_px_max);
  for (int i = 0; i < 4 && cracks.pixels > 0; ++i) {
    const Camera aside = nudged(camera, i % 2 == 0 ? kNudge : -kNudge, i / 2 == 0 ? kNudge : -kNudge);
    take_back_slivers(classes, render::draw_picture(aside, render::Show::kClass, draw_cut, false));
    cracks = crack_pixels(classes, reference->classes, out.measured_px_max);
  }
  out.crack_pixels = static_cast<double>(cracks.pixels);
  out.crack_mask_share = cracks.mask_share;
}

}  // namespace

Instrument::Instrument(std::shared_ptr<const HeightField> field)
    : field_(not_null(std::move(field))), grid_(*field_) {}

std::shared_ptr<const Reference> Instrument::reference(const Camera& camera,
                                                       const render::DrawCall& draw_full) const {
  if (grid_.size() > kMostPictureSamples) return nullptr;
  auto out = std::make_shared<Reference>();
  out->camera = camera;
  out->shade = render::draw_picture(camera, render::Show::kShade, draw_full);
  out->classes = render::draw_picture(with_margin(camera), render::Show::kClass, draw_full, false);
  return out;
}

/// Refuses an eye so far away that neighbouring samples fall together: nothing can be told apart there.
void Instrument::check_near(const glm::dvec3& eye) const {
  const HeightField& f = *field_;
  const double step = f.planet ? f.dlat * kRadiansPerDegree * f.radius : std::min(f.dx, f.dy);
  double reach = glm::length(eye) + f.radius;
  double resolved = 2.0 * float_step(reach) / step;
  if (!f.planet) {
    const glm::dvec3 first = f.position(0, 0, 0.0), last = f.position(f.rows - 1, f.cols - 1, 0.0);
    const glm::dvec3 far = glm::max(glm::abs(first - eye), glm::abs(last - eye));
    reach = std::max(far.x, far.y);
    resolved = 2.0 * std::max(float_step(far.x) / f.dx, float_step(far.y) / f.dy);
  }
  if (resolved <= 1.0) return;
  char text[256];
  std::snprintf(
      text, sizeof text,
      "measure: the eye is %.4g m from samples %.4g m apart; 32-bit positions relative to it no longer "
      "part them (limit: half the spacing a float step)",
      reach, step);
  throw InvalidInput(text);
}

Accuracy Instrument::measure(const Camera& camera, const render::DrawCall& draw_cut,
                             const render::FieldResources& resources, const Wanted& wanted) const {
  check_near(camera.eye);
  Accuracy out;
  out.predicted_px = wanted.predicted_px;
  const Reference* reference = wanted.pictures ? wanted.reference : nullptr;
  if (reference != nullptr) check_view(*reference, camera);
  {
    const render::Captured whole = render::capture(camera, draw_cut, true);
    const DrawnSurface surface(*field_, grid_, whole);
    const SampleError error = sample_error(*field_, surface);
    out.measured_max = error.max;
    out.measured_rms = error.rms;
    out.hole_samples = error.holes;
    out.measured_samples = error.samples;
    out.measured_px_max = sample_error_px(*field_, grid_, surface, camera);
    out.crack_edges = crack_edges(grid_, whole);
    if (reference != nullptr) {
      const PixelError pixels = pixel_error(*field_, grid_, surface, reference->shade, camera);
      out.measured_px_p99 = pixels.p99;
      out.measured_px_rms = pixels.rms;
    }
  }
  if (wanted.pictures) measure_pictures(camera, draw_cut, resources, reference, out);
  return out;
}

Jump Instrument::jump(const Camera& camera, const render::Captured& before,
                      const render::Captured& after) const {
  const DrawnSurface from(*field_, grid_, before), to(*field_, grid_, after);
  return surface_jump(*field_, grid_, from, to, camera);
}

std::vector<NodeError> Instrument::node_errors(const render::Captured& captured) const {
  return lodlab::instrument::node_errors(*field_, grid_, captured);
}

double Instrument::slack(const glm::dvec3& eye) const {
  if (field_->planet) return world_slack(glm::length(eye) + field_->radius + std::max(0.0, field_->z_max));
  const glm::dvec3 first = field_->position(0, 0, field_->z_min);
  const glm::dvec3 last = field_->position(field_->rows - 1, field_->cols - 1, field_->z_max);
  const glm::dvec3 reach = glm::max(glm::abs(first - eye), glm::abs(last - eye));
  return world_slack(glm::length(reach));
}

}  // namespace lodlab::instrument
