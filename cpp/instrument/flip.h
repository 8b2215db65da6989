// SPDX-License-Identifier: MIT
// FLIP of two pictures: Andersson, Nilsson, Akenine-Moller, Oskarsson, Astrom and Fairchild, "FLIP: A
// Difference Evaluator for Alternating Images", HPG 2020; low dynamic range, 67 pixels a degree. What is seen
// of one picture (colours behind the eye's contrast sensitivity, edges, points) is apart from the comparison
// of two.
#pragma once

#include <vector>

#include "render/frame.h"

namespace lodlab::instrument {

/// What FLIP sees of a picture, a value a pixel, row by row: colours in L*a*b* with Hunt's adjustment, and
/// how strong an edge and a point is there.
struct Seen {
  int width = 0, height = 0;
  std::vector<float> lightness, a, b, edge, point;
};

Seen seen(const render::Picture& picture);

/// The mean over pixels, 0 for equal pictures, at most 1. InvalidInput for pictures of two sizes.
double flip(const Seen& found, const Seen& wanted);

}  // namespace lodlab::instrument
