// SPDX-License-Identifier: MIT
// Mesh against mesh, on shapes whose distances are known on paper, and against brute force. No GL.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <random>

#include "base/errors.h"
#include "base/parallel.h"
#include "geometry/angles.h"
#include "geometry/mesh_distance.h"
#include "instrument/captured.h"
#include "instrument/mesh_ruler.h"
#include "instrument/pixel_error.h"

using namespace lodlab;
using namespace lodlab::instrument;
using doctest::Approx;

namespace {

using Soup = std::vector<Triangle>;
constexpr double kInf = std::numeric_limits<double>::infinity();

/// What a view adds: figures on screen are nan without it, and those over pixels without a picture.
struct MeshView {
  const Camera* camera = nullptr;
  const render::Picture* reference = nullptr;
};

struct Figures {
  double measured_max, measured_rms, max_to_drawn, max_to_source, rms_to_drawn, rms_to_source;
  double px_max = kUndefined, px_p99 = kUndefined, px_rms = kUndefined;
};

Figures measure(const Soup& source, const Soup& drawn, const MeshView& view = {}) {
  auto positions = std::make_shared<std::vector<glm::dvec3>>();
  auto faces = std::make_shared<std::vector<Face>>();
  for (const Triangle& t : source) {
    const auto first = static_cast<uint32_t>(positions->size());
    positions->insert(positions->end(), t.begin(), t.end());
    faces->push_back({first, first + 1, first + 2});
  }
  const MeshRuler ruler(
      make_mesh({*positions,
                 *faces,
                 {},
                 {},
                 std::make_shared<std::pair<decltype(positions), decltype(faces)>>(positions, faces)},
                ""));
  Camera camera{};
  camera.eye = ruler.middle();
  if (view.camera != nullptr) camera = *view.camera;
  const render::Captured captured =
      drawn.empty() ? render::Captured{camera.eye, {}} : captured_from(drawn, {}, camera.eye);
  const auto laid = ruler.lay({camera, [&]() -> const render::Captured& { return captured; }, {}, "test"});
  const TwoSided both = laid->two_sided();
  Figures out{laid->samples().max, laid->samples().rms, both.max_to_drawn,
              both.max_to_source,  both.rms_to_drawn,   both.rms_to_source};
  if (view.camera != nullptr) out.px_max = laid->px_max();
  if (view.reference != nullptr) {
    const PixelError pixels = pixel_error(laid->to_drawn(), *view.reference, camera);
    out.px_p99 = pixels.p99;
    out.px_rms = pixels.rms;
  }
  return out;
}

template <class Move>
Soup moved(Soup soup, const Move& move) {
  for (Triangle& t : soup) {
    for (glm::dvec3& p : t) p = move(p);
  }
  return soup;
}

/// [x0, x1] x [y0, y1] at height z, n x n cells, each cut from (0, 0) to (1, 1), or the other way.
Soup grid(double x0, double x1, double y0, double y1, int n = 1, double z = 0.0, bool other = false) {
  Soup out;
  const auto at = [&](int i, int j) { return glm::dvec3(x0 + (x1 - x0) * i / n, y0 + (y1 - y0) * j / n, z); };
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      const glm::dvec3 a = at(i, j), b = at(i + 1, j), c = at(i + 1, j + 1), d = at(i, j + 1);
      if (other) {
        out.insert(out.end(), {Triangle{a, b, d}, Triangle{b, c, d}});
      } else {
        out.insert(out.end(), {Triangle{a, b, c}, Triangle{a, c, d}});
      }
    }
  }
  return out;
}

/// The unit cube; no diagonal meets the corner (1, 1, 1).
Soup cube() {
  Soup out;
  for (int axis = 0; axis < 3; ++axis) {
    for (int side = 0; side < 2; ++side) {
      for (const Triangle& t : grid(0.0, 1.0, 0.0, 1.0, 1, side, true)) {
        out.push_back(t);
        for (glm::dvec3& p : out.back()) {
          glm::dvec3 q;
          for (int k = 0; k < 3; ++k) q[(axis + k) % 3] = p[k];
          p = q;
        }
      }
    }
  }
  return out;
}

/// Unit sphere: the icosahedron, its triangles cut in four `levels` times, new corners moved to the sphere.
Soup sphere(int levels) {
  const double phi = 0.5 * (1.0 + std::sqrt(5.0));
  std::vector<glm::dvec3> corners;
  for (int axis = 0; axis < 3; ++axis) {
    for (const double a : {-1.0, 1.0}) {
      for (const double b : {-phi, phi}) {
        glm::dvec3 p(0.0);
        p[(axis + 1) % 3] = a;
        p[(axis + 2) % 3] = b;
        corners.push_back(glm::normalize(p));
      }
    }
  }
  const double edge = 2.0 / std::sqrt(1.0 + phi * phi);
  const auto near = [&](size_t i, size_t j) { return glm::distance(corners[i], corners[j]) < 1.01 * edge; };
  Soup out;
  for (size_t i = 0; i < 12; ++i) {
    for (size_t j = i + 1; j < 12; ++j) {
      for (size_t k = j + 1; k < 12; ++k) {
        if (near(i, j) && near(j, k) && near(i, k)) out.push_back({corners[i], corners[j], corners[k]});
      }
    }
  }
  for (int level = 0; level < levels; ++level) {
    Soup finer;
    for (const auto& [a, b, c] : out) {
      const glm::dvec3 ab = glm::normalize(a + b), bc = glm::normalize(b + c), ca = glm::normalize(c + a);
      finer.insert(finer.end(),
                   {Triangle{a, ab, ca}, Triangle{ab, b, bc}, Triangle{ca, bc, c}, Triangle{ab, bc, ca}});
    }
    out = std::move(finer);
  }
  return out;
}

/// What parts `levels` of refinement of the icosahedron, over the middle of a face. The middle triangle of a
/// refined equilateral one has half the tangent: tan(angle from axis to corner) = tan(angle_0) / 2^levels.
double sagitta(int coarse, int fine) {
  const double inradius = (3.0 * std::sqrt(3.0) + std::sqrt(15.0)) / 12.0 /
                          std::sqrt((5.0 + std::sqrt(5.0)) / 8.0);  // of the circumradius
  const double tangent = std::tan(std::acos(inradius));
  return std::cos(std::atan(tangent / std::exp2(fine))) - std::cos(std::atan(tangent / std::exp2(coarse)));
}

Soup random_soup(int count, uint32_t seed) {
  std::mt19937 engine(seed);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  const auto point = [&] { return glm::dvec3(uniform(engine), uniform(engine), uniform(engine)); };
  Soup out;
  for (int i = 0; i < count; ++i) {
    const glm::dvec3 a = point();
    const double size = std::exp2(-4.0 * std::abs(uniform(engine)));
    out.push_back({a, a + size * point(), a + size * point()});
    if (i % 16 == 5) out.back()[2] = 0.5 * (out.back()[0] + out.back()[1]);  // a segment
    if (i % 16 == 9) out.back()[1] = out.back()[2] = a;                      // a point
  }
  return out;
}

double brute(const Soup& soup, const glm::dvec3& point) {
  double best = kInf;
  for (const Triangle& t : soup) best = std::min(best, closest_on_triangle(t, point).distance);
  return best;
}

bool same_bits(const Figures& a, const Figures& b) { return std::memcmp(&a, &b, sizeof a) == 0; }

/// Looks straight down from 10 above the origin; 1000 pixels a unit at distance 1.
Camera from_above() {
  View view;
  view.eye = {0.0, 0.0, 10.0};
  view.target = {0.0, 0.0, 0.0};
  view.up = {0.0, 1.0, 0.0};
  view.width = view.height = 200;
  view.fov = 2.0 * std::atan(0.1) * kDegreesPerRadian;
  view.near_plane = 0.5;
  return make_camera(view);
}

render::Picture depths(int side, float depth) {
  return {side, side, {}, std::vector<float>(static_cast<size_t>(side * side), depth)};
}

}  // namespace

TEST_CASE("closest point of one triangle: inside, edge, corner; of a segment and a point") {
  const Triangle t{glm::dvec3(0, 0, 0), glm::dvec3(4, 0, 0), glm::dvec3(0, 4, 0)};
  CHECK(closest_on_triangle(t, {1, 1, 3}).point == glm::dvec3(1, 1, 0));
  CHECK(closest_on_triangle(t, {1, 1, 3}).distance == 3.0);
  CHECK(closest_on_triangle(t, {2, -3, 4}).point == glm::dvec3(2, 0, 0));
  CHECK(closest_on_triangle(t, {2, -3, 4}).distance == 5.0);
  CHECK(closest_on_triangle(t, {4, 4, 0}).point == glm::dvec3(2, 2, 0));
  CHECK(closest_on_triangle(t, {-3, -4, 0}).distance == 5.0);
  CHECK(closest_on_triangle(t, {9, -1, 0}).point == t[1]);
  for (const glm::dvec3& corner : t) CHECK(closest_on_triangle(t, corner).distance == 0.0);
  const Triangle segment{glm::dvec3(0), glm::dvec3(1, 0, 0), glm::dvec3(3, 0, 0)};
  CHECK(closest_on_triangle(segment, {2, 2, 0}).point == glm::dvec3(2, 0, 0));
  CHECK(closest_on_triangle(segment, {5, 0, 0}).distance == 2.0);
  const Triangle point{glm::dvec3(1), glm::dvec3(1), glm::dvec3(1)};
  CHECK(closest_on_triangle(point, {1, 1, 3}).distance == 2.0);
}

TEST_CASE("the closest triangle is never lost to floats: brute force over every triangle") {
  for (const double size : {1e-12, 1.0, 3e7}) {
    const WeldedMesh mesh =
        weld(moved(random_soup(300, 1), [&](const glm::dvec3& p) { return size * p; }), {});
    const MeshSurface surface(mesh);
    std::mt19937 engine(7);
    std::normal_distribution<double> normal;
    for (int i = 0; i < 2000; ++i) {
      // From next to a triangle to a thousand times farther than the mesh is large.
      const double spread = size * std::exp2(std::abs(4.0 * normal(engine)) - 4.0);
      const Triangle near = mesh.triangle(i % mesh.triangles());
      const glm::dvec3 point = near[0] + spread * glm::dvec3(normal(engine), normal(engine), normal(engine));
      double best = kInf;
      uint32_t triangle = kNoTriangle;
      for (int64_t t = 0; t < mesh.triangles(); ++t) {
        const double distance = closest_on_triangle(mesh.triangle(t), point).distance;
        if (distance < best) best = distance, triangle = static_cast<uint32_t>(t);
      }
      const Closest closest = surface.closest(point), hinted = surface.closest(point, i % 300);
      CHECK(closest.distance == best);
      CHECK(hinted.distance == best);
      CHECK(hinted.triangle == closest.triangle);
      CHECK(closest.point == hinted.point);
      CHECK(glm::distance(closest.point, point) == Approx(best).epsilon(1e-9));
      if (closest.triangle != triangle)  // roots of different squares may be equal
        CHECK(closest_on_triangle(mesh.triangle(closest.triangle), point).distance == best);
    }
  }
}

TEST_CASE("a mesh against itself is exactly 0, wherever it lies") {
  for (const double far : {0.0, 6.4e6}) {
    for (const Soup& at_home : {cube(), sphere(3), random_soup(200, 3), grid(0, 1, 0, 1, 9)}) {
      const Soup soup = moved(at_home, [&](const glm::dvec3& p) { return p + glm::dvec3(far, 0.3, -far); });
      const Figures a = measure(soup, soup);
      CHECK(a.measured_max == 0.0);
      CHECK(a.measured_rms == 0.0);
      Soup shuffled = soup;
      std::shuffle(shuffled.begin(), shuffled.end(), std::mt19937(1));
      for (Triangle& t : shuffled) std::rotate(t.begin(), t.begin() + 1, t.end());
      CHECK(measure(soup, shuffled).measured_max == 0.0);
    }
  }
}

TEST_CASE("one surface, cut into other triangles, is 0 as well") {
  const auto close_to_nothing = [](const Soup& a, const Soup& b) {
    const Figures accuracy = measure(a, b);
    CHECK(accuracy.measured_max <= 1e-8);
    CHECK(accuracy.measured_rms <= 1e-8);
  };
  close_to_nothing(grid(0, 1, 0, 1), grid(0, 1, 0, 1, 1, 0.0, true));
  close_to_nothing(grid(0, 1, 0, 1, 7), grid(0, 1, 0, 1, 40, 0.0, true));
  close_to_nothing(grid(0, 1, 0, 1), grid(0, 1, 0, 1, 50));  // with cuts that meet corners but for rounding
  // A slanted plane: corners of one no longer lie bit for bit in the other.
  const auto slant = [](const glm::dvec3& p) { return glm::dvec3(p.x, p.y, 0.3 * p.x - 0.7 * p.y + 0.1); };
  close_to_nothing(moved(grid(0, 1, 0, 1, 3), slant), moved(grid(0, 1, 0, 1, 50), slant));
}

TEST_CASE("a mesh drawn with rounded positions is off by the rounding") {
  const Soup source = sphere(4);
  const Soup drawn = moved(source, [](const glm::dvec3& p) { return glm::dvec3(glm::vec3(p)); });
  const Figures a = measure(source, drawn);
  CHECK(a.measured_max > 0.0);
  CHECK(a.measured_max < std::sqrt(3.0) * 0x1p-25);
}

TEST_CASE("a plane translated along its normal") {
  for (const double height : {0.25, 1e-7, 1e4}) {
    const Figures a = measure(grid(0, 1, 0, 1, 5), grid(0, 1, 0, 1, 8, height));
    CHECK(a.max_to_drawn == Approx(height).epsilon(1e-12));
    CHECK(a.max_to_source == Approx(height).epsilon(1e-12));
    CHECK(a.measured_rms == Approx(height).epsilon(1e-12));
  }
}

TEST_CASE("a tilted plane: rms of a linear distance") {
  // Inside the source's outline the drawn plane z = x / 8 is x / 8 above it.
  const Soup drawn =
      moved(grid(0, 1, 0, 1, 3), [](const glm::dvec3& p) { return glm::dvec3(p.x, p.y, p.x / 8.0); });
  const Figures a = measure(grid(-1, 2, -1, 2), drawn);
  CHECK(a.max_to_source == 0.125);
  CHECK(a.rms_to_source == Approx(0.125 / std::sqrt(3.0)).epsilon(1e-12));
}

TEST_CASE("a cube with one corner pulled out") {
  for (const double pull : {0.25, 0.001}) {
    const Soup pulled =
        moved(cube(), [&](const glm::dvec3& p) { return p == glm::dvec3(1.0) ? glm::dvec3(1.0 + pull) : p; });
    const Figures a = measure(cube(), pulled);
    CHECK(a.max_to_source == Approx(std::sqrt(3.0) * pull).epsilon(1e-12));
    // The old corner to the triangle from a face's diagonal to the new one.
    const double run = std::sqrt(2.0) * (0.5 + pull);
    const double expected = std::sqrt(0.5) * pull / std::hypot(run, pull);
    CHECK(a.max_to_drawn == Approx(expected).epsilon(1e-12));
    CHECK(a.measured_max == a.max_to_source);
  }
}

TEST_CASE("spheres of known tessellation: sagitta at the middle of faces, far from any vertex") {
  const std::vector<Soup> spheres = {sphere(0), sphere(1), sphere(3), sphere(5)};
  const int levels[] = {0, 1, 3, 5};
  for (const auto& [coarse, fine] : {std::pair{0, 2}, {0, 3}, {1, 3}, {2, 3}}) {
    const Figures a = measure(spheres[size_t(fine)], spheres[size_t(coarse)]);
    const double expected = sagitta(levels[coarse], levels[fine]);
    CHECK(a.max_to_drawn == Approx(expected).epsilon(kMaxTolerance));
    CHECK(a.max_to_source == Approx(expected).epsilon(kMaxTolerance));
    CHECK(a.measured_rms < a.measured_max);
    CHECK(a.measured_rms > 0.4 * a.measured_max);
  }
}

TEST_CASE("far from the origin") {
  const glm::dvec3 far(6.4e6, -3.1e6, 5.0e5);
  const auto away = [&](const glm::dvec3& p) { return 100.0 * p + far; };
  const Figures here = measure(moved(sphere(3), [](const glm::dvec3& p) { return 100.0 * p; }),
                               moved(sphere(1), [](const glm::dvec3& p) { return 100.0 * p; }));
  const Figures there = measure(moved(sphere(3), away), moved(sphere(1), away));
  CHECK(std::abs(there.max_to_source - 100.0 * sagitta(1, 3)) < 1e-6);
  CHECK(std::abs(there.max_to_drawn - here.max_to_drawn) < 1e-6);
  CHECK(std::abs(there.rms_to_source - here.rms_to_source) < 1e-6);
  const Figures plane = measure(moved(grid(0, 1, 0, 1, 5), away), moved(grid(0, 1, 0, 1, 8, 0.25), away));
  CHECK(std::abs(plane.measured_max - 25.0) < 1e-6);
}

TEST_CASE("a missing part counts one way only") {
  Soup source = grid(0, 1, 0, 1, 2);
  const Soup drawn = source, other = grid(3, 4, 0, 1, 2);
  source.insert(source.end(), other.begin(), other.end());
  const Figures a = measure(source, drawn);
  CHECK(a.max_to_drawn == 3.0);
  CHECK(a.max_to_source == 0.0);
  CHECK(a.rms_to_source == 0.0);
  CHECK(a.rms_to_drawn == Approx(std::sqrt(19.0 / 6.0)).epsilon(1e-12));  // x - 1 over [3, 4]
  CHECK(a.measured_max == 3.0);
  const Figures back = measure(drawn, source);  // the same part added
  CHECK(back.max_to_source == 3.0);
  CHECK(back.max_to_drawn == 0.0);
  CHECK(back.measured_max == 3.0);
}

TEST_CASE("a big triangle over a pit is farthest somewhere inside") {
  // Distances to the pit's sides grow linearly from the edges: where all three are equal, with sines of their
  // slopes, sum(length * distance / sine) = 2 area.
  const Triangle lid{glm::dvec3(0, 0, 0), glm::dvec3(10, 0, 0), glm::dvec3(2, 8, 0)};
  for (const glm::dvec3& foot : {glm::dvec3(4, 8.0 / 3.0, 0), glm::dvec3(3, 1, 0)}) {
    for (const double depth : {0.01, 1.5}) {
      const glm::dvec3 bottom = foot - glm::dvec3(0, 0, depth);
      Soup pit;
      double weights = 0.0;
      for (size_t i = 0; i < 3; ++i) {
        const glm::dvec3 a = lid[i], b = lid[(i + 1) % 3];
        pit.push_back({a, b, bottom});
        const double length = glm::distance(a, b), away = glm::length(glm::cross(b - a, foot - a)) / length;
        weights += length / (depth / std::hypot(depth, away));
      }
      const Figures a = measure(pit, {lid});
      CHECK(a.max_to_drawn == Approx(depth).epsilon(1e-12));
      CHECK(a.max_to_source <= 80.0 / weights * (1.0 + 1e-12));
      CHECK(a.max_to_source == Approx(80.0 / weights).epsilon(kMaxTolerance));
    }
  }
}

TEST_CASE("random triangles: maxima against dense sampling by brute force") {
  for (uint32_t seed = 0; seed < 12; ++seed) {
    const Soup source = random_soup(6 + int(seed), seed), drawn = random_soup(20 - int(seed), seed + 100);
    constexpr int kSteps = 60;
    double sampled = 0.0, spacing = 0.0;
    for (const Triangle& t : source) {
      for (size_t i = 0; i < 3; ++i)
        spacing = std::max(spacing, glm::distance(t[i], t[(i + 1) % 3]) / kSteps);
      for (int i = 0; i <= kSteps; ++i) {
        for (int j = 0; i + j <= kSteps; ++j) {
          const glm::dvec3 p =
              t[0] + (t[1] - t[0]) * (double(i) / kSteps) + (t[2] - t[0]) * (double(j) / kSteps);
          sampled = std::max(sampled, brute(drawn, p));
        }
      }
    }
    const Figures a = measure(source, drawn);
    CHECK(a.max_to_drawn >= sampled * (1.0 - kMaxTolerance));
    CHECK(a.max_to_drawn <= sampled + spacing);
  }
}

TEST_CASE("shares of random triangles: every sampled point is as near to one as that one's distance says") {
  int in_reach = 0, out_of_reach = 0;
  for (uint32_t seed = 0; seed < 24; ++seed) {
    const Soup source = random_soup(8 + int(seed), seed), drawn = random_soup(30 - int(seed), seed + 100);
    const WeldedMesh from = weld(source, {}), to = weld(drawn, {});
    const MeshSurface surface(to);
    constexpr uint32_t kShares = 3;
    Shares shares;
    std::vector<Soup> parts(kShares);
    for (uint32_t i = 0; i < drawn.size(); ++i) {
      shares.of.push_back(i % kShares);
      parts[i % kShares].push_back(drawn[i]);
    }
    std::mt19937 engine(seed);
    std::uniform_real_distribution<double> uniform(0.0, 2.0);
    for (uint32_t i = 0; i < kShares; ++i) shares.reach.push_back(seed % 3 == 0 ? 0.0 : uniform(engine));
    shares.longest = *std::max_element(shares.reach.begin(), shares.reach.end());
    const std::vector<Closest> at = closest_to_vertices(from, surface);
    const std::vector<double> found =
        shared_distances(from, at, surface, shares, std::vector<double>(kShares, 0.0), 4.0, 10'000'000);
    const double farthest = largest_distance(from, at, surface, 4.0, 10'000'000);
    CHECK(*std::max_element(found.begin(), found.end()) >= farthest * (1.0 - kMaxTolerance));
    double most_over = 0.0, farthest_out = -kInf, spacing = 0.0;
    constexpr int kSteps = 24;
    for (const Triangle& t : source) {
      for (size_t i = 0; i < 3; ++i)
        spacing = std::max(spacing, glm::distance(t[i], t[(i + 1) % 3]) / kSteps);
      for (int i = 0; i <= kSteps; ++i) {
        for (int j = 0; i + j <= kSteps; ++j) {
          const glm::dvec3 p =
              t[0] + (t[1] - t[0]) * (double(i) / kSteps) + (t[2] - t[0]) * (double(j) / kSteps);
          double over = kInf, beyond = kInf;
          for (uint32_t share = 0; share < kShares; ++share) {
            const double distance = brute(parts[share], p);
            over = std::min(over, distance - found[share] * (1.0 + kMaxTolerance));
            beyond = std::min(beyond, distance - shares.reach[share]);
          }
          most_over = std::max(most_over, over);
          farthest_out = std::max(farthest_out, beyond);
        }
      }
    }
    CHECK(most_over <= 1e-8);
    // One is found beyond its reach where some point is in reach of none, and nowhere else.
    bool kept = true;
    for (uint32_t i = 0; i < kShares; ++i) kept = kept && found[i] <= shares.reach[i];
    if (farthest_out > 4.0 * kMaxTolerance) {
      ++out_of_reach;
      CHECK_FALSE(kept);
    }
    if (farthest_out < -spacing) {
      ++in_reach;
      CHECK(kept);
    }
    set_thread_count(1);
    CHECK(shared_distances(from, at, surface, shares, std::vector<double>(kShares, 0.0), 4.0, 10'000'000) ==
          found);
    set_thread_count(0);
  }
  CHECK(in_reach >= 3);
  CHECK(out_of_reach >= 8);
}

TEST_CASE("surfaces that are everywhere about as far as they can be end in bounded work") {
  // Along the axis of a tube every point is a maximum, and no one triangle bounds it.
  Soup tube;
  constexpr int kSides = 48;
  for (int i = 0; i < kSides; ++i) {
    const double from = 2.0 * std::acos(-1.0) * i / kSides, to = 2.0 * std::acos(-1.0) * (i + 1) / kSides;
    const glm::dvec3 a(0, std::cos(from), std::sin(from)), b(0, std::cos(to), std::sin(to)), x(20, 0, 0);
    tube.push_back({a - x, b - x, b + x});
    tube.push_back({a - x, b + x, a + x});
  }
  const Soup blade = moved(grid(-10, 10, -0.5, 0.5), [](const glm::dvec3& p) { return p; });
  const Figures a = measure(tube, blade);
  const double apothem = std::cos(std::acos(-1.0) / kSides);
  CHECK(a.max_to_source == Approx(apothem).epsilon(kMaxTolerance));
}

TEST_CASE("a maximum that takes too long to find is refused with its bounds") {
  const WeldedMesh from = weld(grid(0, 1, 0, 1, 3), {}), to = weld(grid(0, 1, 0, 1, 20, 0.0, true), {});
  const MeshSurface surface(to);
  const auto vertices = closest_to_vertices(from, surface);
  CHECK(surface_distance(from, vertices, surface, 1.0, 100'000).max <= 1e-8);
  CHECK_THROWS_WITH_AS(surface_distance(from, vertices, surface, 1.0, 100),
                       doctest::Contains("after 100 pieces"), Unsupported);
}

TEST_CASE("any number of threads gives the same figures, bit for bit") {
  const Soup source = random_soup(300, 11), drawn = random_soup(150, 12);
  const Camera camera = from_above();
  const render::Picture reference = depths(200, 9.5f);
  set_thread_count(1);
  const Figures one = measure(source, drawn, {&camera, &reference});
  for (const int threads : {2, 3, 7}) {
    set_thread_count(threads);
    CHECK(same_bits(measure(source, drawn, {&camera, &reference}), one));
  }
  set_thread_count(0);
}

TEST_CASE("on the screen: a plane drawn too low") {
  // Both planes face the camera, so the closest point lies straight below: a point at r pixels from the
  // middle moves inwards to r * 10 / (10 + drop).
  const double drop = 0.5, share = 1.0 - 10.0 / (10.0 + drop);
  const Camera camera = from_above();
  const Soup source = grid(-2, 2, -2, 2, 40), drawn = grid(-2, 2, -2, 2, 3, -drop);
  render::Picture reference = depths(200, 10.0f);
  for (size_t i = 0; i < 200; ++i) reference.depth[i] = std::numeric_limits<float>::infinity();
  const Figures a = measure(source, drawn, {&camera, &reference});
  // The view ends at 1 unit from the middle; of the vertices, a tenth apart, those at 0.9 are well inside.
  CHECK(a.px_max >= std::sqrt(2.0) * 90.0 * share - 1e-9);
  CHECK(a.px_max <= std::sqrt(2.0) * 100.0 * share + 1e-9);
  std::vector<double> expected;
  double squares = 0.0;
  for (int y = 1; y < 200; ++y) {
    for (int x = 0; x < 200; ++x) {
      expected.push_back(share * std::hypot(x + 0.5 - 100.0, y + 0.5 - 100.0));
      squares += expected.back() * expected.back();
    }
  }
  std::sort(expected.begin(), expected.end());
  CHECK(a.px_p99 == Approx(expected[expected.size() * 99 / 100 - 1]).epsilon(1e-9));
  CHECK(a.px_rms == Approx(std::sqrt(squares / double(expected.size()))).epsilon(1e-9));
  CHECK(std::isnan(measure(source, drawn, {&camera, nullptr}).px_p99));
  CHECK(measure(source, source, {&camera, nullptr}).px_max == 0.0);
}

TEST_CASE("a view that sees nothing") {
  const Camera camera = from_above();
  const render::Picture nothing = depths(200, std::numeric_limits<float>::infinity());
  const Soup aside = grid(50, 51, 0, 1, 2);
  const Figures a = measure(aside, grid(50, 51, 0, 1, 2, 1.0), {&camera, &nothing});
  CHECK(a.measured_max == 1.0);
  CHECK(std::isnan(a.px_max));
  CHECK(std::isnan(a.px_p99));
  CHECK(std::isnan(a.px_rms));
}

TEST_CASE("nothing drawn: infinite from the source, undefined from what is not there") {
  const Camera camera = from_above();
  const render::Picture reference = depths(200, 10.0f);
  const Figures a = measure(grid(0, 1, 0, 1), {}, {&camera, &reference});
  for (const double value :
       {a.measured_max, a.measured_rms, a.max_to_drawn, a.rms_to_drawn, a.px_max, a.px_p99, a.px_rms})
    CHECK(value == kInf);
  CHECK(std::isnan(a.max_to_source));
  CHECK(std::isnan(a.rms_to_source));
}

TEST_CASE("triangles without area are measured, and weigh nothing") {
  Soup drawn = grid(0, 1, 0, 1);
  drawn.push_back({glm::dvec3(0.5, 0.5, 0), glm::dvec3(0.5, 0.5, 0), glm::dvec3(0.5, 0.5, 2)});
  const Figures a = measure(grid(0, 1, 0, 1), drawn);
  CHECK(a.max_to_source == 2.0);
  CHECK(a.rms_to_source == 0.0);
  const Soup point{{glm::dvec3(2, 0, 0), glm::dvec3(2, 0, 0), glm::dvec3(2, 0, 0)}};
  CHECK(measure(grid(0, 1, 0, 1), point).max_to_source == 1.0);
  CHECK(std::isnan(measure(grid(0, 1, 0, 1), point).rms_to_source));
  CHECK(measure(point, point).measured_max == 0.0);
}

TEST_CASE("what cannot be measured is refused by name") {
  const Soup good = grid(0, 1, 0, 1);
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), kInf, 1e31}) {
    Soup broken = good;
    broken[1][2].y = bad;
    CHECK_THROWS_WITH_AS(measure(good, broken), doctest::Contains("measure: triangle 1 has a vertex at"),
                         InvalidInput);
  }
  CHECK_THROWS_WITH_AS(captured_from({}, {}, {}), doctest::Contains("no triangles"), InvalidInput);
}
