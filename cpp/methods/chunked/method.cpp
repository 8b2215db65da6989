// SPDX-License-Identifier: MIT
// chunked: a quadtree of static meshes, each with a bound on its error, refined top-down until every
// projected error is within the budget; cracks between levels are hidden by skirts, pops by morphing.
// Ulrich, Rendering massive terrains using chunked level of detail control, 2002. METHOD.md says more.
#include <algorithm>

#include "base/errors.h"
#include "method/maps_option.h"
#include "method/paging_options.h"
#include "method/projector.h"
#include "methods/chunked/chunked.h"
#include "methods/chunked/hierarchy.h"

namespace lodlab {
namespace chunked {
namespace {

std::vector<OptionSpec> option_table() {
  using enum Stage;
  std::vector<OptionSpec> table{
      {"finest_error",
       0.0,
       kBuild,
       "source units",
       "Error of the last level; 0 keeps every height up to the quantum.",
       {},
       0.0,
       1e9},
      {"leaf",
       int64_t{64},
       kBuild,
       "samples",
       "Side of a chunk of the last level, a power of two.",
       {},
       4,
       256},
      {"chunk_triangles",
       int64_t{8192},
       kBuild,
       "triangles",
       "Mean triangles of a chunk that no level but the last exceeds; sets where errors start to double.",
       {},
       64,
       65536},
      attribute_option(),
      {"tau_max",
       8.0,
       kBuild,
       "pixels",
       "Largest pixel error for which texels stay below a pixel (equation 7).",
       {},
       0.01,
       1000.0},
      projection_option(),
      {"morph",
       std::string("true"),
       kDraw,
       "",
       "Blend to the parent within the budget, by the paper's formula 4, or not at all.",
       {"true", "formula4", "false"}},
      {"cracks",
       std::string("skirt"),
       kDraw,
       "",
       "Hide cracks between chunks by skirts, or show them.",
       {"skirt", "none"}},
  };
  add_paging_options(table, {"Load chunks while flying; false loads all before the first frame.",
                             "Decoded chunks kept in main memory.", "Chunks kept on the GPU."});
  return table;
}

class Chunked : public Method {
 public:
  const MethodInfo& info() const override {
    static const MethodInfo kInfo{"chunked",
                                  "Quadtree of static chunks with skirts and morphing (Ulrich 2002).",
                                  {"heightfield"},
                                  {"pixel_error", "triangles", "nodes"},
                                  true,
                                  option_table()};
    return kInfo;
  }
  void build(const Source& source, const Options& options, StoreWriter& writer,
             const Progress& progress) const override {
    chunked::build(field_in_memory(source, "build: method chunked"), options, writer, progress);
  }
  std::shared_ptr<const Hierarchy> open(std::shared_ptr<const Store> store) const override {
    return std::make_shared<ChunkedHierarchy>(std::move(store));
  }
};

}  // namespace

ChunkedHierarchy::ChunkedHierarchy(std::shared_ptr<const Store> opened)
    : store(std::move(opened)),
      frame(frame_from_json(store->meta().frame)),
      node(store->array_of<Node>("nodes")) {
  const std::vector<double> stored = store->array_of<double>("quantizer");
  if (node.empty() || stored.size() != 2) throw StoreError("chunked: " + store->path() + " holds no nodes");
  quantizer.quantum = stored[0];
  quantizer.base = static_cast<int64_t>(stored[1]);
  for (size_t i = 0; i < node.size(); ++i) {
    const Node& n = node[i];
    const bool linked = n.parent < static_cast<int32_t>(i) &&
                        (n.children == 0 || (n.first_child > i && n.first_child + n.children <= node.size()));
    if (!linked)
      throw StoreError("chunked: node " + std::to_string(i) + " of " + store->path() + " is not a tree's");
    roots += n.parent < 0;
    levels = std::max(levels, n.level + 1);
  }
  index_bytes = store->meta("index_bytes") == "2" ? 2 : 4;
  root_side = std::stoi(store->meta("root_side"));
}

std::vector<NodeInfo> ChunkedHierarchy::nodes() const {
  std::vector<NodeInfo> rows;
  rows.reserve(node.size());
  for (size_t i = 0; i < node.size(); ++i) {
    const Node& n = node[i];
    rows.push_back({static_cast<int64_t>(i),
                    n.parent,
                    n.level,
                    0,
                    n.indices / 3,
                    n.error,
                    {{n.lo[0], n.lo[1], n.lo[2]}, {n.hi[0], n.hi[1], n.hi[2]}}});
  }
  return rows;
}

int64_t ChunkedHierarchy::vertices() const {
  int64_t sum = 0;
  for (const Node& n : node) sum += n.surface_vertices;
  return sum;
}

std::unique_ptr<Session> ChunkedHierarchy::session(const Options& draw_options) const {
  return make_session(shared_from_this(), draw_options);
}

}  // namespace chunked

const Method& chunked_method() {
  static const chunked::Chunked kMethod;
  return kMethod;
}

}  // namespace lodlab
