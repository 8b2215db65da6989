// SPDX-License-Identifier: MIT
// multigrain: a forest of quadtrees in which detail is chosen per node in two ways, by splitting it or by
// raising the resolution of its grid, so that the work of CPU and GPU is set apart; neighbours are stitched
// on the GPU. Niski, Purnomo, Cohen, Multi-grained level of detail using a hierarchical seamless texture
// atlas, 2007.
#include "method/map_paging.h"
#include "method/maps_option.h"
#include "method/paging_options.h"
#include "methods/multigrain/adapt.h"
#include "methods/multigrain/multigrain.h"
#include "methods/multigrain/squares.h"

namespace lodlab {
namespace multigrain {
namespace {

std::vector<OptionSpec> option_table() {
  using enum Stage;
  std::vector<OptionSpec> table{
      {"chart",
       int64_t{0},
       kBuild,
       "cells",
       "Side of a chart, a power of two; 0 chooses it for about four by four charts.",
       {},
       0,
       1 << 20},
      {"levels",
       int64_t{0},
       kBuild,
       "",
       "Levels of each chart's quadtree, fewer where its smallest nodes would have less than two cells a "
       "side; 0 takes 5, on a planet 6.",
       {},
       0,
       9},
      {"node_resolution",
       int64_t{256},
       kBuild,
       "cells",
       "Side of the finest grid that a node is drawn with, a power of two.",
       {},
       2,
       256},
      {"finest_error",
       0.0,
       kBuild,
       "source units",
       "Grids finer than this error asks for are left out; 0 keeps every sample.",
       {},
       0.0,
       1e9},
      {"bounds",
       std::string("drawn"),
       kBuild,
       "",
       "Errors of the triangles as drawn, or the paper's, of bilinear interpolation, which bound nothing.",
       {"drawn", "bilinear"}},
      attribute_option(),
      normals_option(),
      projection_option(),
      {"adapt",
       std::string("auto"),
       kDraw,
       "",
       "How the cut is found: top-down, by dual queues, by the paper's quad-queue, by dual queues at the "
       "lowest "
       "level of error within the budget, as the optimum (slow); auto: by what the budget limits.",
       {"auto", "topdown", "dual", "quad", "level", "exact"}},
      texels_option(),
  };
  add_paging_options(table, {"Load heights and maps while flying; false loads what a frame draws before it.",
                             "Decoded heights and maps kept in main memory.",
                             "Heights and maps kept on the GPU, with the grids."});
  return table;
}

class Multigrain : public Method {
 public:
  const MethodInfo& info() const override {
    static const MethodInfo kInfo{
        "multigrain",
        "Forest of nodes at many resolutions, stitched on the GPU (Niski et al. 2007).",
        {"heightfield", "planet"},
        {"pixel_error", "triangles", "nodes"},
        true,
        option_table(),
        true};
    return kInfo;
  }
  void build(const Source& source, const Options& options, StoreWriter& writer,
             const Progress& progress) const override {
    multigrain::build(heights_of(source, "build: method multigrain"), options, writer, progress);
  }
  std::shared_ptr<const Hierarchy> open(std::shared_ptr<const Store> store) const override {
    return std::make_shared<Forest>(std::move(store));
  }
};

Adapt adapt_of(const Options& options) {
  const std::string& text = options.text("adapt");
  return text == "topdown" ? Adapt::kTopDown
         : text == "dual"  ? Adapt::kDual
         : text == "quad"  ? Adapt::kQuad
         : text == "level" ? Adapt::kLevel
         : text == "exact" ? Adapt::kExact
                           : Adapt::kAuto;
}

}  // namespace

MultigrainSession::MultigrainSession(std::shared_ptr<const Forest> forest, const Options& options)
    : forest_(std::move(forest)),
      projection_(projection_of(options, !forest_->frame.planet)),
      adapt_(adapt_of(options)),
      paging_(std::make_unique<Paging>(forest_, options)),
      maps_(std::make_unique<MapPaging>(std::make_unique<NodeSquares>(forest_), maps_of(*forest_),
                                        paging_->residency(), paging_->map_bytes(),
                                        options.real("texels_per_pixel"))),
      adaptation_(std::make_unique<Adaptation>(*forest_, projection_, paging_.get())) {}

MultigrainSession::~MultigrainSession() = default;

}  // namespace multigrain

const Method& multigrain_method() {
  static const multigrain::Multigrain kMethod;
  return kMethod;
}

}  // namespace lodlab
