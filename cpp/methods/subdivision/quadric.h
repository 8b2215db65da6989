// SPDX-License-Identifier: MIT
// Sums of squared distances to planes and points, as functions of where they are measured (Garland and
// Heckbert 1997): x' A x + 2 b' x + c.
#pragma once

#include <algorithm>
#include <glm/glm.hpp>

namespace lodlab::subdivision {

struct Quadric {
  double xx = 0.0, xy = 0.0, xz = 0.0, yy = 0.0, yz = 0.0, zz = 0.0;
  glm::dvec3 b{0.0};
  double c = 0.0;

  void operator+=(const Quadric& q) {
    xx += q.xx, xy += q.xy, xz += q.xz, yy += q.yy, yz += q.yz, zz += q.zz;
    b += q.b;
    c += q.c;
  }
  /// `weight` times the squared distance to the plane through a point, across a unit normal.
  void add_plane(const glm::dvec3& normal, const glm::dvec3& point, double weight) {
    const glm::dvec3 n = weight * normal;
    const double d = -glm::dot(normal, point);
    xx += n.x * normal.x, xy += n.x * normal.y, xz += n.x * normal.z;
    yy += n.y * normal.y, yz += n.y * normal.z, zz += n.z * normal.z;
    b += d * n;
    c += weight * d * d;
  }
  void add_point(const glm::dvec3& point, double weight) {
    xx += weight, yy += weight, zz += weight;
    b -= weight * point;
    c += weight * glm::dot(point, point);
  }
  double at(const glm::dvec3& p) const {
    const glm::dvec3 a(xx * p.x + xy * p.y + xz * p.z, xy * p.x + yy * p.y + yz * p.z,
                       xz * p.x + yz * p.y + zz * p.z);
    return std::max(0.0, glm::dot(p, a + 2.0 * b) + c);
  }
  /// Where it is least; not finite where that is no one point.
  glm::dvec3 least() const {
    const double p = yy * zz - yz * yz, q = xz * yz - xy * zz, r = xy * yz - xz * yy;
    const double s = xx * zz - xz * xz, t = xy * xz - xx * yz, u = xx * yy - xy * xy;
    const double inverse = -1.0 / (xx * p + xy * q + xz * r);
    return inverse *
           glm::dvec3(p * b.x + q * b.y + r * b.z, q * b.x + s * b.y + t * b.z, r * b.x + t * b.y + u * b.z);
  }
};

/// How far affine maps, which say where points move, are from any one motion: sums of squared distances
/// between where they move a point and their mean, as functions of the point.
struct BendQuadric {
  glm::dmat3 squares{0.0}, gradient{0.0};
  glm::dvec3 mixed{0.0}, offset{0.0};
  double offsets = 0.0, weight = 0.0;

  void operator+=(const BendQuadric& q) {
    squares += q.squares, gradient += q.gradient;
    mixed += q.mixed, offset += q.offset;
    offsets += q.offsets, weight += q.weight;
  }
  /// Which moves p by g p + d.
  void add_map(const glm::dmat3& g, const glm::dvec3& d, double w) {
    squares += w * glm::transpose(g) * g, gradient += w * g;
    mixed += w * (d * g), offset += w * d;
    offsets += w * glm::dot(d, d), weight += w;
  }
  void add_to(Quadric& q, double times) const {
    if (!(weight > 0.0)) return;
    const glm::dmat3 a = times * (squares - glm::transpose(gradient) * gradient / weight);
    q.xx += a[0][0], q.xy += a[0][1], q.xz += a[0][2];
    q.yy += a[1][1], q.yz += a[1][2], q.zz += a[2][2];
    q.b += times * (mixed - offset * gradient / weight);
    q.c += times * (offsets - glm::dot(offset, offset) / weight);
  }
};

}  // namespace lodlab::subdivision
