// SPDX-License-Identifier: MIT
// The view of one frame, and the camera that every stage derives from it.
// Conventions: right-handed world, z up; the camera looks along `forward`; clip space has depth
// near / distance (reversed, infinite far plane), y up.
#pragma once

#include <array>
#include <glm/glm.hpp>

#include "geometry/bounds.h"

namespace lodlab {

/// Camera and viewport as the user gives them. `fov` is horizontal, in degrees.
struct View {
  glm::dvec3 eye{0.0};
  glm::dvec3 target{0.0, 1.0, 0.0};
  glm::dvec3 up{0.0, 0.0, 1.0};
  double fov = 60.0;
  int width = 1280;
  int height = 720;
  double near_plane = 0.0;  ///< source units; 0: a ten-thousandth of the distance from eye to target
};

/// A validated view: orthonormal axes, projection constants, frustum.
struct Camera {
  glm::dvec3 eye, right, up, forward;
  int width, height;
  double near_plane;
  double tan_h, tan_v;  ///< tangents of half the fields of view
  double K;             ///< pixels per unit at distance 1: width / (2 tan_h)
  double s;             ///< sqrt(1 + tan_h^2 + tan_v^2): the largest |p| / depth that the viewport sees
  /// Inward unit normals of left, right, bottom, top planes (through the eye) and of the near plane.
  std::array<glm::dvec3, 5> planes;

  /// Clip coordinates from positions relative to the eye (column vectors).
  glm::dmat4 clip_from_relative() const;
  /// Clip coordinates from world positions.
  glm::dmat4 clip_from_world() const;
  /// Pixel coordinates (x right, y down, centre of the top left pixel at 0.5, 0.5) of a point relative
  /// to the eye whose depth is at least near_plane.
  glm::dvec2 project(const glm::dvec3& relative) const;
  /// Distance of a point relative to the eye along the view axis.
  double depth(const glm::dvec3& relative) const { return glm::dot(relative, forward); }
  /// Whether the box may be seen: false only if it lies wholly outside one plane of the frustum.
  bool sees(const Box& box) const;
};

/// Sets the frustum of a camera from its axes and tangents.
void set_planes(Camera& camera);

/// Checks the view and derives its camera. Throws InvalidInput naming the value and the limit:
/// finite numbers, field of view within 1 to 170 degrees, viewport sides from 1 to 16384, eye and
/// target apart, `up` not zero (when parallel to the view axis another one is taken), near from
/// 1e-36 to 1e36.
Camera make_camera(const View& view);

}  // namespace lodlab
