// SPDX-License-Identifier: MIT
// Which nodes of a planet lie beyond the horizon: hidden by a sphere below all that any cut draws.
//
// No drawn triangle leaves its block, since no stride is larger. Its corners are samples, none of them lower
// than the lowest, in directions within some angle of the block's middle: so the triangle has no point nearer
// to the centre than the lowest sample times the cosine of that angle. A cap of less than a hemisphere holds
// the great circles between its points: a cone round a node's samples holds all that it is drawn with, and
// also those samples of other nodes that its triangles are compared with.
//
// The sphere hides nothing by itself: the ground round it does, where it closes (geometry/horizon.h), seen
// from outside. The way from an eye above the ground to a node that the sphere hides enters the ground before
// it comes to the sphere, and does so beyond the near plane if the ground is farther away than the viewport's
// corner of it. From under the ground one looks into the globe.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "geometry/angles.h"
#include "methods/multigrain/lattice.h"
#include "methods/multigrain/multigrain.h"

namespace lodlab::multigrain {
namespace {

constexpr double kRight = 0.5 * std::numbers::pi;
constexpr double kRounding = 1e-7;  // of an arc cosine, and of sums of angles

struct Cap {
  glm::dvec3 axis{0.0, 0.0, 1.0};
  double angle = std::numbers::pi;  ///< from a hemisphere on: everything
};

/// Round a node's samples: none is farther from the middle than its corners, as long as half its width is
/// within a right angle.
Cap cap_of(const Forest& forest, const Node& n) {
  const Layout& layout = forest.layout;
  const int64_t size = int64_t{1} << layout.node_log2(n.level);
  const int64_t last_row = std::min(n.row + size, layout.last_row());
  const int64_t last_col = std::min(n.col + size, layout.last_col());
  const FieldFrame& frame = forest.frame;
  const double north = frame.latitude(n.row), south = frame.latitude(last_row);
  const double half = 0.5 * static_cast<double>(last_col - n.col) * frame.dlon;
  Cap cap;
  if (half > 90.0) return cap;
  const glm::dvec2 middle = cos_sin_degrees(0.5 * (north + south));
  const glm::dvec2 lon = cos_sin_degrees(frame.longitude(n.col) + half);
  cap.axis = {middle.x * lon.x, middle.x * lon.y, middle.y};
  double least = 1.0;
  for (const double latitude : {north, south}) {
    const glm::dvec2 lat = cos_sin_degrees(latitude);
    least = std::min(least, lat.y * middle.y + lat.x * middle.x * cos_sin_degrees(half).x);
  }
  cap.angle = std::acos(std::clamp(least, -1.0, 1.0)) + kRounding;
  return cap;
}

}  // namespace

Occluder make_occluder(const Forest& forest) {
  const FieldFrame& frame = forest.frame;
  if (!closes(frame, forest.store->has_page(kCoverage, 0))) return {};
  std::vector<Cap> caps;
  double widest = 0.0;  // of blocks
  for (const Node& n : forest.node) {
    caps.push_back(cap_of(forest, n));
    if (n.level + 1 == forest.layout.levels) widest = std::max(widest, caps.back().angle);
  }
  for (size_t i = caps.size(); i-- > 0;) {  // what hides a node hides its children
    if (caps[i].angle >= kRight) caps[i].angle = std::numbers::pi;
    if (forest.node[i].parent < 0) continue;
    Cap& parent = caps[static_cast<size_t>(forest.node[i].parent)];
    const double apart = std::acos(std::clamp(glm::dot(parent.axis, caps[i].axis), -1.0, 1.0));
    parent.angle = std::max(parent.angle, apart + caps[i].angle + kRounding);
  }
  const double lattice = Lattice(frame).error();
  Occluder out;
  if (widest < kRight) out.radius = (frame.radius + frame.z_min - lattice) * std::cos(widest);
  if (!(out.radius > 0.0)) return {};
  const double raised = std::acos(out.radius / (frame.radius + frame.z_max + lattice));
  for (const Cap& cap : caps) {
    const double angle = std::min(cap.angle + raised, std::numbers::pi);
    out.nodes.push_back({cap.axis, std::cos(angle), std::sin(angle)});
    out.ground.push_back({cap.axis, cap.angle, 0.0});
  }
  for (size_t i = caps.size(); i-- > 0;) {
    const Node& n = forest.node[i];
    double& highest = out.ground[i].highest;
    if (n.level + 1 == forest.layout.levels) {
      const int log2 = forest.layout.block_log2();
      const int64_t block = (n.row >> log2) * forest.layout.blocks_x() + (n.col >> log2);
      highest = frame.radius + forest.errors.high[static_cast<size_t>(block)] + lattice;
    }
    if (n.parent < 0) continue;
    double& above = out.ground[static_cast<size_t>(n.parent)].highest;
    above = std::max(above, highest);
  }
  return out;
}

Horizon Forest::horizon(const Camera& camera) const {
  const Horizon none(0.0, camera.eye), all(occluder.radius, camera.eye);
  if (!(occluder.radius > 0.0)) return none;
  const double distance = glm::length(camera.eye), reach = camera.near_plane * camera.s;
  if (!(reach < distance)) return none;
  const double lowest = distance - reach, around = std::asin(reach / distance) + kRounding;
  std::vector<uint32_t> open;
  for (uint32_t i = 0; i < roots; ++i) open.push_back(i);
  while (!open.empty()) {  // only ground as high as the eye, and under it
    const uint32_t i = open.back();
    open.pop_back();
    const Occluder::Ground& ground = occluder.ground[i];
    if (lowest > ground.highest) continue;
    const double angle = ground.angle + around;
    if (angle < kRight && glm::dot(ground.axis, camera.eye) < std::cos(angle) * distance) continue;
    if (node[i].children == 0) return none;
    for (uint32_t c = 0; c < node[i].children; ++c) open.push_back(node[i].first_child + c);
  }
  return all;
}

}  // namespace lodlab::multigrain
