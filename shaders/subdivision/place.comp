// SPDX-License-Identifier: MIT
// Where the triangles of each face begin, by one group: sums of the counts before. And the command that draws them all.
#include "subdivision/frame.glsl"

layout(local_size_x = 256) in;

layout(std430, binding = 9) buffer Counts { uint counts[]; };  // in: of triangles; out: of those before
shared uint sums[gl_WorkGroupSize.x];

void main() {
  const uint at = gl_LocalInvocationID.x, share = (frame.faces + gl_WorkGroupSize.x - 1u) / gl_WorkGroupSize.x;
  const uint first = min(at * share, frame.faces), last = min(first + share, frame.faces);
  uint sum = 0u;
  for (uint f = first; f < last; ++f) sum += counts[f];
  sums[at] = sum;
  barrier();
  uint before = 0u;
  for (uint i = 0u; i < at; ++i) before += sums[i];
  for (uint f = first; f < last; ++f) {
    const uint count = counts[f];
    counts[f] = before;
    before += count;
  }
  if (at == gl_WorkGroupSize.x - 1u) {
    counts[frame.faces] = before;
    frame.triangles = before;
    frame.command = uint[5](3u * before, 1u, 0u, 0u, 0u);
  }
}
