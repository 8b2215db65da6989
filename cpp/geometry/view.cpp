// SPDX-License-Identifier: MIT
#include "geometry/view.h"

#include <algorithm>
#include <cstdio>
#include <string>

#include "base/errors.h"
#include "geometry/angles.h"

namespace lodlab {
namespace {

constexpr double kFarthest = 1e36;  // coordinates and their differences fit 32-bit floats
constexpr double kNearest = 1e-36;  // near planes too

std::string text(double value) {
  char buffer[32];
  std::snprintf(buffer, sizeof buffer, "%.9g", value);
  return buffer;
}

std::string text(const glm::dvec3& v) {
  char buffer[96];
  std::snprintf(buffer, sizeof buffer, "(%.9g, %.9g, %.9g)", v.x, v.y, v.z);
  return buffer;
}

bool finite(const glm::dvec3& v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }

void check(const View& view) {
  if (!finite(view.eye)) throw InvalidInput("view: eye " + text(view.eye) + " is not finite");
  if (!finite(view.target)) throw InvalidInput("view: target " + text(view.target) + " is not finite");
  for (const glm::dvec3& point : {view.eye, view.target}) {
    if (glm::any(glm::greaterThan(glm::abs(point), glm::dvec3(kFarthest)))) {
      throw InvalidInput("view: the point " + text(point) + " is not within 1e36 of the origin");
    }
  }
  if (!finite(view.up) || view.up == glm::dvec3(0.0)) {
    throw InvalidInput("view: up " + text(view.up) + " is not a finite direction");
  }
  if (!(view.fov >= 1.0 && view.fov <= 170.0)) {
    throw InvalidInput("view: fov " + text(view.fov) + " degrees is not within 1 to 170");
  }
  if (view.width < 1 || view.width > 16384 || view.height < 1 || view.height > 16384) {
    throw InvalidInput("view: size " + std::to_string(view.width) + " x " + std::to_string(view.height) +
                       " is not within 1 to 16384 pixels a side");
  }
  if (!(glm::length(view.target - view.eye) > 0.0)) {
    throw InvalidInput("view: eye and target are the same point " + text(view.eye) +
                       ": no direction to look");
  }
}

/// The near plane of a view whose eye and target are this far apart.
double near_of(const View& view, double distance) {
  const double near = view.near_plane != 0.0 ? view.near_plane : 1e-4 * distance;
  if (near >= kNearest && near <= kFarthest) return near;
  const char* given = view.near_plane != 0.0 ? "" : " (a ten-thousandth of the way from eye to target)";
  throw InvalidInput("view: near " + text(near) + given + " is not a distance within 1e-36 to 1e36");
}

/// The direction of a vector that is finite and not zero: brought near 1, exactly, as squares of 1e200
/// overflow.
glm::dvec3 direction_of(const glm::dvec3& v) {
  const glm::dvec3 a = glm::abs(v);
  const int exponent = std::ilogb(std::max({a.x, a.y, a.z}));
  const auto scaled = [&](double x) { return std::ldexp(x, -exponent); };
  return glm::normalize(glm::dvec3(scaled(v.x), scaled(v.y), scaled(v.z)));
}

/// The axis of the world least parallel to `direction`, for a camera that looks straight along its up.
glm::dvec3 other_up(const glm::dvec3& direction) {
  const glm::dvec3 a = glm::abs(direction);
  if (a.y <= a.x && a.y <= a.z) return {0.0, 1.0, 0.0};
  return a.x <= a.z ? glm::dvec3(1.0, 0.0, 0.0) : glm::dvec3(0.0, 0.0, 1.0);
}

}  // namespace

void set_planes(Camera& camera) {
  camera.planes = {glm::normalize(camera.tan_h * camera.forward + camera.right),
                   glm::normalize(camera.tan_h * camera.forward - camera.right),
                   glm::normalize(camera.tan_v * camera.forward + camera.up),
                   glm::normalize(camera.tan_v * camera.forward - camera.up), camera.forward};
}

Camera make_camera(const View& view) {
  check(view);
  Camera camera;
  const glm::dvec3 axis = view.target - view.eye;
  camera.eye = view.eye;
  camera.forward = glm::normalize(axis);
  glm::dvec3 side = glm::cross(camera.forward, direction_of(view.up));
  if (glm::length(side) < 1e-9) side = glm::cross(camera.forward, other_up(camera.forward));
  camera.right = glm::normalize(side);
  camera.up = glm::cross(camera.right, camera.forward);
  camera.width = view.width;
  camera.height = view.height;
  camera.near_plane = near_of(view, glm::length(axis));
  camera.tan_h = std::tan(0.5 * view.fov * kRadiansPerDegree);
  camera.tan_v = camera.tan_h * view.height / view.width;
  camera.K = view.width / (2.0 * camera.tan_h);
  camera.s = std::sqrt(1.0 + camera.tan_h * camera.tan_h + camera.tan_v * camera.tan_v);
  set_planes(camera);
  return camera;
}

glm::dmat4 Camera::clip_from_relative() const {
  const glm::dvec3 x = right / tan_h, y = up / tan_v;
  return glm::transpose(glm::dmat4(glm::dvec4(x, 0.0), glm::dvec4(y, 0.0),
                                   glm::dvec4(0.0, 0.0, 0.0, near_plane), glm::dvec4(forward, 0.0)));
}

glm::dmat4 Camera::clip_from_world() const {
  glm::dmat4 move(1.0);
  move[3] = glm::dvec4(-eye, 1.0);
  return clip_from_relative() * move;
}

glm::dvec2 Camera::project(const glm::dvec3& relative) const {
  const double z = depth(relative);
  return {0.5 * width + K * glm::dot(relative, right) / z, 0.5 * height - K * glm::dot(relative, up) / z};
}

bool Camera::sees(const Box& box) const {
  const glm::dvec3 half = 0.5 * (box.hi - box.lo);
  const glm::dvec3 middle = box.center() - eye;
  for (int i = 0; i < 5; ++i) {
    const double reach = glm::dot(glm::abs(planes[i]), half);
    if (glm::dot(planes[i], middle) + reach < (i == 4 ? near_plane : 0.0)) return false;
  }
  return true;
}

}  // namespace lodlab
