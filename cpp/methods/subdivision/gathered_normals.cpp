// SPDX-License-Identifier: MIT
#include "methods/subdivision/gathered_normals.h"

#include <array>
#include <numeric>

#include "base/parallel.h"

namespace lodlab::subdivision {
namespace {

/// Cosine: where the mean of a source vertex's normals is as near to all, no better axis is sought.
constexpr double kNarrow = 0.8;
constexpr size_t kMostPasses = 12;  ///< over all normals, in search of an axis
constexpr int kCoreSteps = 48;      ///< towards the middle of those found to be farthest
constexpr int kOwnSteps = 4096;     ///< of a source vertex, before it is said to fit no half-sphere

/// The axis whose least cosine to any of a few normals is largest, about (Badoiu and Clarkson 2003), and
/// that.
double middle_of(std::span<const glm::dvec3> normals, glm::dvec3& axis, int steps) {
  glm::dvec3 at = axis;
  double best = -2.0;
  for (int step = 0; step < steps; ++step) {
    const double length = glm::length(at);
    if (length < 1e-9) break;
    double least = 2.0;
    glm::dvec3 farthest(0.0);
    for (const glm::dvec3& n : normals) {
      const double cosine = glm::dot(n, at) / length;
      if (cosine < least) least = cosine, farthest = n;
    }
    if (least > best) best = least, axis = at / length;
    at += (farthest - at) / (step + 2.0);
  }
  return best;
}

}  // namespace

GatheredNormals::GatheredNormals(std::span<const Face> faces, std::vector<glm::dvec3> normals,
                                 int64_t vertices, double least)
    : normals_(std::move(normals)),
      begin_(static_cast<size_t>(vertices) + 2, 0),
      around_(3 * faces.size()),
      next_(static_cast<size_t>(vertices), kEnd),
      last_(next_.size()),
      cones_(next_.size()) {
  for (const Face& face : faces)
    for (const uint32_t v : face) ++begin_[v + 2];
  std::partial_sum(begin_.begin(), begin_.end(), begin_.begin());
  for (uint32_t t = 0; t < faces.size(); ++t)
    for (const uint32_t v : faces[t]) around_[begin_[v + 1]++] = t;
  std::iota(last_.begin(), last_.end(), 0u);
  const auto none = static_cast<uint32_t>(normals_.size());
  normals_.push_back(glm::dvec3(0.0));
  parallel_for(vertices, 1 << 12, [&](int64_t first, int64_t end) {
    for (int64_t i = first; i < end; ++i) {
      const auto v = static_cast<uint32_t>(i);
      glm::dvec3 sum(0.0);
      bool any = false;
      for (uint32_t k = begin_[v]; k < begin_[v + 1]; ++k) {
        sum += normals_[around_[k]];
        any = any || normals_[around_[k]] != glm::dvec3(0.0);
      }
      if (!any) continue;
      NormalCone& cone = cones_[v];
      const double length = glm::length(sum);
      cone.axis = length > 1e-9 ? sum / length : glm::dvec3(0.0, 0.0, 1.0);
      double cosine = lowest(cone.axis, v, kEnd, {}).cosine;
      if (cosine < kNarrow) cosine = best_axis(cone.axis, v, kEnd, {}, 1.0);
      if (cosine < least) {
        std::vector<glm::dvec3> own;
        for (uint32_t k = begin_[v]; k < begin_[v + 1]; ++k)
          if (normals_[around_[k]] != glm::dvec3(0.0)) own.push_back(normals_[around_[k]]);
        cosine = middle_of(own, cone.axis, kOwnSteps);
      }
      if (cosine < least) {
        std::fill(around_.begin() + begin_[v], around_.begin() + begin_[v + 1], none);
        continue;
      }
      cone.angle = std::acos(std::clamp(cosine, -1.0, 1.0)) + kConeRounding;
    }
  });
}

GatheredNormals::Lowest GatheredNormals::lowest(const glm::dvec3& axis, uint32_t a, uint32_t b,
                                                std::span<const glm::dvec3> more) const {
  Lowest out;
  const auto see = [&](const glm::dvec3& n) {
    const double cosine = glm::dot(n, axis);
    if (cosine < out.cosine && n != glm::dvec3(0.0)) out = {cosine, n};
  };
  for (const uint32_t list : {a, b})
    for (uint32_t m = list; m != kEnd; m = next_[m])
      for (uint32_t k = begin_[m]; k < begin_[m + 1]; ++k) see(normals_[around_[k]]);
  for (const glm::dvec3& n : more) see(n);
  return out;
}

/// Turns the axis towards the normals that are farthest from it until all are within acos(enough), or until
/// it is seen that those found so far are not. The least cosine.
double GatheredNormals::best_axis(glm::dvec3& axis, uint32_t a, uint32_t b, std::span<const glm::dvec3> more,
                                  double enough) const {
  std::array<glm::dvec3, kMostPasses> core;
  glm::dvec3 trial = axis;
  double best = -2.0;
  for (size_t pass = 0; pass < kMostPasses; ++pass) {
    const Lowest far = lowest(trial, a, b, more);
    if (far.cosine > best) best = far.cosine, axis = trial;
    if (best >= enough) break;
    core[pass] = far.normal;
    const double reach = middle_of(std::span(core).first(pass + 1), trial, kCoreSteps);
    if (reach <= best + 1e-6 || (enough < 1.0 && reach < enough)) break;
  }
  return best;
}

bool GatheredNormals::merge(uint32_t a, uint32_t b, std::span<const glm::dvec3> more, double least,
                            NormalCone& out) const {
  out = merged(cones_[a], cones_[b]);
  return fit(a, b, more, least, out);
}

bool GatheredNormals::turn(uint32_t vertex, std::span<const glm::dvec3> more, double least,
                           NormalCone& out) const {
  out = cones_[vertex];
  return fit(vertex, kEnd, more, least, out);
}

bool GatheredNormals::fit(uint32_t a, uint32_t b, std::span<const glm::dvec3> more, double least,
                          NormalCone& out) const {
  bool fits = out.angle <= std::acos(least);
  for (const glm::dvec3& n : more) fits = fits && (n == glm::dvec3(0.0) || glm::dot(n, out.axis) >= least);
  if (fits) return true;
  if (out.angle < 0.0) {
    if (more.empty()) return true;
    out.axis = more[0];
    return best_axis(out.axis, a, b, more, least) >= least;
  }
  if (best_axis(out.axis, a, b, more, least) < least) return false;
  out.angle = std::acos(std::min(1.0, lowest(out.axis, a, b, {}).cosine)) + kConeRounding;
  return true;
}

void GatheredNormals::join(uint32_t a, uint32_t b, const NormalCone& cone) {
  next_[last_[a]] = b;
  last_[a] = last_[b];
  cones_[a] = cone;
}

glm::dvec3 GatheredNormals::middle(uint32_t vertex, std::span<const glm::dvec3> more) const {
  glm::dvec3 axis = cones_[vertex].axis;
  if (axis == glm::dvec3(0.0)) axis = more.empty() ? glm::dvec3(0.0, 0.0, 1.0) : more[0];
  best_axis(axis, vertex, kEnd, more, 1.0);
  return axis;
}

}  // namespace lodlab::subdivision
