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

template <class Field>
std::shared_ptr<const Field> not_null(std::shared_ptr<const Field> field) {
  if (field == nullptr) throw InvalidInput("instrument: no height field to measure against");
  return field;
}

}  // namespace

Instrument::Instrument(std::shared_ptr<const HeightField> field)
    : field_(not_null(std::move(field))), grid_(*field_) {}

Instrument::Instrument(std::shared_ptr<const WindowedField> field)
    : windowed_(not_null(std::move(field))), grid_(*windowed_) {}

void Instrument::for_parts(const std::function<void(const HeightField&, const SampleGrid&)>& visit) const {
  if (field_ != nullptr) return visit(*field_, grid_);
  const FieldFrame& whole = *windowed_;
  const int64_t step = windowed_->rows_at_once();
  std::vector<float> heights(static_cast<size_t>(step * whole.cols));
  std::vector<uint8_t> valid(heights.size());
  HeightField part;
  for (int64_t row = 0; row < whole.rows; row += step) {
    static_cast<FieldFrame&>(part) = whole;
    part.rows = std::min(step, whole.rows - row);
    part.y0 = whole.y0 - static_cast<double>(row) * whole.dy;
    part.lat0 = whole.planet ? whole.latitude(row) : whole.lat0;
    part.heights = heights.data();
    part.valid = windowed_->voids > 0 ? valid.data() : nullptr;
    windowed_->read(row, part.rows, heights.data(), valid.data());
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
  if (grid_.size() > kMostPictureSamples) return nullptr;
  auto out = std::make_shared<Reference>();
  out->camera = camera;
  out->shade = render::draw_picture(camera, render::Show::kShade, draw_full);
  const Camera wide = with_margin(camera);
  out->classes = render::draw_picture(wide, render::Show::kClass, draw_full);
  if (has_voids()) {
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

bool Instrument::has_voids() const {
  return field_ != nullptr ? field_->valid != nullptr : windowed_->voids > 0;
}

InView Instrument::in_view(const Camera& camera) const { return InView(grid_.frame(), has_voids(), camera); }

double Instrument::slack(const glm::dvec3& eye) const { return world_slack(grid_.frame().reach(eye)); }

}  // namespace lodlab::instrument
