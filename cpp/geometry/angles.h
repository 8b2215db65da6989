// SPDX-License-Identifier: MIT
// Degrees are the Python face's and a raster's; everything inside is radians.
#pragma once

namespace lodlab {

inline constexpr double kRadiansPerDegree = 0.017453292519943295769;
inline constexpr double kDegreesPerRadian = 57.295779513082320877;

}  // namespace lodlab
