// SPDX-License-Identifier: MIT
// Normals of surfaces whose normals are known on paper, and what 8 bits cost them.
#include "geometry/normals.h"

#include <doctest/doctest.h>

#include <cmath>
#include <random>

#include "geometry/angles.h"
#include "synthetic.h"

using namespace lodlab;

namespace {

double degrees_between(const glm::dvec3& a, const glm::dvec3& b) {
  return std::atan2(glm::length(glm::cross(a, b)), glm::dot(a, b)) * kDegreesPerRadian;
}

/// The largest angle between a field's normals and those expected.
double worst(const HeightField& field, const std::function<glm::dvec3(int64_t row, int64_t col)>& expected) {
  const Normals normals(field);
  double most = 0.0;
  for (int64_t row = 0; row < field.rows; ++row) {
    const std::vector<glm::dvec3> found = normals.row(field, row);
    REQUIRE(static_cast<int64_t>(found.size()) == field.cols);
    for (int64_t col = 0; col < field.cols; ++col)
      most = std::max(most, degrees_between(found[static_cast<size_t>(col)], expected(row, col)));
  }
  return most;
}

}  // namespace

TEST_CASE("a plane has its own normal everywhere, at borders too") {
  FieldFrame frame = synthetic::flat(7, 9, 2.0);
  frame.dy = 5.0;
  const auto field = synthetic::field(frame, [](int64_t row, int64_t col) {
    return static_cast<double>(3 * col - 4 * row);  // z = 1.5 x + 0.8 y
  });
  CHECK(worst(*field, [](int64_t, int64_t) { return glm::dvec3(-1.5, -0.8, 1.0); }) < 1e-6);
}

TEST_CASE("inside, slopes are central differences: exact on a paraboloid") {
  const auto field = synthetic::field(synthetic::flat(11, 11), [](int64_t row, int64_t col) {
    return 0.25 * static_cast<double>((row - 5) * (row - 5) + (col - 5) * (col - 5));
  });
  CHECK(worst(*field, [](int64_t row, int64_t col) {
          const auto slope = [](int64_t at) {  // one-sided at the border
            return at == 0 ? -2.25 : at == 10 ? 2.25 : 0.5 * static_cast<double>(at - 5);
          };
          return glm::dvec3(-slope(col), slope(row), 1.0);
        }) < 1e-6);
}

TEST_CASE("on a sphere they point away from the centre, at poles and where it closes too") {
  const auto field = synthetic::field(synthetic::planet(19, 36), [](int64_t, int64_t) { return 10.0; });
  CHECK(worst(*field, [&](int64_t row, int64_t col) { return field->direction(row, col); }) < 1e-6);
  FieldFrame patch = synthetic::planet(10, 8);  // from a pole down, not round
  patch.wraps = false;
  patch.dlon = 5.0;
  patch.dlat = 4.0;
  const auto part = synthetic::field(patch, [](int64_t, int64_t) { return 0.0; });
  CHECK(worst(*part, [&](int64_t row, int64_t col) { return part->direction(row, col); }) < 1e-6);
}

TEST_CASE("a sphere whose centre lies aside has the normals of that sphere") {
  // |X - c| = 1000: along the direction u, X = u (u.c + sqrt((u.c)^2 + 1000^2 - c^2)).
  const glm::dvec3 centre(12.0, -7.0, 9.0);
  FieldFrame frame = synthetic::planet(181, 360);
  const auto position = [&](int64_t row, int64_t col) {
    const glm::dvec3 u = frame.direction(row, col);
    const double along = glm::dot(u, centre);
    return u * (along + std::sqrt(along * along + 1e6 - glm::dot(centre, centre)));
  };
  const auto field = synthetic::field(
      frame, [&](int64_t row, int64_t col) { return glm::length(position(row, col)) - 1000.0; });
  // Without a metric of the sphere it would be off by 0.9 degrees, the angle between u and X - c.
  CHECK(worst(*field, [&](int64_t row, int64_t col) { return position(row, col) - centre; }) < 0.02);
}

TEST_CASE("texels keep level ground and axes, and lose no more than they say") {
  for (const glm::dvec3 axis : {glm::dvec3(0, 0, 1), glm::dvec3(-1, 0, 0), glm::dvec3(0, 1, 0)})
    CHECK(Normals::normal(Normals::texel(axis)) == axis);
  std::mt19937 random(1);
  std::normal_distribution<double> gauss;
  double most = 0.0, sum = 0.0;
  constexpr int kCount = 200'000;
  for (int i = 0; i < kCount; ++i) {
    const glm::dvec3 normal = glm::normalize(glm::dvec3(gauss(random), gauss(random), gauss(random)));
    const double off = degrees_between(normal, Normals::normal(Normals::texel(normal)));
    most = std::max(most, off);
    sum += off * off;
  }
  MESSAGE("degrees: at most ", most, ", root mean square ", std::sqrt(sum / kCount));
  CHECK(most < 0.39);
  CHECK(most > 0.3);
  CHECK(std::sqrt(sum / kCount) < 0.19);
}
