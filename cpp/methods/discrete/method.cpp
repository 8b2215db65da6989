// SPDX-License-Identifier: MIT
// discrete: discrete levels of detail, what practitioners use: a few meshes of each thing, the coarsest that
// is good enough drawn. METHOD.md says more.
#include <cmath>

#include "base/errors.h"
#include "method/projector.h"
#include "methods/discrete/discrete.h"

namespace lodlab {
namespace discrete {
namespace {

std::vector<OptionSpec> option_table() {
  using enum Stage;
  OptionSpec levels{
      "levels",
      std::string("auto"),
      kBuild,
      "",
      "auto: the triangles halved again and again; or meshes, as files with ';' or ',' between them.",
      {}};
  levels.meshes = true;
  return {
      {"finest_error",
       0.0,
       kBuild,
       "source units",
       "Of levels that are made: those finer than this takes are left out; 0 keeps the source as the last.",
       {},
       0.0,
       1e30},
      levels,
      projection_option(),
  };
}

class Discrete : public Method {
 public:
  const MethodInfo& info() const override {
    static const MethodInfo kInfo{
        "discrete",
        "Discrete levels of the whole source or of each component, the coarsest good enough drawn.",
        {"heightfield", "mesh"},
        {"pixel_error", "triangles"},
        true,
        option_table()};
    return kInfo;
  }
  void build(const Source& source, const Options& options, StoreWriter& writer,
             const Progress& progress) const override {
    discrete::build(source, options, writer, progress);
  }
  std::shared_ptr<const Hierarchy> open(std::shared_ptr<const Store> store) const override {
    return std::make_shared<DiscreteHierarchy>(std::move(store));
  }
};

}  // namespace

DiscreteHierarchy::DiscreteHierarchy(std::shared_ptr<const Store> store)
    : node(store->array_of<Node>("nodes")),
      chain(store->array_of<Chain>("chains")),
      store_(std::move(store)),
      on_mesh_(kind_of_frame(store_->meta().frame) == "mesh") {
  if (!on_mesh_) frame_ = frame_from_json(store_->meta().frame);
  uint64_t next = 0;
  for (const Chain& c : chain) {
    if (c.first != next || c.levels == 0)
      throw StoreError("discrete: " + store_->path() + ": its chains are none");
    next += c.levels;
    box.add({c.lo[0], c.lo[1], c.lo[2]});
    box.add({c.hi[0], c.hi[1], c.hi[2]});
  }
  if (next == 0 || next != node.size())
    throw StoreError("discrete: " + store_->path() + ": " + std::to_string(node.size()) +
                     " nodes in chains of " + std::to_string(next));
  for (size_t i = 0; i < node.size(); ++i) {
    if (has_low(*store_, kMeshes, static_cast<int64_t>(i))) quantum_ = stored_step(box, false);
  }
}

std::vector<NodeInfo> DiscreteHierarchy::nodes() const {
  std::vector<NodeInfo> out;
  for (size_t i = 0; i < node.size(); ++i) {
    const Node& n = node[i];
    const Chain& c = chain[static_cast<size_t>(n.chain)];
    const auto id = static_cast<int64_t>(i);
    out.push_back({id,
                   n.level == 0 ? -1 : id - 1,
                   n.level,
                   0,
                   n.triangles,
                   n.error,
                   {{c.lo[0], c.lo[1], c.lo[2]}, {c.hi[0], c.hi[1], c.hi[2]}}});
  }
  return out;
}

int64_t DiscreteHierarchy::vertices() const {
  int64_t out = 0;
  for (const Node& n : node) out += n.vertices;
  return out;
}

Bytes DiscreteHierarchy::coverage() const {
  return store_->has_page(kCoverage, 0) ? store_->page(kCoverage, 0) : Bytes();
}

std::vector<StoredMesh> DiscreteHierarchy::meshes() const {
  std::vector<StoredMesh> out;
  for (size_t i = 0; i < node.size(); ++i)
    out.push_back(get_mesh(*store_, kMeshes, static_cast<int64_t>(i), node[i].vertices, node[i].triangles));
  return out;
}

std::unique_ptr<Session> DiscreteHierarchy::session(const Options& draw_options) const {
  return make_session(shared_from_this(), draw_options);
}

}  // namespace discrete

const Method& discrete_method() {
  static const discrete::Discrete kMethod;
  return kMethod;
}

}  // namespace lodlab
