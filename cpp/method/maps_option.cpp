// SPDX-License-Identifier: MIT
#include "method/maps_option.h"

namespace lodlab {

OptionSpec normals_option() {
  return {"normals",
          std::string("geometric"),
          Stage::kBuild,
          "",
          "Normals that shade: those of the drawn triangles, or the source's at all its samples, as a map.",
          {"geometric", "attribute"}};
}

bool has_normals(const Options& options) { return options.text("normals") == "attribute"; }

}  // namespace lodlab
