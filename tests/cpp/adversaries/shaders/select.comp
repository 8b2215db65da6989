// SPDX-License-Identifier: MIT
// Selection of the family on the GPU, by one group: all nodes have the coarser resolution where its predicted
// error is within the budget, else the finer where the hard budgets allow it. A draw command for each node.
#include "common/projection.h"

layout(local_size_x = 64) in;

struct Node {
  dvec4 lo, hi;  // w: the error at resolution 0, at 1
  uvec4 ranges;  // first index at 0 and 1, indices at 0 and 1
  uvec4 vertices;
};
struct Command {
  uint count, instances, first_index, base_vertex, base_instance;
};

layout(std140, binding = 1) uniform Selection {
  dvec4 planes[5];  // inward normals; w: how far inside
  dvec4 eye;
  dvec4 scale;   // K, near plane, s, pixel error
  ivec4 limits;  // triangles, nodes; how many nodes there are
};
layout(std430, binding = 3) readonly buffer Nodes { Node nodes[]; };
layout(std430, binding = 4) writeonly buffer Commands { Command commands[]; };
layout(std430, binding = 5) writeonly buffer Counts { uvec4 counts; };  // triangles, vertices, nodes

uniform int everything;

struct Sum {
  double worst;  // predicted, at resolution 0
  uint triangles[2], vertices, nodes;
};
shared Sum sums[gl_WorkGroupSize.x];
shared int selected;

double dotted(dvec3 a, dvec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

bool sees(Node node) {
  const dvec3 reach = 0.5lf * (node.hi.xyz - node.lo.xyz);
  const dvec3 middle = 0.5lf * (node.lo.xyz + node.hi.xyz) - eye.xyz;
  for (int i = 0; i < 5; ++i) {
    if (dotted(planes[i].xyz, middle) + dotted(abs(planes[i].xyz), reach) < planes[i].w) return false;
  }
  return true;
}

double predicted(Node node) {
  const dvec3 gap = max(max(node.lo.xyz - eye.xyz, eye.xyz - node.hi.xyz), dvec3(0.0lf));
  return project_strict(node.lo.w, scale.x, sqrt(dotted(gap, gap)), scale.y, scale.z, 1.0lf);
}

void main() {
  const uint first = gl_LocalInvocationID.x, step = gl_WorkGroupSize.x, count = uint(limits.z);
  Sum sum = Sum(0.0lf, uint[2](0u, 0u), 0u, 0u);
  for (uint i = first; i < count; i += step) {
    const Node node = nodes[i];
    if (!sees(node)) continue;
    sum.worst = max(sum.worst, predicted(node));
    for (int r = 0; r < 2; ++r) sum.triangles[r] += node.ranges[2 + r] / 3u;
    sum.vertices += node.vertices.x;
    ++sum.nodes;
  }
  sums[first] = sum;
  barrier();
  if (first == 0u) {
    for (uint i = 1u; i < step; ++i) {
      sum.worst = max(sum.worst, sums[i].worst);
      for (int r = 0; r < 2; ++r) sum.triangles[r] += sums[i].triangles[r];
      sum.vertices += sums[i].vertices;
      sum.nodes += sums[i].nodes;
    }
    const bool nodes_fit = sum.nodes <= uint(limits.y);
    const bool coarse = nodes_fit && sum.triangles[0] <= uint(limits.x) && sum.worst <= scale.w;
    const bool fine = nodes_fit && sum.triangles[1] <= uint(limits.x);
    selected = coarse || !fine ? 0 : 1;
    counts = uvec4(sum.triangles[selected], sum.vertices, sum.nodes, 0u);
  }
  barrier();
  for (uint i = first; i < count; i += step) {
    const Node node = nodes[i];
    const bool shown = everything != 0 || sees(node);
    commands[i] = Command(shown ? node.ranges[2 + selected] : 0u, 1u, node.ranges[selected], 0u, 0u);
  }
}
