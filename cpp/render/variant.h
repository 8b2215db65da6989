// SPDX-License-Identifier: MIT
// What a surface program is compiled for: the show, and what the field and the pass need.
#pragma once

#include <compare>

#include "render/pass.h"

namespace lodlab::render {

/// LODLAB_SHOW of shaders/common/surface.frag: the values of Show, and two of wire pictures.
inline constexpr int kShowFill = 5;  ///< pale level colours under the lines
inline constexpr int kShowLine = 6;

struct Variant {
  int show = 0;
  SurfaceKind kind = SurfaceKind::kFlat;
  bool coverage = false;
  Maps maps;
  bool feedback = false;  ///< transform feedback captures its vertices
  auto operator<=>(const Variant&) const = default;
};

/// The variant that draws this show. Show::kNone runs the shading's program with the rasterizer off: the
/// vertices cost the same as in a picture.
inline int shader_show(Show show) { return static_cast<int>(show == Show::kNone ? Show::kShade : show); }

}  // namespace lodlab::render
