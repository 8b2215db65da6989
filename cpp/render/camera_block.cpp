// SPDX-License-Identifier: MIT
#include "render/camera_block.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>

#include "base/errors.h"
#include "geometry/angles.h"
#include "geometry/coverage.h"
#include "geometry/two_floats.h"

namespace lodlab::render {
namespace {

static_assert(offsetof(CameraBlock, eye_cell) == 64 && offsetof(CameraBlock, eye_frac) == 72);
static_assert(offsetof(CameraBlock, spacing) == 80 && offsetof(CameraBlock, eye_z) == 88);
static_assert(offsetof(CameraBlock, eye_world) == 96 && offsetof(CameraBlock, tint) == 112);
static_assert(offsetof(CameraBlock, cells) == 128 && offsetof(CameraBlock, eye_low) == 144 &&
              offsetof(CameraBlock, planet) == 160);

constexpr double kFarthestCell = 1 << 30;

/// The eye's place on the grid, (column, row) with fractions.
glm::dvec2 eye_on_grid(const glm::dvec3& eye, const FieldFrame& frame) {
  if (!frame.planet) return {(eye.x - frame.x0) / frame.dx, (frame.y0 - eye.y) / frame.dy};
  const double length = glm::length(eye);
  const double latitude =
      length > 0.0 ? std::asin(std::clamp(eye.z / length, -1.0, 1.0)) * kDegreesPerRadian : 0.0;
  const double east = std::atan2(eye.y, eye.x) * kDegreesPerRadian - frame.lon0;
  return {(east - 360.0 * std::floor(east / 360.0)) / frame.dlon, (frame.lat0 - latitude) / frame.dlat};
}

/// The least depth, near / distance, that rasterizers hold: of its last bits (2^-24) a subpixel's share
/// (2^-16) is no denormal float (2^-126) yet.
constexpr double kLeastDepth = 1e-25;

/// `reach`: how far what is drawn may be from the eye.
void check_depth(const Camera& camera, double reach) {
  const double least = kLeastDepth * reach;
  if (camera.near_plane >= least) return;
  char text[160];
  std::snprintf(
      text, sizeof text,
      "draw: near %.3g is less than 1e-25 of the way to the farthest samples, which leaves no depth "
      "to tell them apart; it is at least %.3g here",
      camera.near_plane, least);
  throw InvalidInput(text);
}

/// What all kinds of sources share.
CameraBlock begin_block(const Camera& camera, double reach) {
  check_depth(camera, reach);
  CameraBlock block = {};
  const glm::dmat4 clip = camera.clip_from_relative();
  for (int i = 0; i < 16; ++i) block.clip_from_relative[i] = static_cast<float>(clip[i / 4][i % 4]);
  for (int i = 0; i < 3; ++i) {
    split(camera.eye[i], block.eye_world[i], block.eye_low[i]);
    block.planet[i] = camera.eye[i];
  }
  return block;
}

}  // namespace

CameraBlock make_camera_block(const Camera& camera, const Box& mesh) {
  return begin_block(camera, reach(mesh, camera.eye));
}

CameraBlock make_camera_block(const Camera& camera, const FieldFrame& frame) {
  CameraBlock block = begin_block(camera, frame.reach(camera.eye));
  const glm::dvec2 at = eye_on_grid(camera.eye, frame);
  for (int i = 0; i < 2; ++i) {
    const double cell = std::clamp(std::floor(at[i]), -kFarthestCell, kFarthestCell);
    block.eye_cell[i] = static_cast<int32_t>(cell);
    block.eye_frac[i] = static_cast<float>(at[i] - cell);
  }
  block.spacing[0] = static_cast<float>(frame.dx);
  block.spacing[1] = static_cast<float>(frame.dy);
  split(camera.eye.z, block.eye_z[0], block.eye_z[1]);
  block.eye_world[3] = static_cast<float>(frame.radius);
  block.planet[3] = frame.radius;
  block.tint[0] = static_cast<float>(frame.z_min);
  // A flat field has one tint, not that of its rounding.
  const double magnitude = std::max({1.0, std::abs(frame.z_min), std::abs(frame.z_max)});
  block.tint[1] = static_cast<float>(std::max(frame.z_max, frame.z_min + 1e-2 * magnitude));
  block.tint[2] = frame.z_min < 0.0 && frame.z_max > 0.0 ? 1.0f : 0.0f;
  block.cells[0] = static_cast<int32_t>(cell_columns(frame));
  block.cells[1] = static_cast<int32_t>(frame.rows - 1);
  return block;
}

}  // namespace lodlab::render
