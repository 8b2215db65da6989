// SPDX-License-Identifier: MIT
// The options of maps. Of the build: `attribute`, a colour raster, and `normals`, whether a store has a map
// of its source's normals (geometry/normals.h): what measures a store draws `full` with the same maps. Of
// drawing: how fine.
#pragma once

#include "base/options.h"

namespace lodlab {

OptionSpec attribute_option();
OptionSpec normals_option();
OptionSpec texels_option();
bool has_normals(const Options& options);

}  // namespace lodlab
