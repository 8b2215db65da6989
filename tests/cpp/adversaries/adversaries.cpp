// SPDX-License-Identifier: MIT
// The adversaries: each does one thing wrong on purpose (family.h says what they do right), and exists to
// prove that the detector made for it can fail. The table of who catches whom is in
// tests/adversaries/test_adversaries.py. Flaws of what is drawn sit in node 27, in the midst of an 8 x 8 grid
// of nodes (a field of 129 x 129 samples), or in node 0 of a mesh, unless they are everywhere.
#include <epoxy/gl.h>

#include <algorithm>
#include <limits>
#include <numeric>

#include "family.h"

namespace lodlab::adversaries {
namespace {

constexpr int64_t kMarked = 27;
constexpr uint32_t kRow = kSide + 1;  // vertices in a row of a node's lattice

bool whole(const Mesh& mesh) { return mesh.vertices.size() == kRow * kRow; }
bool marked(const Mesh& mesh) { return mesh.node == kMarked && whole(mesh); }
bool marked(const Patch& patch) { return patch.node == 0; }

const std::vector<std::string> kFields{"heightfield"}, kMeshes{"mesh"};

struct HalfBounds : Family {
  HalfBounds() : Family("half_bounds", "Claims half of its largest deviation.") {}
  double bound(double deviation) const override { return 0.5 * deviation; }
};

/// The vertices of the east side move up, its ends left where they are; of a mesh the whole node moves.
struct Crack : Family {
  Crack() : Family("crack", "Opens a crack between one node and its neighbours.") {}
  void change(Patch& patch, double gap) const override {
    if (!marked(patch)) return;
    for (glm::dvec3& p : patch.mesh.positions) p.z += gap;
  }
  void change(Mesh& mesh, double gap) const override {
    if (!marked(mesh)) return;
    for (uint32_t row = 1; row < kSide; ++row)
      mesh.vertices[row * kRow + kSide].height += static_cast<float>(gap);
  }
};

struct Corner : Family {
  Corner() : Family("corner", "One node disagrees with its neighbours at one corner.", kFields) {}
  void change(Mesh& mesh, double gap) const override {
    if (marked(mesh)) mesh.vertices[kRow * kRow - 1].height += static_cast<float>(gap);
  }
};

/// The other resolution in every frame that the camera moves.
struct Pop : Family {
  Pop() : Family("pop", "Jumps between resolutions as the camera moves; both are within the budget.") {}
  int choose(int honest, int before, bool again) const override {
    if (before < 0) return honest;
    return again ? before : 1 - before;
  }
};

/// The other resolution in every frame that the camera does not move.
struct Flicker : Family {
  Flicker() : Family("flicker", "Jumps between resolutions under a still camera, and only there.") {}
  int choose(int honest, int before, bool again) const override { return again ? 1 - before : honest; }
};

struct OverTriangles : Family {
  OverTriangles() : Family("over_triangles", "Draws one triangle more than the budget has.") {}
  Budget allowed(const Budget& budget) const override {
    Budget out = budget;
    if (out.triangles) ++*out.triangles;
    return out;
  }
};

struct OverNodes : Family {
  OverNodes() : Family("over_nodes", "Draws one node more than the budget has.") {}
  Budget allowed(const Budget& budget) const override {
    Budget out = budget;
    if (out.nodes) ++*out.nodes;
    return out;
  }
};

struct OverPixels : Family {
  OverPixels() : Family("over_pixels", "Is content with one pixel more of error than the budget has.") {}
  Budget allowed(const Budget& budget) const override {
    Budget out = budget;
    if (out.pixel_error) ++*out.pixel_error;
    return out;
  }
};

/// The triangles round the middle of a node are not there.
struct Hole : Family {
  Hole() : Family("hole", "Leaves out the triangles round one vertex.") {}
  void change(Mesh& mesh, double) const override {
    if (!marked(mesh)) return;
    constexpr uint32_t kMiddle = kRow * (kSide / 2) + kSide / 2;
    std::vector<uint32_t> kept;
    for (size_t i = 0; i < mesh.indices.size(); i += 3) {
      const uint32_t *t = &mesh.indices[i], *end = t + 3;
      if (std::find(t, end, kMiddle) == end) kept.insert(kept.end(), t, end);
    }
    mesh.indices = kept;
  }
  void change(Patch& patch, double) const override {
    if (!marked(patch)) return;
    const uint32_t middle = middle_of(patch);
    std::erase_if(patch.mesh.faces, [&](const Face& face) {
      return std::find(face.begin(), face.end(), middle) != face.end();
    });
  }

 private:
  static uint32_t middle_of(const Patch& patch) {
    const std::vector<glm::dvec3>& all = patch.mesh.positions;
    const glm::dvec3 mean =
        std::accumulate(all.begin(), all.end(), glm::dvec3(0.0)) / static_cast<double>(all.size());
    const auto nearer = [&](const glm::dvec3& a, const glm::dvec3& b) {
      return glm::distance(a, mean) < glm::distance(b, mean);
    };
    return static_cast<uint32_t>(std::min_element(all.begin(), all.end(), nearer) - all.begin());
  }
};

/// A fin of no thickness: two triangles back to back.
struct Spur : Family {
  Spur()
      : Family("spur", "Draws a spur where the source has none, and does not say so in its bound.", kMeshes) {
  }
  void change(Patch& patch, double gap) const override {
    if (!marked(patch)) return;
    const Triangle t = patch.mesh.triangle(0);
    const auto [a, b, c] = patch.mesh.faces[0];
    const auto tip = static_cast<uint32_t>(patch.mesh.positions.size());
    patch.mesh.positions.push_back(t[0] + gap * glm::normalize(glm::cross(t[1] - t[0], t[2] - t[0])));
    patch.mesh.faces.push_back({a, b, tip});
    patch.mesh.faces.push_back({b, a, tip});
  }
  bool owns_up() const override { return false; }
};

struct Dropped : Family {
  Dropped()
      : Family("dropped", "Leaves out a whole component, and does not say so in its bounds.", kMeshes) {}
  void change(Patch& patch, double) const override {
    if (patch.component == 1) patch.mesh = {};
  }
  bool owns_up() const override { return false; }
};

/// A triangle less a node, wherever it is asked.
struct UnderReports : Family {
  UnderReports() : Family("under_reports", "Reports fewer triangles than it draws.") {}
  int64_t told(int64_t triangles) const override { return triangles - 1; }
};

struct Inverted : Family {
  Inverted() : Family("inverted", "Winds every triangle the other way.") {}
  void change(Mesh& mesh, double) const override {
    for (size_t i = 0; i < mesh.indices.size(); i += 3) std::swap(mesh.indices[i], mesh.indices[i + 1]);
  }
  void change(Patch& patch, double) const override {
    for (Face& face : patch.mesh.faces) std::swap(face[0], face[1]);
  }
};

/// Cuts are fine, pictures coarse; a running transform feedback gets what the cut says.
struct TwoFaced : Family {
  TwoFaced() : Family("two_faced", "Draws coarser triangles than it shows to transform feedback.") {}
  int choose(int, int, bool) const override { return 1; }
  int drawn(int resolution, const render::Pass&) const override {
    GLboolean captured = GL_FALSE;
    glGetBooleanv(GL_TRANSFORM_FEEDBACK_ACTIVE, &captured);
    return captured == GL_TRUE ? resolution : 0;
  }
};

/// The same, honest in the captures of what is visible: those are compared with pictures most easily.
struct TwoFacedWhole : Family {
  TwoFacedWhole() : Family("two_faced_whole", "Draws coarser triangles than in captures of the whole cut.") {}
  int choose(int, int, bool) const override { return 1; }
  int drawn(int resolution, const render::Pass& pass) const override {
    return pass.everything() ? resolution : 0;
  }
};

/// The true surface below, and a copy of it that says it is filler and bulges above it in every node.
struct Disguise : Family {
  Disguise() : Family("disguise", "Hides its surface below a bad one that it labels as filler.", kFields) {}
  void change(Mesh& mesh, double gap) const override {
    const auto vertices = static_cast<uint32_t>(mesh.vertices.size());
    const size_t corners = mesh.indices.size();
    for (uint32_t i = 0; i < vertices; ++i) {
      Vertex v = mesh.vertices[i];
      if (v.row % kSide != 0 && v.col % kSide != 0) v.height += static_cast<float>(gap);
      v.filler = 1;
      mesh.vertices.push_back(v);
    }
    for (size_t i = 0; i < corners; ++i) mesh.indices.push_back(mesh.indices[i] + vertices);
  }
};

/// Upright fillers, taller than anything that they could hide.
struct Wall : Family {
  Wall() : Family("wall", "Puts up walls of filler before its surface.", kFields) {}
  void change(Mesh& mesh, double gap) const override {
    if (!whole(mesh)) return;
    for (uint32_t i = kRow * (kSide / 2), end = i + kSide; i < end; ++i) {
      const auto first = static_cast<uint32_t>(mesh.vertices.size());
      for (const uint32_t foot : {i, i + 1}) {
        Vertex v = mesh.vertices[foot];
        v.filler = 1;
        mesh.vertices.push_back(v);
        v.height += static_cast<float>(gap);
        mesh.vertices.push_back(v);
      }
      mesh.indices.insert(mesh.indices.end(), {first, first + 2, first + 3, first, first + 3, first + 1});
    }
  }
};

struct NotANumber : Family {
  NotANumber() : Family("not_a_number", "One vertex of one node is no number.") {}
  void change(Mesh& mesh, double) const override {
    if (marked(mesh)) mesh.vertices[kRow * 4 + 4].height = std::numeric_limits<float>::quiet_NaN();
  }
  void change(Patch& patch, double) const override {
    if (marked(patch)) patch.mesh.positions[0].x = std::numeric_limits<double>::quiet_NaN();
  }
  bool owns_up() const override { return false; }  // there is no distance to it
};

struct Nothing : Family {
  Nothing() : Family("nothing", "Draws no triangle at all.") {}
  int drawn(int, const render::Pass&) const override { return -1; }
};

/// Honest, too: what `honest` selects on the CPU, a compute shader selects.
struct Computed : Family {
  explicit Computed(std::string name = "computed",
                    std::string flaw = "Does nothing wrong, and selects in a compute pass.")
      : Family(std::move(name), std::move(flaw), kFields) {}
  std::unique_ptr<Session> session(std::shared_ptr<const FieldHierarchy> hierarchy) const override {
    return computed_session(std::move(hierarchy));
  }
};

/// The GPU selects the coarser resolution; the twin says that it was the finer.
struct FalseTwin : Computed {
  FalseTwin() : Computed("false_twin", "Claims on the CPU another cut than the GPU selects and draws.") {}
  int claimed(int) const override { return 1; }
};

const Family kHonest("honest", "Does nothing wrong.");
const Computed kComputed;
const FalseTwin kFalseTwin;
const HalfBounds kHalfBounds;
const Crack kCrack;
const Corner kCorner;
const Pop kPop;
const Flicker kFlicker;
const OverTriangles kOverTriangles;
const OverNodes kOverNodes;
const OverPixels kOverPixels;
const Hole kHole;
const Spur kSpur;
const Dropped kDropped;
const UnderReports kUnderReports;
const Inverted kInverted;
const TwoFaced kTwoFaced;
const TwoFacedWhole kTwoFacedWhole;
const Disguise kDisguise;
const Wall kWall;
const NotANumber kNotANumber;
const Nothing kNothing;

/// They join the registry when the module is loaded.
const bool kRegistered = [] {
  for (const Method* method : std::initializer_list<const Method*>{
           &kHonest,       &kComputed, &kFalseTwin,     &kHalfBounds,    &kCrack,      &kCorner,
           &kPop,          &kFlicker,  &kOverTriangles, &kOverNodes,     &kOverPixels, &kHole,
           &kUnderReports, &kInverted, &kTwoFaced,      &kTwoFacedWhole, &kDisguise,   &kWall,
           &kNotANumber,   &kNothing,  &kSpur,          &kDropped})
    register_method(method);
  return true;
}();

}  // namespace
}  // namespace lodlab::adversaries
