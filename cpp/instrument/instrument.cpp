// SPDX-License-Identifier: MIT
#include "instrument/instrument.h"

#include <algorithm>
#include <cstdio>
#include <string>

#include "base/errors.h"
#include "geometry/angles.h"
#include "geometry/bounds.h"
#include "instrument/crack_pixels.h"
#include "instrument/slack.h"

namespace lodlab::instrument {
namespace {

std::shared_ptr<const HeightField> not_null(std::shared_ptr<const HeightField> field) {
  if (field == nullptr) throw InvalidInput("instrument: no height field to measure against");
  return field;
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

double Instrument::slack(const glm::dvec3& eye) const {
  if (field_->planet) return world_slack(glm::length(eye) + field_->radius + std::max(0.0, field_->z_max));
  const glm::dvec3 first = field_->position(0, 0, field_->z_min);
  const glm::dvec3 last = field_->position(field_->rows - 1, field_->cols - 1, field_->z_max);
  const glm::dvec3 reach = glm::max(glm::abs(first - eye), glm::abs(last - eye));
  return world_slack(glm::length(reach));
}

}  // namespace lodlab::instrument
