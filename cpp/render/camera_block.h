// SPDX-License-Identifier: MIT
// The uniform block of shaders/common/camera.glsl: one view of one source. Large coordinates are split here,
// in double, so that shaders stay in float.
#pragma once

#include <cstdint>

#include "geometry/bounds.h"
#include "geometry/height_field.h"
#include "geometry/view.h"

namespace lodlab::render {

/// std140 layout of the shader's CameraBlock.
struct CameraBlock {
  float clip_from_relative[16];
  int32_t eye_cell[2];
  float eye_frac[2];
  float spacing[2];
  float eye_z[2];
  float eye_world[4];
  float tint[3];
  float zero;
  int32_t cells[4];
  float eye_low[4];
  double planet[4];
};
static_assert(sizeof(CameraBlock) == 192);

/// InvalidInput for a near plane so near that the depths of far samples vanish.
CameraBlock make_camera_block(const Camera& camera, const FieldFrame& frame);
/// Of a mesh in this box.
CameraBlock make_camera_block(const Camera& camera, const Box& mesh);

}  // namespace lodlab::render
