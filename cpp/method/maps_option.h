// SPDX-License-Identifier: MIT
// The build option `normals`: whether a store has a map of its source's normals (geometry/normals.h). It is
// an option of the build, like a colour raster: what measures a store draws `full` with the same maps.
#pragma once

#include "base/options.h"

namespace lodlab {

OptionSpec normals_option();
bool has_normals(const Options& options);

}  // namespace lodlab
