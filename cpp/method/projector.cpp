// SPDX-License-Identifier: MIT
#include "method/projector.h"

#include "base/errors.h"

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

Projection projection_of(const Options& options, bool z_is_up) {
  const std::string& text = options.text("projection");
  if (text == "vertical" && !z_is_up) {
    throw Unsupported(
        "session: option projection = vertical takes z for up, which bounds flat fields only; this source is "
        "a planet or a mesh: projection = strict");
  }
  return text == "paper"      ? Projection::kPaper
         : text == "vertical" ? Projection::kVertical
                              : Projection::kStrict;
}

Projector::Projector(Projection projection, const Camera& camera)
    : kind(projection), K(camera.K), n(camera.near_plane), s(camera.s), eye(camera.eye) {}

}  // namespace lodlab
