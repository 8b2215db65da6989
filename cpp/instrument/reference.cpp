// SPDX-License-Identifier: MIT
#include "instrument/reference.h"

#include "instrument/crack_pixels.h"

namespace lodlab::instrument {

const Seen& Reference::seen() const {
  std::call_once(once_, [&] { seen_ = instrument::seen(shade); });
  return seen_;
}

int64_t Reference::bytes() const {
  const size_t floats = shade.depth.size() + classes.depth.size() + 5 * shade.rgba.size() / 4;
  return static_cast<int64_t>(shade.rgba.size() + classes.rgba.size() + floats * sizeof(float));
}

std::shared_ptr<Reference> draw_reference(const Ruler& ruler, const Camera& camera,
                                          const render::DrawCall& draw_full) {
  if (ruler.source().samples() > kMostPictureSamples) return nullptr;
  auto out = std::make_shared<Reference>();
  out->camera = camera;
  out->shade = render::draw_picture(camera, render::Show::kShade, draw_full);
  const Camera wide = with_margin(camera);
  out->classes = render::draw_picture(wide, render::Show::kClass, draw_full);
  if (ruler.has_voids()) {
    leave_out_voids(out->classes, render::draw_picture(wide, render::Show::kShade, draw_full));
  }
  keep_margin(out->classes.depth, wide, camera);
  return out;
}

}  // namespace lodlab::instrument
