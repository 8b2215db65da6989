// SPDX-License-Identifier: MIT
// One step of the search for the first step of pixel errors that leaves few enough triangles: what a count found.
#include "subdivision/frame.glsl"

layout(local_size_x = 1) in;

void main() {
  if (frame.low < frame.high) {
    const uint middle = (frame.low + frame.high) >> 1;
    if (frame.triangles > frame.most) {
      frame.low = middle + 1u;
    } else {
      frame.high = middle;
    }
  }
  frame.triangles = 0u;
}
