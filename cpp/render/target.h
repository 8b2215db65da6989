// SPDX-License-Identifier: MIT
// Offscreen targets by size, kept for the next frame of that size, and the state that every pass starts from.
#pragma once

#include "geometry/view.h"
#include "gl/framebuffer.h"

namespace lodlab::render {

/// The target of the camera's size, bound, with default state: no culling, depth test GREATER, rasterizer
/// on. InvalidInput when the viewport is larger than the device's.
const gl::Framebuffer& bind_target(int width, int height);

/// Clears colour (four floats) and depth of the bound target.
void clear_target(const float* color);

}  // namespace lodlab::render
