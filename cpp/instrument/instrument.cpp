// SPDX-License-Identifier: MIT
#include "instrument/instrument.h"

#include <algorithm>
#include <cstdio>
#include <string>
#include <vector>

#include "base/errors.h"
#include "geometry/angles.h"
#include "geometry/bounds.h"
#include "instrument/crack_pixels.h"
#include "instrument/slack.h"

namespace lodlab::instrument {
namespace {

std::shared_ptr<const FieldSource> not_null(std::shared_ptr<const FieldSource> source) {
  if (source == nullptr) throw InvalidInput("instrument: no source to measure against");
  return source;
}

}  // namespace

Instrument::Instrument(std::shared_ptr<const FieldSource> source)
    : source_(not_null(std::move(source))), grid_(*source_) {}

void Instrument::for_parts(const std::function<void(const HeightField&, const SampleGrid&)>& visit) const {
  const FieldSource& whole = *source_;
  RowBuffer buffer(true);
  HeightField part;
  for (int64_t row = 0, step = whole.rows_at_once(); row < whole.rows; row += step) {
    const HeightRows rows = whole.read(row, std::min(row + step, whole.rows), buffer);
    static_cast<FieldFrame&>(part) = whole;
    part.rows = rows.end_row - rows.first_row;
    part.y0 = whole.y0 - static_cast<double>(row) * whole.dy;
    part.lat0 = whole.planet ? whole.latitude(row) : whole.lat0;
    part.heights = rows.heights;
    part.valid = rows.valid;
    visit(part, SampleGrid(part));
  }
}

const Seen& Reference::seen() const {
  std::call_once(once_, [&] { seen_ = instrument::seen(shade); });
  return seen_;
}

int64_t Reference::bytes() const {
  const size_t floats = shade.depth.size() + classes.depth.size() + 5 * shade.rgba.size() / 4;
  return static_cast<int64_t>(shade.rgba.size() + classes.rgba.size() + floats * sizeof(float));
}

std::shared_ptr<const Reference> Instrument::reference(const Camera& camera,
                                                       const render::DrawCall& draw_full) const {
  if (source_->samples() > kMostPictureSamples) return nullptr;
  auto out = std::make_shared<Reference>();
  out->camera = camera;
  out->shade = render::draw_picture(camera, render::Show::kShade, draw_full);
  const Camera wide = with_margin(camera);
  out->classes = render::draw_picture(wide, render::Show::kClass, draw_full);
  if (source_->has_voids()) {
    leave_out_voids(out->classes, render::draw_picture(wide, render::Show::kShade, draw_full));
  }
  keep_margin(out->classes.depth, wide, camera);
  return out;
}

void Instrument::check_near(const glm::dvec3& eye) const {
  const FieldFrame& f = grid_.frame();
  double step = f.dlat * kRadiansPerDegree * f.radius, reach = glm::length(eye) + f.radius;
  double off = this->slack(eye);
  if (!f.planet) {
    const glm::dvec3 first = f.position(0, 0, 0.0), last = f.position(f.rows - 1, f.cols - 1, 0.0);
    const glm::dvec3 far = glm::max(glm::abs(first - eye), glm::abs(last - eye));
    const glm::dvec2 slack = grid_slack(f, far, eye);
    const bool east = slack.x * f.dy > slack.y * f.dx;
    step = east ? f.dx : f.dy;
    reach = east ? far.x : far.y;
    off = east ? slack.x : slack.y;
  }
  if (off <= 0.5 * step) return;
  char text[256];
  std::snprintf(
      text, sizeof text,
      "measure: the eye is %.4g m from samples %.4g m apart; 32-bit positions relative to it, up to "
      "%.4g m off, no longer part them (limit: half the spacing)",
      reach, step, off);
  throw InvalidInput(text);
}

InView Instrument::in_view(const Camera& camera) const {
  return InView(*source_, source_->has_voids(), camera);
}

double Instrument::slack(const glm::dvec3& eye) const { return world_slack(grid_.frame().reach(eye)); }

}  // namespace lodlab::instrument
