// SPDX-License-Identifier: MIT
// seamless: patches of four tiles and four strips, whose resolutions follow from their edges alone, so that
// two patches agree on the edge that they share without asking one another. Livny, Kogan, El-Sana, Seamless
// patches for GPU-based terrain rendering. METHOD.md says under which conditions they do.
#include <charconv>
#include <cmath>

#include "base/errors.h"
#include "method/map_paging.h"
#include "method/maps_option.h"
#include "method/paging_options.h"
#include "methods/seamless/paging.h"
#include "methods/seamless/seamless.h"
#include "methods/seamless/session.h"
#include "methods/seamless/squares.h"

namespace lodlab {
namespace seamless {
namespace {

std::vector<OptionSpec> option_table() {
  using enum Stage;
  std::vector<OptionSpec> table{
      {"finest_error",
       0.0,
       kBuild,
       "source units",
       "Levels finer than this error asks for anywhere are left out; 0 keeps every sample.",
       {},
       0.0,
       1e9},
      {"patch",
       int64_t{0},
       kBuild,
       "segments",
       "Segments of a patch's edge at its finest resolution, a power of two; 0 chooses it for about sixteen "
       "of the "
       "smallest patches along a side, from 16 to 64.",
       {},
       0,
       128},
      {"resolutions",
       int64_t{2},
       kBuild,
       "",
       "Resolutions of a tile; a patch has 2 x 2 children with two, 4 x 4 with three.",
       {},
       2,
       3},
      {"pyramid",
       std::string("vertex"),
       kBuild,
       "",
       "Heights of coarser levels: the samples at their vertices, or the paper's averages of four, which "
       "crack and "
       "bound nothing.",
       {"vertex", "average"}},
      attribute_option(),
      normals_option(),
      projection_option(),
      {"metric",
       std::string("roughness"),
       kDraw,
       "",
       "What sets resolutions: distance and the roughness beside an edge, or the paper's distance alone, "
       "which bounds "
       "nothing.",
       {"roughness", "distance"}},
      {"distance",
       std::string("nearest"),
       kDraw,
       "",
       "From the eye to an edge: to its nearest point, or to its midpoint, with which claim 1 fails.",
       {"nearest", "midpoint"}},
      {"rho",
       std::string("auto"),
       kDraw,
       "",
       "The precision factor of equation 1, a number above 0; auto: the least that the budget asks for.",
       {}},
      {"parts",
       false,
       kDraw,
       "",
       "Colours by level show strips and tiles instead, as the paper's figures 7 to 9.",
       {}},
      {"upload_bytes",
       int64_t{8} << 20,
       kDraw,
       "bytes",
       "Heights and maps that a frame may bring to the GPU while flying.",
       {},
       1024,
       int64_t{1} << 40},
      texels_option(),
  };
  add_paging_options(table,
                     {"Load heights and maps while flying; false loads what a frame draws before it.",
                      "Decoded heights and maps kept in main memory.", "Heights and maps kept on the GPU."});
  return table;
}

double rho_of(const std::string& text) {
  if (text == "auto") return 0.0;
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !(value > 0.0) || !std::isfinite(value))
    throw InvalidInput("seamless: rho=" + text + ": it is auto, or a finite number above 0");
  return value;
}

Metric metric_of(const Options& options) {
  return {options.text("metric") == "roughness", options.text("distance") == "nearest",
          rho_of(options.text("rho"))};
}

class Seamless : public Method {
 public:
  const MethodInfo& info() const override {
    static const MethodInfo kInfo{"seamless",
                                  "Patches of tiles and strips that agree on their edges (Livny et al.).",
                                  {"heightfield"},
                                  {"pixel_error", "triangles", "nodes"},
                                  true,
                                  option_table(),
                                  true};
    return kInfo;
  }
  void build(const Source& source, const Options& options, StoreWriter& writer,
             const Progress& progress) const override {
    seamless::build(heights_of(source, "build: method seamless"), options, writer, progress);
  }
  std::shared_ptr<const lodlab::Hierarchy> open(std::shared_ptr<const Store> store) const override {
    return std::make_shared<Hierarchy>(std::move(store));
  }
};

}  // namespace

SeamlessSession::SeamlessSession(std::shared_ptr<const Hierarchy> hierarchy, const Options& options)
    : hierarchy_(std::move(hierarchy)),
      projection_(projection_of(options, !hierarchy_->frame.planet)),
      metric_(metric_of(options)),
      mesh_(hierarchy_->layout.patch_log2, hierarchy_->layout.resolutions),
      parts_(options.flag("parts")),
      paging_(std::make_unique<Paging>(hierarchy_, mesh_, options)),
      maps_(std::make_unique<MapPaging>(std::make_unique<PatchSquares>(hierarchy_), maps_of(*hierarchy_),
                                        paging_->residency(), paging_->map_bytes(),
                                        options.real("texels_per_pixel"))) {}

SeamlessSession::~SeamlessSession() = default;

std::vector<std::string> SeamlessSession::warnings() const {
  std::vector<std::string> out;
  if (!metric_.roughness && metric_.rho > 0.0 && metric_.rho < 1.0) {
    out.push_back("seamless: rho=" + std::to_string(metric_.rho) +
                  " with metric=distance: claim 1 (no cracks) needs rho >= 1, or else the far edge of a "
                  "patch may have less than "
                  "its finest resolution while a neighbour splits");
  }
  if (!metric_.nearest) {
    out.push_back(
        "seamless: distance=midpoint: claim 1 (no cracks) needs the distance to the nearest point of an "
        "edge; expect "
        "cracks at any rho");
  }
  return out;
}

std::unique_ptr<Session> Hierarchy::session(const Options& draw_options) const {
  return std::make_unique<SeamlessSession>(shared_from_this(), draw_options);
}

}  // namespace seamless

const Method& seamless_method() {
  static const seamless::Seamless kMethod;
  return kMethod;
}

}  // namespace lodlab
