// SPDX-License-Identifier: MIT
// Offscreen targets by size, kept for the next frame of that size, and the state that every pass starts from.
#pragma once

#include "geometry/view.h"
#include "gl/framebuffer.h"

namespace lodlab::render {

/// The neutral state that everything starts from, whatever a method's own passes have left: no culling, depth
/// test GREATER, all of the target written, triangles filled, rasterizer on.
void reset_state();

/// The target of the camera's size, bound, in neutral state. InvalidInput when the viewport is larger than
/// the device's.
const gl::Framebuffer& bind_target(int width, int height);

/// Clears colour (four floats) and depth of the bound target.
void clear_target(const float* color);

}  // namespace lodlab::render
