// SPDX-License-Identifier: MIT
// subdivision's refinement: lines of control edges decide alike from both faces, triangles tile their faces
// and meet vertex to vertex, the budget is kept wherever the pattern allows it, and the GPU draws the very
// triangles of the twin, bit for bit.
#include <doctest/doctest.h>

#include <algorithm>
#include <map>
#include <numbers>
#include <random>

#include "geometry/mesh_surface.h"
#include "mesh_arrays.h"
#include "methods/subdivision/gpu.h"
#include "methods/subdivision/refine.h"
#include "render/frame.h"
#include "store_fixture.h"

using namespace lodlab;
using namespace lodlab::subdivision;

namespace lodlab {
const Method& subdivision_method();
}

namespace {

using Random = std::mt19937;

double between(Random& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

/// A torus, closed or cut open, with bumps.
std::shared_ptr<const Mesh> bumpy(int rings, int sides, bool open) {
  testing::Arrays out;
  const int last = open ? rings - 1 : rings;
  for (int i = 0; i < rings; ++i) {
    for (int j = 0; j < sides; ++j) {
      const double u = 2.0 * std::numbers::pi * i / rings, v = 2.0 * std::numbers::pi * j / sides;
      const double r =
          0.4 + 0.03 * std::sin(5.0 * u) * std::cos(4.0 * v) + (u < 2.0 ? 0.02 * std::sin(40.0 * u) : 0.0);
      out.positions.push_back(
          {(1.0 + r * std::cos(v)) * std::cos(u), (1.0 + r * std::cos(v)) * std::sin(u), r * std::sin(v)});
    }
  }
  const auto at = [&](int i, int j) { return static_cast<uint32_t>(i % rings * sides + j % sides); };
  for (int i = 0; i < last; ++i) {
    for (int j = 0; j < sides; ++j) {
      out.faces.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      out.faces.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  }
  return testing::mesh_of(out);
}

std::shared_ptr<const SubdivisionHierarchy> built(const Mesh& mesh, int64_t degree, int64_t target = 200) {
  const testing::TemporaryFolder folder;
  const auto store = build_store(mesh, subdivision_method(), {{"degree", degree}, {"target", target}},
                                 folder / "a.lod", BuildMode::kNew, {});
  return std::dynamic_pointer_cast<const SubdivisionHierarchy>(subdivision_method().open(store));
}

/// What a control mesh lies as.
struct Rest {
  std::vector<vec3> positions, normals;
  explicit Rest(const SubdivisionHierarchy& h) {
    for (const glm::dvec3& p : h.stored().control.positions) positions.emplace_back(p);
    for (const glm::dvec3& n : h.stored().control.normals) normals.emplace_back(n);
  }
  Lying lying(const SubdivisionHierarchy& h) const { return {positions, normals, h.records()}; }
};

/// From afar, near by, on the surface, inside.
View random_view(Random& random) {
  View view;
  const double far = std::exp(between(random, std::log(1e-3), std::log(1e3)));
  const double angle = between(random, 0.0, 2.0 * std::numbers::pi);
  const glm::dvec3 on_ring(std::cos(angle), std::sin(angle), 0.0);
  view.target =
      on_ring + 0.4 * glm::normalize(glm::dvec3(between(random, -1, 1), between(random, -1, 1), 0.1));
  view.eye =
      view.target + far * glm::normalize(glm::dvec3(between(random, -1, 1), between(random, -1, 1), 0.7));
  view.fov = between(random, 20.0, 100.0);
  view.width = 400;
  view.height = 300;
  return view;
}

double random_tau(Random& random) { return std::exp(between(random, std::log(0.05), std::log(300.0))); }

/// Triangles of all faces, corners as numbers of samples.
using Corner3 = std::array<int64_t, 3>;
std::vector<Corner3> all_triangles(const SubdivisionHierarchy& h, const Refinement& refinement) {
  std::vector<Corner3> out;
  for (size_t f = 0; f < h.records().face.size(); ++f) {
    refinement.for_triangles(f, [&](const PatternTriangle& t) {
      const auto of = [&](ivec2 p) { return h.samples().of(static_cast<int64_t>(f), p.x, p.y); };
      out.push_back({of(t.p0), of(t.p1), of(t.p2)});
    });
  }
  return out;
}

/// Directed edges that lack their opposite, beside those of the control mesh's border.
int64_t unmatched(const std::vector<Corner3>& triangles) {
  std::map<std::pair<int64_t, int64_t>, int> count;
  for (const Corner3& t : triangles) {
    for (size_t k = 0; k < 3; ++k) ++count[{t[k], t[(k + 1) % 3]}];
  }
  int64_t out = 0;
  for (const auto& [edge, times] : count) {
    const auto back = count.find({edge.second, edge.first});
    if (times != 1 || back == count.end()) ++out;
  }
  return out;
}

int twice_area(const PatternTriangle& t) {
  const ivec2 u = t.p1 - t.p0, v = t.p2 - t.p0;
  return u.x * v.y - u.y * v.x;
}

int level_of(const Pattern& pattern, const PatternTriangle& t) {
  int out = pattern.levels() - 1;
  for (const ivec2 way : {t.p1 - t.p0, t.p2 - t.p1, t.p0 - t.p2})
    out = std::min(out, pattern.level(way.x, way.y));
  return out;
}

constexpr int kMetrics[] = {LODLAB_METRIC_BOUND, LODLAB_METRIC_LENGTH, LODLAB_METRIC_CURVATURE};

/// Triangles of faces, relative to the eye.
using Drawn = std::vector<std::pair<uint32_t, std::array<std::array<float, 3>, 3>>>;

Drawn drawn_by_twin(const SubdivisionHierarchy& h, const Displaced& displaced, const Refinement& refinement,
                    const Uniforms& u, bool everything) {
  const vec3 high(u.eye_high[0], u.eye_high[1], u.eye_high[2]);
  const vec3 low(u.eye_low[0], u.eye_low[1], u.eye_low[2]);
  std::vector<vec3> points(static_cast<size_t>(h.pattern().points()));
  Drawn out;
  for (uint32_t f = 0; f < h.records().face.size(); ++f) {
    if (!everything && !refinement.visible(f)) continue;
    displaced.of_face(f, points);
    refinement.for_triangles(f, [&](const PatternTriangle& t) {
      const auto at = [&](ivec2 p) -> std::array<float, 3> {
        const vec3 there = (points[static_cast<size_t>(h.pattern().point(p.x, p.y))] - high) - low;
        return {there.x, there.y, there.z};
      };
      out.push_back({f, {at(t.p0), at(t.p1), at(t.p2)}});
    });
  }
  return out;
}

Drawn drawn_by_gpu(const render::Captured& captured) {
  Drawn out;
  for (size_t i = 0; i < captured.vertices.size(); i += 3) {
    const auto at = [&](size_t k) -> std::array<float, 3> {
      const render::CapturedVertex& v = captured.vertices[i + k];
      return {v.x, v.y, v.z};
    };
    out.push_back({captured.vertices[i].node, {at(0), at(1), at(2)}});
  }
  return out;
}

}  // namespace

TEST_CASE("a million lines of control edges decide alike from both of their faces") {
  const auto h = built(*bumpy(60, 30, false), 33);
  const Rest rest(*h);
  const Records& records = h->records();
  const auto edge_record = [&](uint32_t e) -> const LineRecord& { return records.edge[e]; };
  const int n = h->pattern().n();
  Random random(5);
  int64_t decided = 0, wanted = 0;
  while (decided < 1'000'000) {
    const View view = random_view(random);
    const Camera camera = make_camera(view);
    const int metric = kMetrics[random() % 3];
    const Uniforms u = uniforms_of(*h, camera, metric);
    const Step step = step_of(Projector(Projection::kStrict, camera), random_tau(random));
    const RefineFrame frame{step.kappa, step.never, step.gain, u.low_code, metric, u.d};
    const vec3 high(u.eye_high[0], u.eye_high[1], u.eye_high[2]),
        low(u.eye_low[0], u.eye_low[1], u.eye_low[2]);
    for (int64_t e = 0; e < h->samples().edges().count(); ++e) {
      const auto sides = h->sides(e);
      REQUIRE(sides.size() == 2);
      const int length = n >> (random() % static_cast<unsigned>(u.d)),
                first = length * static_cast<int>(random() % static_cast<unsigned>(n / length));
      bool wants[2];
      for (size_t k = 0; k < 2; ++k) {
        const FaceRecord& face = records.face[sides[k] / 3];
        const uint32_t side = sides[k] % 3;
        const bool up = face.corner[side] < face.corner[(side + 1) % 3];
        const auto point = [&](int along) {
          const int s = up ? along : n - along;
          return side == 0 ? ivec2(s, 0) : side == 1 ? ivec2(n - s, s) : ivec2(0, n - s);
        };
        const auto at = [&](size_t c) { return (rest.positions[face.corner[c]] - high) - low; };
        CHECK(side_of(point(first), point(first + length), n) == static_cast<int>(side));
        const Corners corners = {at(0), at(1), at(2)};
        const Limits limits = limits_of(frame, face, edge_record);
        const ivec2 p = point(first), q = point(first + length);
        wants[k] = line_between(frame, limits.of[limit_place(frame, p, q)], corners, p, q).wants;
      }
      CHECK(wants[0] == wants[1]);
      ++decided;
      wanted += wants[0] ? 1 : 0;
    }
  }
  CHECK(wanted > decided / 20);
  CHECK(wanted < decided - decided / 20);
}

TEST_CASE("refined faces tile the pattern and meet vertex to vertex, whatever decides") {
  for (const int64_t degree : {3, 5, 17, 33}) {
    CAPTURE(degree);
    const auto h = built(*bumpy(48, 24, false), degree, 120);
    const Rest rest(*h);
    const Lying lies = rest.lying(*h);
    const int n = h->pattern().n();
    Random random(static_cast<unsigned>(degree));
    for (int round = 0; round < 12; ++round) {
      CAPTURE(round);
      const Camera camera = make_camera(random_view(random));
      const Uniforms u = uniforms_of(*h, camera, kMetrics[round % 3]);
      const Step step = step_of(Projector(Projection::kStrict, camera), random_tau(random));
      const Refinement refinement(lies, u, step);
      for (size_t f = 0; f < h->records().face.size(); ++f) {
        int area = 0;
        int64_t left = 0;
        const int64_t tested = refinement.for_triangles(f, [&](const PatternTriangle& t) {
          CHECK(twice_area(t) > 0);
          area += twice_area(t);
          ++left;
        });
        CHECK(area == n * n);
        CHECK(tested == 2 * left - 1);
      }
      CHECK(unmatched(all_triangles(*h, refinement)) == 0);
    }
  }
}

TEST_CASE("the pattern itself is reached, and no bound beyond the budget is drawn that it could refine") {
  const auto h = built(*bumpy(60, 30, false), 17);
  const Rest rest(*h);
  const Lying lies = rest.lying(*h);
  const Pattern& pattern = h->pattern();
  Random random(9);
  std::vector<vec3> points(static_cast<size_t>(pattern.points()));
  for (int round = 0; round < 40; ++round) {
    const Camera camera = make_camera(random_view(random));
    const Uniforms u = uniforms_of(*h, camera, LODLAB_METRIC_BOUND);
    const Projector projector(Projection::kStrict, camera);
    const double tau = round == 0 ? 1e-300 : random_tau(random);
    const Refinement refinement(lies, u, step_of(projector, tau));
    const glm::dvec3 eye = camera.eye - h->centre();
    for (size_t f = 0; f < h->records().face.size(); ++f) {
      h->displaced().of_face(static_cast<int64_t>(f), points);
      int64_t left = 0;
      refinement.for_triangles(f, [&](const PatternTriangle& t) {
        ++left;
        const int level = level_of(pattern, t);
        if (level == pattern.levels() - 1) return;
        const double bound = h->stored().bound(static_cast<int64_t>(f), level);
        const auto at = [&](ivec2 p) {
          return glm::dvec3(points[static_cast<size_t>(pattern.point(p.x, p.y))]);
        };
        const double distance = closest_on_triangle({at(t.p0), at(t.p1), at(t.p2)}, eye).distance;
        CHECK(projector.project(bound, {std::max(0.0, distance - bound), 1.0}) <= tau);
      });
      if (round == 0) CHECK(left == pattern.n() * pattern.n());
    }
  }
}

TEST_CASE(
    "the GPU draws the twin's triangles, bit for bit, by either pipeline; compute shaders in its order") {
  const auto options = [](int round, const char* pipeline) {
    const char* const metric[] = {"bound", "length", "curvature"};
    return resolve_options("subdivision", subdivision_method().info().options, Stage::kDraw,
                           {{"metric", std::string(metric[round % 3])}, {"pipeline", std::string(pipeline)}});
  };
  for (const bool open : {false, true}) {
    for (const char* bits : {"32", "16", "11"}) {
      const testing::TemporaryFolder folder;
      const auto store = build_store(
          *bumpy(60, 30, open), subdivision_method(),
          {{"target", int64_t{150}}, {"bits", std::string(bits)}, {"degree", int64_t{open ? 9 : 17}}},
          folder / "a.lod", BuildMode::kNew, {});
      const auto h = std::dynamic_pointer_cast<const SubdivisionHierarchy>(subdivision_method().open(store));
      const Rest rest(*h);
      const Lying lies = rest.lying(*h);
      Random random(3);
      for (int round = 0; round < 9; ++round) {
        CAPTURE(round);
        const View view = random_view(random);
        const Camera camera = make_camera(view);
        Budget budget;
        budget.pixel_error = random_tau(random);
        if (round % 2 == 1) budget.triangles = 1 + random() % 20000;
        for (const char* pipeline : {"compute", "geometry"}) {
          CAPTURE(pipeline);
          const auto session = h->session(options(round, pipeline));
          Cut cut = session->select({view, budget, nullptr});
          session->resolve(cut);
          const Uniforms u = uniforms_of(*h, camera, kMetrics[round % 3]);
          const Refinement refinement(lies, u,
                                      step_of(Projector(Projection::kStrict, camera), cut.claim->tau));
          for (const bool everything : {false, true}) {
            CAPTURE(everything);
            const render::DrawCall call{[&](render::Work& work) { session->prepare(cut, work); },
                                        [&](render::Pass& pass) { session->draw(cut, pass); }};
            const render::Captured captured = render::capture(camera, call, everything);
            Drawn wanted = drawn_by_twin(*h, h->displaced(), refinement, u, everything);
            Drawn drawn = drawn_by_gpu(captured);
            if (pipeline == std::string("geometry")) {
              std::sort(wanted.begin(), wanted.end());
              std::sort(drawn.begin(), drawn.end());
            }
            CHECK(drawn == wanted);
            if (!everything) CHECK(captured.triangles() == cut.claim->triangles);
          }
        }
      }
    }
  }
}

TEST_CASE("faces that are not there stay whole, crack nowhere, and the GPU draws the twin's triangles") {
  for (const int64_t degree : {3, 17}) {
    CAPTURE(degree);
    const auto h = built(*bumpy(60, 30, false), degree, 400);
    const auto groups = static_cast<size_t>(groups_of(h->stored().shape.faces));
    REQUIRE(groups > 4);
    Random random(static_cast<unsigned>(degree));
    Pose twisted{h->control()};
    for (glm::dvec3& p : twisted.control) p.y += 0.3 * p.x * p.z;
    for (const bool feedback : {false, true}) {
      CAPTURE(feedback);
      std::optional<Gpu> gpu;
      for (int round = 0; round < 12; ++round) {
        CAPTURE(round);
        const Camera camera = make_camera(random_view(random));
        const Uniforms u = uniforms_of(*h, camera, kMetrics[round % 3]);
        const Step step = step_of(Projector(Projection::kStrict, camera), random_tau(random));
        const auto pose = round % 4 < 2 ? nullptr : posed(*h, twisted);
        Slots slots(groups, kNowhere);
        std::vector<uint8_t> there(groups, 0);
        for (uint32_t g = 0, next = 0; g < groups; ++g) {
          there[g] = random() % 2 == 0 || round == 0 ? 1 : 0;
          if (there[g] != 0) slots[g] = next++;
        }
        std::shuffle(slots.begin(), slots.end(), random);
        for (size_t g = 0; g < groups; ++g) there[g] = slots[g] != kNowhere ? 1 : 0;
        const Rest rest(*h);
        const Records held = held_back(pose ? pose->records : h->records(), h->pattern().levels(), there);
        const Lying lies{pose ? pose->control.positions : rest.positions,
                         pose ? pose->control.normals : rest.normals, held};
        const Refinement refinement(lies, u, step);
        CHECK(unmatched(all_triangles(*h, refinement)) == 0);
        for (size_t f = 0; f < held.face.size(); ++f) {
          int64_t triangles = 0;
          refinement.for_triangles(f, [&](const PatternTriangle&) { ++triangles; });
          if (there[f / kGroupFaces] == 0) CHECK(triangles == 1);
        }
        const bool everything = random() % 2 == 0;
        const render::DrawCall call{[&](render::Work& work) {
                                      if (!gpu) gpu.emplace(*h, feedback, static_cast<int64_t>(groups));
                                      for (uint32_t g = 0; g < groups; ++g) {
                                        if (slots[g] == kNowhere) continue;
                                        const Bytes page = h->store()->page(kHeights, g);
                                        const auto heights = decode_page(h->samples(), h->stored().shape.bits,
                                                                         g, page, h->stored().heights);
                                        gpu->put(g, slots[g], heights, work.submitted);
                                      }
                                      gpu->refine(u, {{step}, std::nullopt}, pose, slots, work);
                                    },
                                    [&](render::Pass& pass) { gpu->draw(u, pass); }};
        const render::Captured captured = render::capture(camera, call, everything);
        const Displaced displaced = pose ? h->displaced().at(h->rest(), pose->control) : h->displaced();
        Drawn wanted = drawn_by_twin(*h, displaced, refinement, u, everything);
        Drawn drawn = drawn_by_gpu(captured);
        if (feedback) {
          std::sort(wanted.begin(), wanted.end());
          std::sort(drawn.begin(), drawn.end());
        }
        CHECK(drawn == wanted);
        const Room room = Gpu::room(*h, feedback);
        CHECK(gpu->bytes() <= room.fixed + static_cast<int64_t>(groups) * room.slot);
      }
    }
  }
}

TEST_CASE("what no line wants is not wanted: groups in sight, or beside one, that may be refined are") {
  const auto h = built(*bumpy(60, 30, false), 9, 400);
  const Rest rest(*h);
  const Lying lies = rest.lying(*h);
  const Groups groups(*h);
  const auto count = static_cast<size_t>(groups_of(h->stored().shape.faces));
  Random random(11);
  size_t few = 0;
  for (int round = 0; round < 60; ++round) {
    CAPTURE(round);
    const Camera camera = make_camera(random_view(random));
    const Uniforms u = uniforms_of(*h, camera, kMetrics[round % 3]);
    const Step step = step_of(Projector(Projection::kStrict, camera), random_tau(random));
    const auto wanted = groups.wanted(lies, u, camera, step);
    if (wanted.size() < count) ++few;
    std::vector<uint8_t> there(count, 0);
    for (const Residency::Want& want : wanted) there[want.unit] = 1;
    const Records held = held_back(h->records(), h->pattern().levels(), there);
    const Lying loaded{rest.positions, rest.normals, held};
    const Refinement all(lies, u, step), some(loaded, u, step);
    CHECK(drawn_by_twin(*h, h->displaced(), all, u, false) ==
          drawn_by_twin(*h, h->displaced(), some, u, false));
    for (size_t f = 0; f < held.face.size(); ++f) {
      if (some.visible(f)) CHECK(!some.lacks(f, h->records()));
    }
  }
  CHECK(few > 15);
}
