// SPDX-License-Identifier: MIT
#include "method/maps_option.h"

namespace lodlab {

OptionSpec attribute_option() {
  return {"attribute",
          std::string(),
          Stage::kBuild,
          "",
          "Colour raster of the same extent, drawn on the surface.",
          {}};
}

OptionSpec normals_option() {
  return {"normals",
          std::string("geometric"),
          Stage::kBuild,
          "",
          "Normals that shade: those of the drawn triangles, or the source's at all its samples, as a map.",
          {"geometric", "attribute"}};
}

OptionSpec texels_option() {
  return {"texels_per_pixel",
          1.0,
          Stage::kDraw,
          "",
          "Texels of maps a pixel, whatever the grids; more are sharper and may flicker.",
          {},
          0.125,
          8.0};
}

bool has_normals(const Options& options) { return options.text("normals") == "attribute"; }

}  // namespace lodlab
