// SPDX-License-Identifier: MIT
#include "methods/subdivision/binding.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>

#include "base/errors.h"
#include "base/parallel.h"
#include "geometry/mesh_repair.h"
#include "geometry/mesh_surface.h"

namespace lodlab::subdivision {
namespace {

constexpr int64_t kGrain = 256;
constexpr int kSteps = 24;                ///< of Newton's: most take four
constexpr double kOutside = 1e-9;         ///< weights of a vertex between two faces may round to this below 0
constexpr double kAround[] = {2.0, 8.0};  ///< distances to the closest face within which faces are tried

/// Corners of a face, in double.
Triangle corners(std::span<const glm::vec3> of, const Face& face) {
  return {glm::dvec3(of[face[0]]), glm::dvec3(of[face[1]]), glm::dvec3(of[face[2]])};
}

glm::dvec3 area_normal(const Triangle& t) { return glm::cross(t[1] - t[0], t[2] - t[0]); }

/// The frame of a triangle, unit and right-handed: along its first edge, in its plane, outside; and where
/// corners 1 and 2 lie in it.
struct Frame {
  glm::dmat3 axes{1.0};
  double length = 0.0;  ///< of the first edge; 0: the triangle has no area
  glm::dvec2 third{0.0};

  explicit Frame(const Triangle& t) {
    const glm::dvec3 edge = t[1] - t[0], normal = area_normal(t);
    const double size = glm::length(edge), area = glm::length(normal);
    if (!(size > 0.0 && area > 0.0)) return;
    length = size;
    axes[0] = edge / size;
    axes[2] = normal / area;
    axes[1] = glm::cross(axes[2], axes[0]);
    third = {glm::dot(t[2] - t[0], axes[0]), area / size};
  }
};

/// The rotation nearest to what takes one triangle to another; none where either has no area.
std::optional<glm::dmat3> rotation(const Triangle& rest, const Triangle& posed) {
  const Frame from(rest), to(posed);
  if (from.length == 0.0 || to.length == 0.0) return std::nullopt;
  // In the planes [a, b; 0, d], columns the images of the axes: its rotation has cosine a + d and sine -b,
  // scaled.
  const double a = to.length / from.length, d = to.third.y / from.third.y;
  const double b = (to.third.x - a * from.third.x) / from.third.y;
  const glm::dvec2 turn = glm::normalize(glm::dvec2(a + d, -b));
  const glm::dmat3 in_plane(turn.x, turn.y, 0.0, -turn.y, turn.x, 0.0, 0.0, 0.0, 1.0);
  return to.axes * in_plane * glm::transpose(from.axes);
}

/// Whether a face turns from a normal at its corners, or has no area.
bool is_folded(const Triangle& t, const Triangle& normals) {
  const glm::dvec3 normal = area_normal(t);
  return !std::all_of(normals.begin(), normals.end(),
                      [&](const glm::dvec3& n) { return glm::dot(n, normal) > 0.0; });
}

/// Weights, height and the point there, over a face.
struct Over {
  const Triangle& at;
  const Triangle& normals;

  glm::dvec3 normal(double u, double v) const {
    return normals[0] + u * (normals[1] - normals[0]) + v * (normals[2] - normals[0]);
  }
  glm::dvec3 point(double u, double v, double height) const {
    return at[0] + u * (at[1] - at[0]) + v * (at[2] - at[0]) + height * normal(u, v);
  }
  /// Where a point lies: (u, v, height), from a start on; none where no step leads on.
  std::optional<glm::dvec3> solve(const glm::dvec3& target, glm::dvec3 start) const;
};

std::optional<glm::dvec3> Over::solve(const glm::dvec3& target, glm::dvec3 x) const {
  glm::dvec3 off = point(x.x, x.y, x.z) - target;
  for (int step = 0; step < kSteps; ++step) {
    const glm::dmat3 slopes(at[1] - at[0] + x.z * (normals[1] - normals[0]),
                            at[2] - at[0] + x.z * (normals[2] - normals[0]), normal(x.x, x.y));
    const double volume = glm::determinant(slopes);
    if (volume == 0.0) return std::nullopt;
    const glm::dvec3 next = x - glm::inverse(slopes) * off;
    if (!(std::abs(next.x) < 10.0 && std::abs(next.y) < 10.0)) return std::nullopt;
    const glm::dvec3 still_off = point(next.x, next.y, next.z) - target;
    const double before = glm::dot(off, off), after = glm::dot(still_off, still_off);
    if (step > 3 && after >= before) break;
    x = next;
    off = still_off;
    if (after == 0.0) break;
  }
  return x;
}

/// The weights of a point of a triangle's plane.
glm::dvec2 weights_in(const Triangle& t, const glm::dvec3& point) {
  const glm::dvec3 e = t[1] - t[0], f = t[2] - t[0], p = point - t[0], n = glm::cross(e, f);
  const double square = glm::dot(n, n);
  if (square == 0.0) return {0.0, 0.0};
  return {glm::dot(glm::cross(p, f), n) / square, glm::dot(glm::cross(e, p), n) / square};
}

std::vector<glm::dvec3> vertex_normals(const Mesh& mesh, std::span<const uint32_t> first) {
  std::vector<glm::dvec3> out(mesh.positions.size(), glm::dvec3(0.0));
  for (const Face& f : mesh.faces) {
    const glm::dvec3 normal = area_normal({mesh.positions[f[0]], mesh.positions[f[1]], mesh.positions[f[2]]});
    for (const uint32_t vertex : f) out[first[vertex]] += normal;
  }
  return out;
}

}  // namespace

std::vector<glm::vec3> posed_normals(const RestControl& rest, std::span<const glm::vec3> positions) {
  std::vector<glm::dvec3> sum(rest.normals.size(), glm::dvec3(0.0));
  for (const Face& face : rest.faces) {
    const Triangle from = corners(rest.positions, face);
    const auto turned = rotation(from, corners(positions, face));
    if (!turned) continue;
    const glm::dmat3 turn = glm::length(area_normal(from)) * *turned;
    for (const uint32_t vertex : face) sum[vertex] += turn * glm::dvec3(rest.normals[vertex]);
  }
  std::vector<glm::vec3> out = rest.normals;
  for (size_t i = 0; i < out.size(); ++i) {
    const double length =
        glm::length(sum[i]);  // as long as at rest, so that floats round alike where nothing moves
    if (length > 0.0) out[i] = glm::vec3(glm::length(glm::dvec3(out[i])) / length * sum[i]);
  }
  return out;
}

std::vector<glm::dvec3> rest_pose(const RestControl& rest) {
  std::vector<glm::dvec3> out;
  out.reserve(rest.positions.size());
  for (const glm::vec3& p : rest.positions) out.push_back(rest.middle + glm::dvec3(p));
  return out;
}

PosedControl posed_control(const RestControl& rest, const Pose& pose) {
  if (pose.control.size() != rest.positions.size())
    throw InvalidInput("pose: " + std::to_string(pose.control.size()) + " control positions; the store has " +
                       std::to_string(rest.positions.size()));
  PosedControl out;
  out.positions = rest.positions;
  for (size_t i = 0; i < out.positions.size(); ++i) {
    if (pose.control[i] != rest.middle + glm::dvec3(rest.positions[i]))
      out.positions[i] = glm::vec3(pose.control[i] - rest.middle);
  }
  out.normals = posed_normals(rest, out.positions);
  for (size_t f = 0; f < rest.faces.size(); ++f) {
    const Face& face = rest.faces[f];
    if (!is_folded(corners(out.positions, face), corners(out.normals, face)) ||
        is_folded(corners(rest.positions, face), corners(rest.normals, face)))
      continue;
    if (out.folded++ == 0) out.first_folded = static_cast<int64_t>(f);
  }
  return out;
}

// Binding -------------------------------------------------------------------------------------------------

class Binding::Binder {
 public:
  explicit Binder(const RestControl& rest) : rest_(rest), mesh_(welded(rest)), surface_(mesh_) {}

  Bound bind(const glm::dvec3& point, const glm::dvec3& normal) const {
    const auto along = [&](uint32_t face, double) {
      return glm::dot(area_normal(mesh_.triangle(face)), normal) > 0.0;
    };
    Closest near = surface_.closest_within(point, std::numeric_limits<double>::infinity(), along);
    const bool any = near.triangle == kNoTriangle;  // it has no normal, or none along it
    if (any) near = surface_.closest(point);
    std::optional<Bound> best;
    for (const double around : kAround) {
      double least = std::numeric_limits<double>::infinity();
      surface_.any_within(point, around * near.distance, [&](uint32_t face) {
        if (!any && !along(face, 0.0)) return false;
        const std::optional<Bound> found = over(face, point);
        if (!found) return false;
        const double away = std::abs(found->height) * length_of_normal(*found);
        if (away < least || (away == least && face < best->face)) {
          least = away;
          best = found;
        }
        return false;
      });
      if (best) return *best;
    }
    return beside(near, point);
  }

 private:
  static WeldedMesh welded(const RestControl& rest) {
    WeldedMesh out;
    out.positions.assign(rest.positions.begin(), rest.positions.end());
    out.faces = rest.faces;
    return out;
  }

  double length_of_normal(const Bound& at) const {
    const Triangle positions = mesh_.triangle(at.face),
                   normals = corners(rest_.normals, rest_.faces[at.face]);
    return glm::length(Over{positions, normals}.normal(at.u, at.v));
  }

  /// Over the inside of a face, or none.
  std::optional<Bound> over(uint32_t face, const glm::dvec3& point) const {
    const Triangle positions = mesh_.triangle(face), normals = corners(rest_.normals, rest_.faces[face]);
    const glm::dvec3 normal = area_normal(positions);
    const glm::dvec2 foot = weights_in(positions, closest_on_triangle(positions, point).point);
    const double length = glm::length(normal);
    if (length == 0.0) return std::nullopt;
    const double height = glm::dot(point - positions[0], normal) / length;
    const Over over{positions, normals};
    const auto at = over.solve(point, {foot, height});
    if (!at || at->x < -kOutside || at->y < -kOutside || at->x + at->y > 1.0 + kOutside) return std::nullopt;
    return Bound{face, at->x, at->y, at->z, point - over.point(at->x, at->y, at->z), true};
  }

  Bound beside(const Closest& near, const glm::dvec3& point) const {
    const Triangle positions = mesh_.triangle(near.triangle);
    const glm::dvec2 w = weights_in(positions, near.point);
    const Triangle normals = corners(rest_.normals, rest_.faces[near.triangle]);
    return {near.triangle, w.x, w.y, 0.0, point - Over{positions, normals}.point(w.x, w.y, 0.0), false};
  }

  const RestControl& rest_;
  WeldedMesh mesh_;
  MeshSurface surface_;
};

Binding::Binding(std::shared_ptr<const RestControl> rest, std::shared_ptr<const Mesh> source)
    : rest_(std::move(rest)), source_(std::move(source)), bound_(source_->positions.size()) {
  const std::vector<uint32_t> first = first_at_position(source_->positions);
  const std::vector<glm::dvec3> normals = vertex_normals(*source_, first);
  const Binder binder(*rest_);
  parallel_for(static_cast<int64_t>(bound_.size()), kGrain, [&](int64_t begin, int64_t end) {
    for (auto i = static_cast<size_t>(begin); i < static_cast<size_t>(end); ++i) {
      if (first[i] == i) bound_[i] = binder.bind(source_->positions[i] - rest_->middle, normals[i]);
    }
  });
  for (size_t i = 0; i < bound_.size(); ++i) bound_[i] = bound_[first[i]];
}

double Binding::aside() const {
  const auto count = std::count_if(bound_.begin(), bound_.end(), [](const Bound& b) { return !b.inside; });
  return static_cast<double>(count) / static_cast<double>(bound_.size());
}

std::shared_ptr<const Mesh> Binding::carry(const Pose& pose) const {
  const PosedControl posed = posed_control(*rest_, pose);
  std::vector<glm::dmat3> turns(rest_->faces.size());
  for (size_t f = 0; f < turns.size(); ++f) {
    const Face& face = rest_->faces[f];
    turns[f] =
        rotation(corners(rest_->positions, face), corners(posed.positions, face)).value_or(glm::dmat3(1.0));
  }
  const auto moved = std::make_shared<std::vector<glm::dvec3>>(bound_.size());
  parallel_for(static_cast<int64_t>(bound_.size()), 1 << 14, [&](int64_t begin, int64_t end) {
    for (auto i = static_cast<size_t>(begin); i < static_cast<size_t>(end); ++i) {
      const Bound& b = bound_[i];
      const Face& face = rest_->faces[b.face];
      const Triangle positions = corners(posed.positions, face), normals = corners(posed.normals, face);
      (*moved)[i] =
          rest_->middle + (Over{positions, normals}.point(b.u, b.v, b.height) + turns[b.face] * b.left);
    }
  });
  struct Kept {
    std::shared_ptr<const Mesh> source;
    std::shared_ptr<const std::vector<glm::dvec3>> positions;
  };
  MeshArrays arrays = *source_;
  arrays.positions = *moved;
  arrays.normals = {};
  arrays.owner = std::make_shared<Kept>(Kept{source_, moved});
  return make_mesh(arrays, "");
}

}  // namespace lodlab::subdivision
