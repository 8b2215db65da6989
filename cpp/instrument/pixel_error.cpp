// SPDX-License-Identifier: MIT
#include "instrument/pixel_error.h"

#include <algorithm>

#include "instrument/screen.h"

namespace lodlab::instrument {
namespace {

/// The screen distance at every covered pixel from its point to where it corresponds to; kNothing where the
/// picture is empty.
std::vector<double> distances_to(const Correspondence& there, const render::Picture& picture,
                                 const Camera& camera) {
  return over_rows(picture, camera, [&](std::span<const glm::dvec3> points, std::span<double> out) {
    std::vector<glm::dvec3> met(points.size());
    there(points, met);
    for (size_t i = 0; i < points.size(); ++i)
      out[i] = std::isnan(met[i].x) ? kInfinite : screen_distance(camera, points[i], met[i]);
  });
}

}  // namespace

PixelError pixel_error(const Correspondence& to_drawn, const render::Picture& reference,
                       const Camera& camera) {
  return summarize(distances_to(to_drawn, reference, camera));
}

double jumping_share(const Correspondence& before, const Correspondence& after,
                     const render::Picture& reference, const Camera& camera) {
  const auto jumps =
      over_rows(reference, camera, [&](std::span<const glm::dvec3> points, std::span<double> out) {
        std::vector<glm::dvec3> from(points.size()), to(points.size());
        before(points, from);
        after(points, to);
        for (size_t i = 0; i < points.size(); ++i) {
          const bool both = !std::isnan(from[i].x) && !std::isnan(to[i].x);
          out[i] = both ? screen_distance(camera, from[i], to[i]) : kNothing;
        }
      });
  int64_t seen = 0, jumped = 0;
  for (const double distance : jumps) {
    seen += distance >= 0.0 ? 1 : 0;
    jumped += distance > 1.0 ? 1 : 0;
  }
  return seen == 0 ? kUndefined : static_cast<double>(jumped) / static_cast<double>(seen);
}

std::vector<float> error_picture(const Correspondence& to_source, const render::Picture& drawn,
                                 const Camera& camera) {
  const std::vector<double> distances = distances_to(to_source, drawn, camera);
  std::vector<float> out(distances.size());
  std::transform(distances.begin(), distances.end(), out.begin(),
                 [](double distance) { return static_cast<float>(distance < 0.0 ? kUndefined : distance); });
  return out;
}

}  // namespace lodlab::instrument
