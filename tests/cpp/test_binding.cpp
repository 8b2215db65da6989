// SPDX-License-Identifier: MIT
// Where the normals of a control mesh and its source go when it is deformed. No GL.
#include <doctest/doctest.h>

#include <cmath>
#include <glm/gtc/constants.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <random>

#include "base/errors.h"
#include "mesh_arrays.h"
#include "methods/subdivision/binding.h"
#include "methods/subdivision/control_mesh.h"

using namespace lodlab;
using namespace lodlab::subdivision;

namespace {

const glm::dvec3 kFar(1000.0, -300.0, 20.0);  ///< from the origin

using Place = std::function<glm::dvec3(double u, double v)>;

/// n x n cells over [0, 1] x [0, 1], outside where u x v points.
std::shared_ptr<const Mesh> swept(uint32_t n, bool closed, const Place& at) {
  testing::Arrays out;
  const uint32_t rows = closed ? n : n + 1;
  for (uint32_t i = 0; i < rows; ++i)
    for (uint32_t j = 0; j < rows; ++j) out.positions.push_back(kFar + at(double(i) / n, double(j) / n));
  const auto vertex = [&](uint32_t i, uint32_t j) { return (i % rows) * rows + j % rows; };
  for (uint32_t i = 0; i < n; ++i) {
    for (uint32_t j = 0; j < n; ++j) {
      const uint32_t a = vertex(i, j), b = vertex(i + 1, j), c = vertex(i + 1, j + 1), d = vertex(i, j + 1);
      out.faces.insert(out.faces.end(), {{a, b, c}, {a, c, d}});
    }
  }
  return testing::mesh_of(out);
}

/// A torus with bumps, 8 by 8 by 2.
std::shared_ptr<const Mesh> torus() {
  return swept(48, true, [](double u, double v) {
    const double a = glm::two_pi<double>() * u, b = glm::two_pi<double>() * v;
    const double tube = 1.0 + 0.04 * std::sin(7.0 * a) * std::cos(3.0 * b), r = 3.0 + tube * std::cos(b);
    return glm::dvec3(r * std::cos(a), r * std::sin(a), tube * std::sin(b));
  });
}

std::shared_ptr<const Mesh> waves() {
  return swept(32, false, [](double u, double v) {
    return glm::dvec3(u, v, 0.05 * std::sin(9.0 * u) * std::cos(7.0 * v));
  });
}

std::shared_ptr<const RestControl> rest_of(const Mesh& source, int64_t target) {
  const ControlMesh control = control_mesh(source, target, {});
  const auto out = std::make_shared<RestControl>();
  out->middle = source.box.center();
  for (const glm::dvec3& p : control.positions) out->positions.push_back(glm::vec3(p));
  out->normals.assign(control.normals.begin(), control.normals.end());
  out->faces = control.faces;
  return out;
}

Pose pose_of(const RestControl& rest, const std::function<glm::dvec3(const glm::dvec3&)>& move) {
  Pose pose;
  for (const glm::dvec3& p : rest_pose(rest)) pose.control.push_back(move(p));
  return pose;
}

/// The largest distance of the carried source's vertices from where `move` takes them.
double largest_gap(const Binding& binding, const Pose& pose,
                   const std::function<glm::dvec3(const glm::dvec3&)>& move) {
  const auto carried = binding.carry(pose);
  double gap = 0.0;
  for (size_t i = 0; i < carried->positions.size(); ++i)
    gap = std::max(gap, glm::distance(carried->positions[i], move(binding.source().positions[i])));
  return gap;
}

glm::dvec3 stays(const glm::dvec3& p) { return p; }

/// Round the axis x = kFar.x - 12, along y.
glm::dvec3 bent(const glm::dvec3& p) {
  const double angle = (p.z - kFar.z) / 12.0, r = p.x - kFar.x + 12.0;
  return {kFar.x - 12.0 + r * std::cos(angle), p.y, kFar.z + r * std::sin(angle)};
}

}  // namespace

TEST_CASE("binding: at rest every vertex is where it was, and every normal the stored one") {
  for (const auto& [source, aside] :
       {std::pair{torus(), 0.01}, std::pair{waves(), 0.1}}) {  // a tenth is border
    const auto rest = rest_of(*source, 200);
    const Binding binding(rest, source);
    CHECK(largest_gap(binding, {rest_pose(*rest)}, stays) <= 1e-12);
    CHECK(binding.aside() < aside);
    const PosedControl posed = posed_control(*rest, {rest_pose(*rest)});
    CHECK(posed.positions == rest->positions);
    CHECK(posed.normals == rest->normals);
    CHECK(posed.folded == 0);
  }
}

TEST_CASE("binding: a rigid motion, and a change of scale, carry all alike") {
  const auto source = torus();
  const auto rest = rest_of(*source, 200);
  const Binding binding(rest, source);
  const glm::dmat4 turn = glm::rotate(glm::dmat4(1.0), 2.0, glm::dvec3(0.3, -0.8, 0.5));
  for (const double scale : {1.0, 3.0}) {
    const auto move = [&](const glm::dvec3& p) {
      return kFar + glm::dvec3(1.0, 2.0, 3.0) + scale * glm::dvec3(turn * glm::dvec4(p - kFar, 0.0));
    };
    const Pose pose = pose_of(*rest, move);
    const PosedControl posed = posed_control(*rest, pose);
    CHECK(posed.folded == 0);
    double gap = 0.0;
    for (size_t i = 0; i < posed.normals.size(); ++i) {
      const glm::dvec3 expected = turn * glm::dvec4(rest->normals[i], 0.0);
      gap = std::max(gap, glm::distance(glm::dvec3(posed.normals[i]), expected));
    }
    CHECK(gap <= 4e-7);                                                 // floats of positions and normals
    if (scale == 1.0) CHECK(largest_gap(binding, pose, move) <= 4e-6);  // heights do not grow
  }
}

TEST_CASE("binding: a bend carries the source near to where it takes space itself") {
  const auto source = torus();
  for (const auto& [target, most] : {std::pair{200, 0.09}, std::pair{1200, 0.02}}) {
    const auto rest = rest_of(*source, target);
    const Binding binding(rest, source);
    CHECK(largest_gap(binding, pose_of(*rest, bent), bent) <= most);
  }
}

TEST_CASE("binding: vertices at equal positions stay together") {
  const auto whole = torus();
  const auto rest = rest_of(*whole, 200);
  std::vector<glm::dvec3> positions;
  std::vector<Face> faces;
  for (const Face& f : whole->faces) {  // each with vertices of its own
    const auto first = static_cast<uint32_t>(positions.size());
    for (const uint32_t v : f) positions.push_back(whole->positions[v]);
    faces.push_back({first, first + 1, first + 2});
  }
  const Binding binding(rest, make_mesh({positions, faces, {}, {}, nullptr}, ""));
  const Pose pose = pose_of(*rest, bent);
  const auto carried = binding.carry(pose), expected = Binding(rest, whole).carry(pose);
  for (size_t t = 0; t < faces.size(); ++t)
    for (size_t k = 0; k < 3; ++k)
      CHECK(carried->positions[3 * t + k] == expected->positions[whole->faces[t][k]]);
}

TEST_CASE("binding: a face that folds over is counted, and carries on") {
  const auto source = waves();
  const auto rest = rest_of(*source, 60);
  const Binding binding(rest, source);
  const double middle = source->box.center().x;
  const auto fold = [&](const glm::dvec3& p) {
    return glm::dvec3(p.x > middle ? 2.0 * middle - p.x : p.x, p.y, p.z);
  };
  const PosedControl posed = posed_control(*rest, pose_of(*rest, fold));
  CHECK(posed.folded > 0);
  CHECK(posed.folded < static_cast<int64_t>(rest->faces.size()));
  CHECK(posed.first_folded >= 0);
  const Pose point = pose_of(*rest, [&](const glm::dvec3&) { return kFar; });
  CHECK(posed_control(*rest, point).folded == static_cast<int64_t>(rest->faces.size()));
  for (const auto& pose : {pose_of(*rest, fold), point})
    for (const glm::dvec3& p : binding.carry(pose)->positions) CHECK(std::isfinite(p.x + p.y + p.z));
}

TEST_CASE("binding: another number of control points is refused") {
  const auto source = waves();
  const auto rest = rest_of(*source, 60);
  Pose pose{rest_pose(*rest)};
  pose.control.pop_back();
  CHECK_THROWS_AS(posed_control(*rest, pose), InvalidInput);
}
