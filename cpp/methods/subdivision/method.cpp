// SPDX-License-Identifier: MIT
// subdivision: GPU-based adaptive subdivision (Bauman, Livny, El-Sana). METHOD.md says more.
#include "method/paging_options.h"
#include "method/projector.h"
#include "methods/subdivision/refine.h"

namespace lodlab {
namespace subdivision {
namespace {

std::vector<OptionSpec> option_table() {
  using enum Stage;
  OptionSpec poses{"poses",
                   std::string("none"),
                   kBuild,
                   "",
                   "none; or the source in poses that it will be drawn in, as files with ';' or ',' between "
                   "them: meshes of "
                   "the same triangles, for which the control mesh is made as well.",
                   {}};
  poses.meshes = true;
  std::vector<OptionSpec> table = {
      {"target",
       int64_t{0},
       kBuild,
       "triangles",
       "Of the control mesh, or as few as valid collapses leave; 0: as many that the finest triangles are as "
       "many as the source's, of small sources more.",
       {},
       0.0,
       1e9},
      {"degree", int64_t{17}, kBuild, "", "Samples along an edge of a control face: 2^d + 1.", {}, 3.0, 33.0},
      {"sampling",
       std::string("interpolation"),
       kBuild,
       "",
       "Heights where normals meet the source, or means of what lies round these.",
       {"interpolation", "intersection"}},
      {"bits", std::string("16"), kBuild, "", "Bits of a height.", {"32", "16", "11"}},
      poses,
      {"metric",
       std::string("bound"),
       kDraw,
       "",
       "What lines are split by: their bounds, or the paper's projected length or that times the curvature, "
       "which promise no bound.",
       {"bound", "length", "curvature"}},
      {"pipeline",
       std::string("compute"),
       kDraw,
       "",
       "Compute shaders, or the paper's geometry shader and transform feedback: the same triangles.",
       {"compute", "geometry"}},
      projection_option(),
  };
  add_paging_options(
      table,
      {"Load displacement while flying; a control face is flat until its data arrives.",
       "Main memory for displacement ready to upload.",
       "GPU memory in all: control mesh, records, triangles, and displacement with what comes of it."});
  return table;
}

class Subdivision : public Method {
 public:
  const MethodInfo& info() const override {
    static const MethodInfo kInfo{
        .name = "subdivision",
        .summary = "A control mesh bisected on the GPU each frame and displaced along its normals.",
        .accepts = {"mesh"},
        .budgets = {"pixel_error", "triangles"},
        .options = option_table(),
        .needs = Needs::kManifold,
        .deforms = true,
    };
    return kInfo;
  }
  void build(const Source& source, const Options& options, StoreWriter& writer,
             const Progress& progress) const override {
    subdivision::build(source, options, writer, progress);
  }
  std::shared_ptr<const Hierarchy> open(std::shared_ptr<const Store> store) const override {
    return std::make_shared<SubdivisionHierarchy>(std::move(store));
  }
};

}  // namespace

SubdivisionHierarchy::SubdivisionHierarchy(std::shared_ptr<const Store> store)
    : store_(std::move(store)),
      stored_(get(*store_)),
      samples_(stored_.control, Pattern::of_degree(stored_.shape.degree)),
      displaced_(samples_, stored_.heights),
      records_(records_at_rest(stored_, displaced_)) {
  const auto rest = std::make_shared<RestControl>();
  rest->middle = centre();
  rest->positions.assign(stored_.control.positions.begin(), stored_.control.positions.end());
  rest->normals.assign(stored_.control.normals.begin(), stored_.control.normals.end());
  rest->faces = stored_.control.faces;
  rest_ = rest;
  told_ = store_->meta("build");
}

Box SubdivisionHierarchy::box() const {
  const Stored::Shape& s = stored_.shape;
  return {{s.lo[0], s.lo[1], s.lo[2]}, {s.hi[0], s.hi[1], s.hi[2]}};
}

std::vector<NodeInfo> SubdivisionHierarchy::nodes() const {
  const int levels = pattern().levels();
  std::vector<NodeInfo> out;
  std::vector<int64_t> triangles;
  for (int level = 0; level < levels; ++level) triangles.push_back(triangles_at_level(pattern(), level));
  std::vector<vec3> points(static_cast<size_t>(pattern().points()));
  for (int64_t f = 0; f < stored_.shape.faces; ++f) {
    displaced_.of_face(f, points);
    Box box;
    for (const vec3& p : points) box.add(glm::dvec3(p) + centre());
    for (int level = 0; level < levels; ++level)
      out.push_back({f, -1, 0, level, triangles[static_cast<size_t>(level)], stored_.bound(f, level), box});
  }
  return out;
}

std::unique_ptr<Session> SubdivisionHierarchy::session(const Options& draw_options) const {
  return make_session(shared_from_this(), draw_options);
}

}  // namespace subdivision

const Method& subdivision_method() {
  static const subdivision::Subdivision kMethod;
  return kMethod;
}

}  // namespace lodlab
