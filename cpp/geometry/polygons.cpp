// SPDX-License-Identifier: MIT
#include "geometry/polygons.h"

#include <numeric>

namespace lodlab {
namespace {

using Points = std::span<const glm::dvec3>;
using Corners = std::span<const uint32_t>;

glm::dvec3 newell_normal(Points points, Corners corners) {
  const glm::dvec3& origin = points[corners[0]];
  glm::dvec3 sum(0.0);
  for (size_t i = 1; i + 1 < corners.size(); ++i)
    sum += glm::cross(points[corners[i]] - origin, points[corners[i + 1]] - origin);
  return sum;
}

/// Above 0 where a, b, c turn left, seen against the normal.
double turn(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c, const glm::dvec3& normal) {
  return glm::dot(glm::cross(b - a, c - a), normal);
}

bool fan_fits(Points points, Corners corners, const glm::dvec3& normal) {
  for (size_t i = 1; i + 1 < corners.size(); ++i) {
    if (turn(points[corners[0]], points[corners[i]], points[corners[i + 1]], normal) < 0.0) return false;
  }
  return true;
}

bool is_ear(Points points, const std::vector<uint32_t>& left, size_t i, const glm::dvec3& normal) {
  const size_t n = left.size(), before = (i + n - 1) % n, after = (i + 1) % n;
  const glm::dvec3 &a = points[left[before]], &b = points[left[i]], &c = points[left[after]];
  if (turn(a, b, c, normal) <= 0.0) return false;
  for (size_t k = 0; k < n; ++k) {
    if (k == before || k == i || k == after) continue;
    const glm::dvec3& p = points[left[k]];
    if (p == a || p == b || p == c) continue;
    if (turn(a, b, p, normal) >= 0.0 && turn(b, c, p, normal) >= 0.0 && turn(c, a, p, normal) >= 0.0)
      return false;
  }
  return true;
}

void cut_ears(Points points, Corners corners, const glm::dvec3& normal, std::vector<Face>& out) {
  std::vector<uint32_t> left(corners.begin(), corners.end());
  while (left.size() > 3) {
    size_t ear = 0;
    while (ear < left.size() && !is_ear(points, left, ear, normal)) ++ear;
    if (ear == left.size()) ear = 1;  // it crosses itself: something has to go
    const size_t n = left.size();
    out.push_back({left[(ear + n - 1) % n], left[ear], left[(ear + 1) % n]});
    left.erase(left.begin() + static_cast<std::ptrdiff_t>(ear));
  }
  out.push_back({left[0], left[1], left[2]});
}

}  // namespace

std::vector<Face> polygon_triangles(Points positions, Corners corners, std::span<const int64_t> sizes) {
  std::vector<Face> out;
  out.reserve(corners.size() / 3);
  size_t begin = 0;
  for (const int64_t size : sizes) {
    const Corners polygon = corners.subspan(begin, static_cast<size_t>(size));
    begin += polygon.size();
    if (size < 3) continue;
    if (size > 3 && size <= kMostCorners) {
      const glm::dvec3 normal = newell_normal(positions, polygon);
      if (!fan_fits(positions, polygon, normal)) {
        cut_ears(positions, polygon, normal, out);
        continue;
      }
    }
    for (size_t i = 1; i + 1 < polygon.size(); ++i) out.push_back({polygon[0], polygon[i], polygon[i + 1]});
  }
  return out;
}

}  // namespace lodlab
