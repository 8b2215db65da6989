// SPDX-License-Identifier: MIT
// Sampling, displacement, bits and bounds of subdivision, on surfaces that are known on paper. No GL.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <random>
#include <set>

#include "base/errors.h"
#include "base/parallel.h"
#include "geometry/mesh_distance.h"
#include "mesh_arrays.h"
#include "methods/subdivision/bits.h"
#include "methods/subdivision/bounds.h"
#include "methods/subdivision/stored_control.h"

using namespace lodlab;
using testing::Arrays;
using testing::mesh_of;
using namespace lodlab::subdivision;

namespace {

Arrays octahedron() {
  return {{{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}},
          {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4}, {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}}};
}

/// Each triangle cut into four, new vertices on the unit sphere.
Arrays sphere(int cuts) {
  Arrays out = octahedron();
  for (; cuts > 0; --cuts) {
    std::map<std::pair<uint32_t, uint32_t>, uint32_t> middles;
    std::vector<Face> faces;
    const auto middle = [&](uint32_t a, uint32_t b) {
      const auto [at, is_new] =
          middles.try_emplace(std::minmax(a, b), static_cast<uint32_t>(out.positions.size()));
      if (is_new) out.positions.push_back(glm::normalize(out.positions[a] + out.positions[b]));
      return at->second;
    };
    for (const auto& [a, b, c] : out.faces) {
      const uint32_t ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
      faces.insert(faces.end(), {{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}});
    }
    out.faces = faces;
  }
  return out;
}

/// A square of 2 n^2 triangles at a height, whose upper side shows if `up`.
void add_sheet(Arrays& to, int n, bool up, const std::function<double(double, double)>& z) {
  const auto first = static_cast<uint32_t>(to.positions.size());
  const auto at = [&](int i, int j) { return first + static_cast<uint32_t>(i * (n + 1) + j); };
  for (int i = 0; i <= n; ++i) {
    for (int j = 0; j <= n; ++j) {
      const double x = static_cast<double>(i) / n, y = static_cast<double>(j) / n;
      to.positions.push_back({x, y, z(x, y)});
    }
  }
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      for (Face f :
           {Face{at(i, j), at(i + 1, j), at(i + 1, j + 1)}, Face{at(i, j), at(i + 1, j + 1), at(i, j + 1)}}) {
        if (!up) std::swap(f[1], f[2]);
        to.faces.push_back(f);
      }
    }
  }
}

Arrays bumps(int n) {
  Arrays out;
  add_sheet(out, n, true,
            [](double x, double y) { return 0.05 * std::sin(9.0 * x) * std::cos(7.0 * y + x); });
  return out;
}

ControlMesh control_of(const Arrays& arrays, const std::function<glm::dvec3(const glm::dvec3&)>& normal) {
  ControlMesh out;
  out.positions = arrays.positions;
  out.faces = arrays.faces;
  for (const glm::dvec3& p : arrays.positions) out.normals.push_back(glm::normalize(normal(p)));
  return out;
}

glm::dvec3 outwards(const glm::dvec3& p) { return p; }
glm::dvec3 upwards(const glm::dvec3&) { return {0.0, 0.0, 1.0}; }

ControlMesh flat_control(int n) {
  Arrays out;
  add_sheet(out, n, true, [](double, double) { return 0.0; });
  return control_of(out, upwards);
}

/// Cuts a triangle of the pattern at random through middles that lie on it.
using Corners = std::array<glm::ivec2, 3>;
void bisect(const Corners& t, double share, std::mt19937& random, std::vector<Corners>& out) {
  std::vector<size_t> even;
  for (size_t k = 0; k < 3; ++k) {
    const glm::ivec2 gap = t[k] - t[(k + 1) % 3];
    if (gap.x % 2 == 0 && gap.y % 2 == 0) even.push_back(k);
  }
  if (even.empty() || std::uniform_real_distribution<double>(0.0, 1.0)(random) > share)
    return out.push_back(t);
  const size_t k = even[random() % even.size()];
  const glm::ivec2 middle = (t[k] + t[(k + 1) % 3]) / 2;
  bisect({t[k], middle, t[(k + 2) % 3]}, share, random, out);
  bisect({middle, t[(k + 1) % 3], t[(k + 2) % 3]}, share, random, out);
}

int coarsest(const Pattern& pattern, const Corners& t) {
  int out = pattern.levels();
  for (size_t k = 0; k < 3; ++k) {
    const glm::ivec2 gap = t[k] - t[(k + 1) % 3];
    out = std::min(out, pattern.level(gap.x, gap.y));
  }
  return out;
}

}  // namespace

TEST_CASE("pattern: degrees are 2^d + 1, others are refused by their value") {
  CHECK(Pattern::of_degree(17).d == 4);
  CHECK(Pattern::of_degree(33).points() == 33 * 34 / 2);
  for (const int64_t degree : {-1, 0, 1, 2, 4, 16, 18, 2049}) {
    CAPTURE(degree);
    CHECK_THROWS_AS(Pattern::of_degree(degree), InvalidInput);
  }
}

TEST_CASE("pattern: every sample is named, shared ones by each of their faces, at one place") {
  const ControlMesh control = stored(control_of(sphere(1), outwards), glm::dvec3(0.0));
  for (const int64_t degree : {3, 5, 9}) {
    const Pattern pattern = Pattern::of_degree(degree);
    const Samples samples(control, pattern);
    const auto places = samples.places();
    REQUIRE(static_cast<int64_t>(places.size()) == samples.count());
    const int n = pattern.n();
    std::vector<int> named(places.size(), 0);
    for (int64_t f = 0; f < samples.control_faces(); ++f) {
      const Face& v = control.faces[static_cast<size_t>(f)];
      std::set<int64_t> of_face;
      for (int j = 0; j <= n; ++j) {
        for (int i = 0; i + j <= n; ++i) {
          const int64_t s = samples.of(f, i, j);
          REQUIRE(s >= 0);
          REQUIRE(s < samples.count());
          of_face.insert(s);
          ++named[static_cast<size_t>(s)];
          const glm::dvec3 at = (static_cast<double>(n - i - j) * control.positions[v[0]] +
                                 static_cast<double>(i) * control.positions[v[1]] +
                                 static_cast<double>(j) * control.positions[v[2]]) /
                                static_cast<double>(n);
          REQUIRE(glm::distance(at, glm::dvec3(places[static_cast<size_t>(s)].position)) < 1e-7);
        }
      }
      CHECK(static_cast<int>(of_face.size()) == pattern.points());
    }
    for (int64_t s = 0; s < samples.count(); ++s) {
      const int most = s < samples.first_on_edges() ? 6 : s < samples.first_inside() ? 2 : 1;
      CHECK(named[static_cast<size_t>(s)] <= most);
      CHECK(named[static_cast<size_t>(s)] >= (most == 6 ? 4 : most));
    }
  }
}

TEST_CASE(
    "pattern: a control edge has level 0, its halves 2, a step 2 d, and longer lines no higher levels") {
  const Pattern pattern = Pattern::of_degree(17);
  CHECK(pattern.level(16, 0) == 0);
  CHECK(pattern.level(8, -16) == 1);  // the height of the face
  CHECK(pattern.level(0, 8) == 2);
  CHECK(pattern.level(-1, 1) == 8);
  CHECK(pattern.level(1, 1) == 7);
}

TEST_CASE("what is stored is in floats round the centre, the same mesh in another order") {
  const glm::dvec3 centre(6.4e6, -3.0, 0.1);
  ControlMesh control = control_of(sphere(2), outwards);
  control.onto = {5, ~0u, 40};
  for (glm::dvec3& p : control.positions) p += centre;
  const ControlMesh out = stored(control, centre);
  REQUIRE(out.positions.size() == control.positions.size());
  const auto corners_of = [](const ControlMesh& mesh, const glm::dvec3& origin) {
    std::multiset<std::array<float, 9>> all;  // each triangle from its lowest corner on
    for (const Face& f : mesh.faces) {
      std::array<std::array<float, 3>, 3> at;
      for (size_t k = 0; k < 3; ++k) {
        const glm::vec3 p = mesh.positions[f[k]] - origin;
        at[k] = {p.x, p.y, p.z};
      }
      std::rotate(at.begin(), std::min_element(at.begin(), at.end()), at.end());
      all.insert({at[0][0], at[0][1], at[0][2], at[1][0], at[1][1], at[1][2], at[2][0], at[2][1], at[2][2]});
    }
    return all;
  };
  CHECK(corners_of(control, centre) == corners_of(out, glm::dvec3(0.0)));
  for (size_t v = 0; v < out.positions.size(); ++v) {
    CHECK((glm::dvec3(glm::vec3(out.positions[v])) == out.positions[v]));
    CHECK((glm::dvec3(glm::vec3(out.normals[v])) == out.normals[v]));
    CHECK(glm::distance(out.normals[v], out.positions[v]) < 1e-6);
  }
  CHECK(out.onto[1] == ~0u);
  CHECK(glm::distance(out.positions[out.onto[2]], control.positions[40] - centre) < 1e-7);
}

TEST_CASE("control vertices that round to one place are moved apart; a mesh below floats is refused") {
  ControlMesh control = flat_control(2);
  control.positions[1] = control.positions[0] + glm::dvec3(0.0, 1e-12, 0.0);
  control.positions[4] = control.positions[0] + glm::dvec3(1e-12, 0.0, 0.0);
  const ControlMesh out = stored(control, {0.5, 0.5, 0.0});
  for (const Face& f : out.faces) {
    for (size_t k = 0; k < 3; ++k) CHECK((out.positions[f[k]] != out.positions[f[(k + 1) % 3]]));
  }
  double off = 1.0;
  for (const glm::dvec3& p : out.positions) off = std::min(off, std::abs(p.x + 0.5 - 4e-7));
  CHECK(off < 4e-7);  // not far
  for (glm::dvec3& p : control.positions) p *= 1e-33;
  CHECK_THROWS_AS(stored(control, glm::dvec3(0.0)), InvalidInput);
}

TEST_CASE("normals that cancel out leave no height without end") {
  const SourceSurface source(*mesh_of(bumps(20)));
  ControlMesh flat = flat_control(2);
  flat.normals[4] = {0.0, 0.0, -1.0};
  const ControlMesh control = stored(flat, source.centre);
  const Samples samples(control, Pattern::of_degree(17));
  for (const Sampling sampling : {Sampling::kIntersection, Sampling::kInterpolation}) {
    const Displacement d = displace(source, control, samples, sampling, {});
    CHECK(d.missed > 0);
    for (size_t s = 0; s < d.heights.size(); ++s) {
      CHECK(std::isfinite(d.heights[s]));
      CHECK(glm::distance(d.end(s, d.heights[s]), glm::dvec3(d.places[s].position)) < 0.5);
    }
  }
}

TEST_CASE("a sphere over an octahedron is displaced by 1 / |p| - 1 lengths of the normal, which is p") {
  const SourceSurface source(*mesh_of(sphere(5)));
  const ControlMesh control = stored(control_of(octahedron(), outwards), source.centre);
  const Samples samples(control, Pattern::of_degree(17));
  const Displacement d = displace(source, control, samples, Sampling::kIntersection, {});
  CHECK(d.missed + d.wrong_sheet == 0);
  for (size_t s = 0; s < d.heights.size(); ++s) {
    const double known = 1.0 / glm::length(glm::dvec3(d.places[s].position)) - 1.0;
    CHECK(d.heights[s] ==
          doctest::Approx(known).epsilon(0.01).scale(1.0 / 8.0));  // facets lie below the sphere
    CHECK(glm::length(d.end(s, d.heights[s])) <= 1.0 + 1e-7);
  }
  const Displacement smooth = displace(source, control, samples, Sampling::kInterpolation, {});
  for (size_t s = 0; s < d.heights.size(); ++s)
    CHECK(std::abs(smooth.heights[s] - d.heights[s]) < 0.02);  // cells are up to 0.09 wide
}

TEST_CASE("a shell inside another: samples lie on their own, though the other one is nearer") {
  Arrays arrays = sphere(5);
  const auto shell = static_cast<uint32_t>(arrays.positions.size());
  const size_t faces = arrays.faces.size();
  for (uint32_t v = 0; v < shell; ++v) arrays.positions.push_back(0.97 * arrays.positions[v]);
  for (size_t t = 0; t < faces; ++t) {
    const auto [a, b, c] = arrays.faces[t];
    arrays.faces.push_back({a + shell, b + shell, c + shell});
  }
  const auto mesh = mesh_of(arrays);
  const SourceSurface source(*mesh);
  const ControlMesh control = stored(control_mesh(*mesh, 128, {}), source.centre);
  const std::set<uint32_t> on_outer(control.onto.begin(), control.onto.begin() + shell);
  const Samples samples(control, Pattern::of_degree(17));
  std::vector<int64_t> of(static_cast<size_t>(samples.pattern().points()));
  for (const Sampling sampling : {Sampling::kIntersection, Sampling::kInterpolation}) {
    const Displacement d = displace(source, control, samples, sampling, {});
    CHECK(d.missed + d.wrong_sheet == 0);
    int64_t nearer_to_the_other = 0, wrong = 0;
    for (int64_t f = 0; f < samples.control_faces(); ++f) {
      const bool outer = on_outer.contains(control.faces[static_cast<size_t>(f)][0]);
      samples.of_face(f, of);
      for (const int64_t at : of) {
        const auto s = static_cast<size_t>(at);
        nearer_to_the_other += outer && glm::length(glm::dvec3(d.places[s].position)) < 0.984;
        wrong += std::abs(glm::length(d.end(s, d.heights[s])) - (outer ? 1.0 : 0.97)) > 0.005;
      }
    }
    CHECK(nearer_to_the_other > 1000);
    CHECK(wrong == 0);
  }
}

TEST_CASE("lines through edges and vertices of the source are not lost") {
  Arrays arrays;
  add_sheet(arrays, 48, true, [](double, double) { return 0.0; });
  for (glm::dvec3& p : arrays.positions) p = {p.x * 1.1, p.y / 3.0 + 0.1 * p.x, p.z + 0.3 * p.x};
  const auto mesh = mesh_of(arrays);
  const SourceSurface source(*mesh);
  int lost = 0;
  for (const auto& f : source.mesh.faces) {
    for (size_t k = 0; k < 3; ++k) {
      const glm::dvec3 &a = source.mesh.positions[f[k]], &b = source.mesh.positions[f[(k + 1) % 3]];
      for (const double w : {0.0, 0.5, 1.0 / 3.0}) {
        const glm::dvec3 at = glm::mix(a, b, w), from = at + glm::dvec3(0.0, 0.0, 0.01);
        if (std::abs(at.x) > 0.54 || source.surface.closest(at).distance > 1e-9) continue;
        bool rim = false;
        for (const double aside : {-1e-3, 1e-3}) {
          rim =
              rim ||
              source.surface.closest(at + glm::dvec3(aside, 0.1 / 1.1 * aside, 0.3 / 1.1 * aside)).distance >
                  1e-9 ||
              source.surface.closest(at + glm::dvec3(0.0, aside, 0.0)).distance > 1e-9;
        }
        if (rim) continue;
        lost += source.surface.closest_crossing(from, {0.0, 0.0, 1.0}, 0.1).triangle == kNoTriangle;
      }
    }
  }
  CHECK(lost == 0);
}

TEST_CASE("of two sheets close together the one that faces along the normal is taken") {
  Arrays arrays;
  add_sheet(arrays, 20, true, [](double, double) { return 0.02; });
  add_sheet(arrays, 20, false, [](double, double) { return -0.001; });
  const SourceSurface source(*mesh_of(arrays));
  const ControlMesh control = stored(flat_control(2), source.centre);
  const Samples samples(control, Pattern::of_degree(9));
  const Displacement d = displace(source, control, samples, Sampling::kIntersection, {});
  for (const float height : d.heights) CHECK(std::abs(height - (0.02 - 0.0095)) < 0.0096);
  CHECK(d.missed == 0);
}

TEST_CASE("a hole in the source is counted and filled from its neighbours") {
  Arrays arrays;
  add_sheet(arrays, 16, true, [](double, double) { return 0.03; });
  std::erase_if(arrays.faces, [&](const Face& f) {
    const glm::dvec3 p = arrays.positions[f[0]];
    return p.x > 0.2 && p.x < 0.7 && p.y > 0.2 && p.y < 0.7;
  });
  const SourceSurface source(*mesh_of(arrays));
  const ControlMesh control = stored(flat_control(1), source.centre);
  const Samples samples(control, Pattern::of_degree(17));
  const Displacement d = displace(source, control, samples, Sampling::kIntersection, {});
  CHECK(d.missed > 30);
  CHECK(d.averaged > 0);
  CHECK(d.repaired_share() < 0.5);
  for (const float height : d.heights) CHECK(height == doctest::Approx(0.03).epsilon(1e-5));
}

TEST_CASE("bits: what is shared is one value, and is off by no more than half a step") {
  const SourceSurface source(*mesh_of(bumps(30)));
  const ControlMesh control = stored(flat_control(3), source.centre);
  const Samples samples(control, Pattern::of_degree(9));
  const Displacement d = displace(source, control, samples, Sampling::kIntersection, {});
  CHECK(unpack(samples, pack(samples, d.heights, 32)) == d.heights);
  int64_t before = pack(samples, d.heights, 32).bytes();
  for (const int bits : {16, 11}) {
    const PackedHeights packed = pack(samples, d.heights, bits);
    const std::vector<float> decoded = unpack(samples, packed);
    float step = 0.0f;
    for (const auto& range : packed.ranges) step = std::max(step, range.step);
    CHECK(step > 0.0f);
    for (size_t s = 0; s < decoded.size(); ++s)
      CHECK(std::abs(decoded[s] - d.heights[s]) <= 0.5001f * step + 1e-8f);
    CHECK(packed.bytes() < before);
    before = packed.bytes();
  }
  CHECK_THROWS_AS(pack(samples, d.heights, 12), InvalidInput);
}

TEST_CASE("bounds: no mixture of levels is farther from the source than they say, nor the source from it") {
  std::mt19937 random(3);
  struct Case {
    Arrays source;
    ControlMesh control;
  };
  const Case cases[] = {{bumps(24), flat_control(2)}, {sphere(4), control_of(octahedron(), outwards)}};
  for (const Case& c : cases) {
    const SourceSurface source(*mesh_of(c.source));
    const ControlMesh control = stored(c.control, source.centre);
    const Samples samples(control, Pattern::of_degree(9));
    const Pattern& pattern = samples.pattern();
    const Displacement d = displace(source, control, samples, Sampling::kIntersection, {});
    const std::vector<float> heights = unpack(samples, pack(samples, d.heights, 11));
    const Bounds bound = bounds(source, control, samples, d, heights, {});
    const auto levels = static_cast<size_t>(bound.levels);
    for (size_t i = 0; i + 1 < bound.face.size(); ++i)
      if ((i + 1) % levels != 0) CHECK(bound.face[i] >= bound.face[i + 1]);
    for (int trial = 0; trial < 12; ++trial) {
      WeldedMesh drawn;
      drawn.positions = displaced(samples, d, heights).positions;
      Shares shares;
      for (int64_t f = 0; f < samples.control_faces(); ++f) {
        std::vector<Corners> triangles;
        bisect({glm::ivec2(0, 0), glm::ivec2(pattern.n(), 0), glm::ivec2(0, pattern.n())}, 0.3 + 0.06 * trial,
               random, triangles);
        for (const Corners& t : triangles) {
          std::array<uint32_t, 3> v;
          for (size_t k = 0; k < 3; ++k) v[k] = static_cast<uint32_t>(samples.of(f, t[k].x, t[k].y));
          drawn.faces.push_back(v);
          shares.reach.push_back(
              bound.face[static_cast<size_t>(f) * levels + static_cast<size_t>(coarsest(pattern, t))]);
          shares.of.push_back(static_cast<uint32_t>(shares.of.size()));
        }
      }
      // Each drawn triangle by itself, against its own bound.
      for (size_t t = 0; t < drawn.faces.size(); ++t) {
        WeldedMesh one{drawn.positions, {drawn.faces[t]}};
        const Triangle corners = one.triangle(0);
        one.positions.assign(corners.begin(), corners.end());
        one.faces[0] = {0, 1, 2};
        CHECK(largest_distance(one, closest_to_vertices(one, source.surface), source.surface, 2.0, 1 << 20) <=
              shares.reach[t]);
      }
      // The source is within reach of some triangle everywhere: no attained distance is above the largest.
      shares.longest = *std::max_element(shares.reach.begin(), shares.reach.end());
      const MeshSurface surface(drawn);
      for (const glm::dvec3& p : source.mesh.positions) {
        const Closest held = held_to(surface, shares, p, surface.closest(p));
        CHECK(held.distance <= shares.reach[shares.of[held.triangle]]);
      }
    }
  }
}

/// A bowl with a round rim, of `n` rings.
Arrays bowl(uint32_t n, double depth) {
  Arrays out;
  out.positions.push_back({0.0, 0.0, -depth});
  const uint32_t round = 4 * n;
  for (uint32_t ring = 1; ring <= n; ++ring) {
    for (uint32_t k = 0; k < round; ++k) {
      const double r = static_cast<double>(ring) / n, angle = 6.283185307179586 * k / round;
      out.positions.push_back({r * std::cos(angle), r * std::sin(angle), depth * (r * r - 1.0)});
      const uint32_t next = (k + 1) % round, in = 1 + (ring - 2) * round, at = 1 + (ring - 1) * round;
      if (ring == 1) {
        out.faces.push_back({0, at + k, at + next});
      } else {
        out.faces.push_back({in + k, at + k, at + next});
        out.faces.push_back({in + k, at + next, in + next});
      }
    }
  }
  return out;
}

TEST_CASE("bounds: a border of what is drawn is within them of the source's border, at every level") {
  Arrays slit;  // 0.2 long; the control mesh's is 0.6
  add_sheet(slit, 50, true, [](double, double) { return 0.0; });
  std::erase_if(slit.faces, [&](const Face& f) {
    const glm::dvec3 p = (slit.positions[f[0]] + slit.positions[f[1]] + slit.positions[f[2]]) / 3.0;
    return p.x > 0.4 && p.x < 0.6 && p.y > 0.5 && p.y < 0.52;
  });
  const Arrays round_slit = {
      {{0, 0, 0},
       {1, 0, 0},
       {1, 1, 0},
       {0, 1, 0},
       {0.2, 0.5, 0},
       {0.8, 0.5, 0},
       {0.8, 0.52, 0},
       {0.2, 0.52, 0}},
      {{0, 1, 4}, {1, 5, 4}, {1, 2, 5}, {2, 6, 5}, {2, 3, 6}, {3, 7, 6}, {3, 0, 7}, {0, 4, 7}}};
  const auto shallow = mesh_of(bowl(16, 0.05)), deep = mesh_of(bowl(16, 0.8));
  struct Case {
    std::shared_ptr<const Mesh> mesh;
    ControlMesh control;
  };
  double above = 0.0;  // the finest surface's, between a border's points and the surface
  for (const Case& c :
       {Case{shallow, control_mesh(*shallow, 40, {})}, Case{deep, control_mesh(*deep, 40, {})},
        Case{mesh_of(slit), control_of(round_slit, upwards)}}) {
    const SourceSurface source(*c.mesh);
    const ControlMesh control = stored(c.control, source.centre);
    const Samples samples(control, Pattern::of_degree(9));
    const Displacement d = displace(source, control, samples, Sampling::kIntersection, {});
    const Bounds bound = bounds(source, control, samples, d, d.heights, {});
    const WeldedMesh finest = displaced(samples, d, d.heights), segments = unmatched_edges(source.mesh);
    const MeshSurface border(segments);
    const int n = samples.pattern().n();
    int seen = 0;
    for (int64_t f = 0; f < samples.control_faces(); ++f) {
      for (int side = 0; side < 3; ++side) {
        if (samples.edges().of(samples.edge(f, side)).size() != 1) continue;
        ++seen;
        const auto at = [&](int k) {
          const int ij[3][2] = {{k, 0}, {n - k, k}, {0, n - k}};
          return finest.positions[static_cast<size_t>(samples.of(f, ij[side][0], ij[side][1]))];
        };
        for (int from = 0; from < n; ++from) {
          for (int to = from + 1; to <= n; ++to) {
            const auto level = static_cast<size_t>(samples.pattern().level(to - from, 0));
            const double most = bound.face[static_cast<size_t>(f * bound.levels) + level];
            for (int k = 0; k <= 20; ++k) {
              const glm::dvec3 point = glm::mix(at(from), at(to), 0.05 * k);
              const double away = border.closest(point).distance;
              REQUIRE(away <= most);
              above = std::max(above, away - source.surface.closest(point).distance);
            }
          }
        }
      }
    }
    CHECK(seen > 3);
  }
  CHECK(above > 0.1);  // a bound of the surface is none of its border
}

TEST_CASE(
    "coarsening: one sample out of a plane, seen from the triangles that it is a corner of or lies in") {
  for (const int64_t degree : {3, 9}) {
    const Pattern pattern = Pattern::of_degree(degree);
    const int n = pattern.n();
    std::vector<glm::dvec3> ends(static_cast<size_t>(pattern.points()));
    for (int j = 0; j <= n; ++j)
      for (int i = 0; i + j <= n; ++i) ends[static_cast<size_t>(pattern.point(i, j))] = {i, j, 0.0};
    ends[static_cast<size_t>(pattern.point(n / 2, 0))].z = 1.0;
    std::vector<double> off = coarsening(pattern, ends);
    CHECK(off[static_cast<size_t>(2 * pattern.d)] == 0.0);
    CHECK(off[static_cast<size_t>(2 * pattern.d - 1)] == doctest::Approx(0.5));
    ends[static_cast<size_t>(pattern.point(n / 2, 0))].z = 0.0;
    if (n < 4) continue;
    ends[static_cast<size_t>(pattern.point(2, 2))].z = 1.0;  // the middle of a hexagon's every second corner
    off = coarsening(pattern, ends);
    CHECK(off[static_cast<size_t>(2 * pattern.d - 1)] == doctest::Approx(1.0));
    for (int level = 0; level < 2 * pattern.d - 1; ++level) CHECK(off[static_cast<size_t>(level)] >= 0.999);
  }
}

TEST_CASE("bounds: of the finest surface they are close to what is measured, and threads change nothing") {
  const SourceSurface source(*mesh_of(bumps(40)));
  const ControlMesh control = stored(flat_control(2), source.centre);
  const Samples samples(control, Pattern::of_degree(9));
  const Displacement d = displace(source, control, samples, Sampling::kIntersection, {});
  const Bounds bound = bounds(source, control, samples, d, d.heights, {});
  const WeldedMesh finest = displaced(samples, d, d.heights);
  const MeshSurface surface(finest);
  const double there = largest_distance(finest, closest_to_vertices(finest, source.surface), source.surface,
                                        2.0, 1 << 20),
               back = largest_distance(source.mesh, closest_to_vertices(source.mesh, surface), surface, 2.0,
                                       1 << 20);
  double most = 0.0;
  for (size_t f = 0; f < control.faces.size(); ++f)
    most = std::max(most, bound.face[(f + 1) * static_cast<size_t>(bound.levels) - 1]);
  CHECK(most >= std::max(there, back));
  CHECK(most <= 2.0 * std::max(there, back));
  set_thread_count(1);
  const Displacement alone = displace(source, control, samples, Sampling::kInterpolation, {});
  const Bounds bound_alone = bounds(source, control, samples, d, d.heights, {});
  set_thread_count(0);
  CHECK(alone.heights == displace(source, control, samples, Sampling::kInterpolation, {}).heights);
  CHECK(bound_alone.face == bound.face);
  CHECK(bound_alone.sampling == bound.sampling);
  CHECK(bound_alone.average == bound.average);
}

TEST_CASE("sampling and bounding tell of progress up to all of it, and may be stopped") {
  const SourceSurface source(*mesh_of(bumps(40)));
  const ControlMesh control = stored(flat_control(4), source.centre);
  const Samples samples(control, Pattern::of_degree(9));
  std::map<std::string, double> share;
  const Progress progress = [&](const std::string& stage, double to) {
    CHECK(to > share[stage]);
    share[stage] = to;
  };
  const Displacement d = displace(source, control, samples, Sampling::kInterpolation, progress);
  bounds(source, control, samples, d, d.heights, progress);
  CHECK(share == std::map<std::string, double>{{"bound", 1.0}, {"sample", 1.0}});
  const Progress stop = [&](const std::string&, double to) {
    if (to > 0.1) throw Interrupted();
  };
  CHECK_THROWS_AS(displace(source, control, samples, Sampling::kIntersection, stop), Interrupted);
  CHECK_THROWS_AS(bounds(source, control, samples, d, d.heights, stop), Interrupted);
}

TEST_CASE("source triangles without area, and control faces too, are survived") {
  Arrays arrays = bumps(12);
  arrays.faces.push_back({3, 3, 9});
  arrays.faces.push_back({0, 1, 0});
  arrays.positions.push_back(arrays.positions[40]);
  arrays.faces.push_back({40, static_cast<uint32_t>(arrays.positions.size() - 1), 41});
  const SourceSurface source(*mesh_of(arrays));
  ControlMesh flat = flat_control(1);
  flat.positions.push_back(0.5 * (flat.positions[0] + flat.positions[1]));
  flat.normals.push_back({0.0, 0.0, 1.0});
  flat.faces.push_back({0, 4, 1});
  const ControlMesh control = stored(flat, source.centre);
  const Samples samples(control, Pattern::of_degree(5));
  const Displacement d = displace(source, control, samples, Sampling::kInterpolation, {});
  const Bounds bound = bounds(source, control, samples, d, d.heights, {});
  for (const double b : bound.face) CHECK(std::isfinite(b));
}
