// SPDX-License-Identifier: MIT
#include "method/projector.h"

#include <algorithm>
#include <cmath>

#include "base/errors.h"
#include "common/projection.h"

namespace lodlab {

OptionSpec projection_option() {
  return {
      "projection",
      std::string("strict"),
      Stage::kDraw,
      "",
      "How errors become pixels: an upper bound, one for vertical displacement (flat fields only), or the "
      "paper's.",
      {"strict", "vertical", "paper"}};
}

Projection projection_of(const Options& options, const FieldFrame& source) {
  const std::string& text = options.text("projection");
  if (text == "vertical" && source.planet) {
    throw Unsupported(
        "session: option projection = vertical takes z for up, which bounds flat fields only; this source is "
        "a planet: projection = strict");
  }
  return text == "paper"      ? Projection::kPaper
         : text == "vertical" ? Projection::kVertical
                              : Projection::kStrict;
}

Projector::Projector(Projection projection, const Camera& camera)
    : kind(projection), K(camera.K), n(camera.near_plane), s(camera.s), eye(camera.eye) {}

Projector::Place Projector::place(const double (&lo)[3], const double (&hi)[3]) const {
  double square[3];
  for (int i = 0; i < 3; ++i) {
    const double d = std::max({lo[i] - eye[i], eye[i] - hi[i], 0.0});
    square[i] = d * d;
  }
  const double distance = std::sqrt(square[0] + square[1] + square[2]);
  if (kind != Projection::kVertical) return {distance, 1.0};
  const double far_x = std::max(eye.x - lo[0], hi[0] - eye.x);
  const double far_y = std::max(eye.y - lo[1], hi[1] - eye.y);
  return {distance, elevation_cosine(std::sqrt(far_x * far_x + far_y * far_y), std::sqrt(square[2]))};
}

double Projector::project(double delta, const Place& at) const {
  if (kind == Projection::kPaper) return project_paper(delta, K, at.distance, n);
  return project_strict(delta, K, at.distance, n, s, at.cosine);
}

double Projector::inverse(double tau, const Place& at) const {
  if (kind == Projection::kPaper) return inverse_paper(tau, K, at.distance, n);
  return inverse_strict(tau, K, at.distance, n, s, at.cosine);
}

}  // namespace lodlab
