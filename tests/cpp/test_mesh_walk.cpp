// SPDX-License-Identifier: MIT
// The walk over a target's triangles finds the same maximum as closest points do. No GL.
#include "geometry/mesh_walk.h"

#include <doctest/doctest.h>

#include <cmath>
#include <random>

#include "base/parallel.h"
#include "geometry/mesh_distance.h"

using namespace lodlab;

namespace {

constexpr int64_t kMost = int64_t{1} << 24;

/// A bumpy sheet of 2 n^2 triangles that share vertices; `wild`: with folds, needles and points among them.
WeldedMesh sheet(int n, double bumps, bool wild, std::mt19937& random) {
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  WeldedMesh out;
  const auto at = [n](int i, int j) { return static_cast<uint32_t>(i * (n + 1) + j); };
  for (int i = 0; i <= n; ++i) {
    for (int j = 0; j <= n; ++j) {
      const double x = static_cast<double>(i) / n, y = static_cast<double>(j) / n;
      out.positions.push_back({x, y, 0.2 * std::sin(7.0 * x) * std::cos(5.0 * y) + bumps * uniform(random)});
    }
  }
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      out.faces.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      out.faces.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  }
  if (!wild) return out;
  for (size_t f = 0; f < out.faces.size(); f += 17) {
    if (f % 3 == 0) out.faces[f][1] = out.faces[f][0];
    if (f % 3 == 1)
      out.positions[out.faces[f][2]] = 2.0 * out.positions[out.faces[f][1]] - out.positions[out.faces[f][0]];
    if (f % 3 == 2) out.faces.push_back({out.faces[f][0], out.faces[f][2], at(n / 2, n / 2)});
  }
  return out;
}

double walked(const WeldedMesh& from, const WeldedMesh& to, double at_least = 0.0) {
  const MeshSurface surface(to);
  return walked_distance(from, surface, across_sides(to), 2.0, kMost, at_least);
}

double asked(const WeldedMesh& from, const WeldedMesh& to) {
  const MeshSurface surface(to);
  return largest_distance(from, closest_to_vertices(from, surface), surface, 2.0, kMost);
}

}  // namespace

TEST_CASE("the walk finds what closest points find, on sheets of every fineness, and on wild ones") {
  std::mt19937 random(11);
  for (const bool wild : {false, true}) {
    for (const int coarse : {1, 3, 8}) {
      for (const int fine : {2, 9, 40}) {
        const WeldedMesh a = sheet(coarse, 0.02, wild, random), b = sheet(fine, 0.004, wild, random);
        CAPTURE(wild);
        CAPTURE(coarse);
        CAPTURE(fine);
        CHECK(walked(a, b) == doctest::Approx(asked(a, b)).epsilon(2.0 * kMaxTolerance));
        CHECK(walked(b, a) == doctest::Approx(asked(b, a)).epsilon(2.0 * kMaxTolerance));
        CHECK(walked(a, a) <= 2.0 * kLeastShare);
      }
    }
  }
}

TEST_CASE("what is known to be attained is no less in the end, and threads change nothing") {
  std::mt19937 random(12);
  const WeldedMesh a = sheet(30, 0.01, true, random), b = sheet(12, 0.01, true, random);
  CHECK(walked(a, b, 5.0) == 5.0);
  set_thread_count(1);
  const double alone = walked(a, b);
  set_thread_count(0);
  CHECK(walked(a, b) == alone);
}

TEST_CASE("a spike in the middle of a large triangle is seen from both sides") {
  std::mt19937 random(13);
  WeldedMesh plain = sheet(1, 0.0, false, random), spiked = sheet(40, 0.0, false, random);
  for (auto& p : plain.positions) p.z = 0.0;
  for (auto& p : spiked.positions) p.z = 0.0;
  spiked.positions[20 * 41 + 13].z = 0.3;
  CHECK(walked(spiked, plain) == doctest::Approx(0.3).epsilon(kMaxTolerance));
  CHECK(walked(plain, spiked) == doctest::Approx(asked(plain, spiked)).epsilon(2.0 * kMaxTolerance));
}
