// SPDX-License-Identifier: MIT
// full: the source at full resolution, drawn with one call. The reference picture of every measurement, and
// what a user has before using any level of detail: the speed to beat. METHOD.md says more.
#include <cmath>

#include "base/errors.h"
#include "base/parallel.h"
#include "method/maps_option.h"
#include "method/sample_code.h"
#include "methods/full/full.h"

namespace lodlab {
namespace full {
namespace {

std::vector<OptionSpec> option_table() {
  using enum Stage;
  return {
      {"finest_error", 0.0, kBuild, "source units", "Always 0: every sample is kept as it is.", {}, 0.0, 0.0},
      attribute_option(),
      normals_option(),
      {"projection",
       std::string("strict"),
       kDraw,
       "",
       "How errors become pixels; of no effect where every error is 0.",
       {"strict", "vertical", "paper"}},
  };
}

/// Rasters lie over fields; a mesh has its vertices' own colours and its triangles' own normals.
void refuse_maps(const Options& options) {
  if (!options.text("attribute").empty())
    throw Unsupported("build: option attribute lays a raster over a height field; a mesh has none");
  if (has_normals(options))
    throw Unsupported("build: option normals = attribute needs a height field; a mesh has none");
}

class Full : public Method {
 public:
  const MethodInfo& info() const override {
    static const MethodInfo kInfo{"full",
                                  "The source at full resolution in one static buffer, drawn with one call.",
                                  {"heightfield", "planet", "mesh"},
                                  {},
                                  true,
                                  option_table()};
    return kInfo;
  }
  void build(const Source& source, const Options& options, StoreWriter& writer,
             const Progress& progress) const override {
    if (const auto* mesh = dynamic_cast<const Mesh*>(&source)) {
      refuse_maps(options);
      full::build_mesh(*mesh, writer, progress);
    } else {
      full::build(field_in_memory(source, "build: method full"), options, writer, progress);
    }
  }
  std::shared_ptr<const Hierarchy> open(std::shared_ptr<const Store> store) const override {
    if (kind_of_frame(store->meta().frame) == "mesh") return full::open_mesh(std::move(store));
    return std::make_shared<FullHierarchy>(std::move(store));
  }
};

/// Reads pages of 4-byte samples that put_rows wrote.
void read_rows(const Store& store, PageKind kind, void* samples, int64_t rows, int64_t columns) {
  const int64_t step = rows_per_page(columns);
  parallel_for(page_count(rows, columns), 1, [&](int64_t begin, int64_t end) {
    for (int64_t page = begin; page < end; ++page) {
      const int64_t first = page * step;
      decode_samples(store.page(kind, page), static_cast<uint32_t*>(samples) + first * columns,
                     std::min(step, rows - first) * columns);
    }
  });
}

}  // namespace

bool is_pole(const FieldFrame& frame, int64_t row) {
  return frame.planet && std::abs(frame.latitude(row)) == 90.0;
}

int64_t triangle_count(const FieldFrame& frame) {
  const int64_t columns = vertex_columns(frame) - 1;
  const int64_t poles = (is_pole(frame, 0) ? 1 : 0) + (is_pole(frame, frame.rows - 1) ? 1 : 0);
  return columns * (2 * (frame.rows - 1) - poles);
}

FullHierarchy::FullHierarchy(std::shared_ptr<const Store> store)
    : store_(std::move(store)), frame_(frame_from_json(store_->meta().frame)) {
  const std::vector<double> box = store_->array_of<double>("box");
  if (box.size() != 6) throw StoreError("full: " + store_->path() + " holds no bounds");
  root_.box = {{box[0], box[1], box[2]}, {box[3], box[4], box[5]}};
  root_.triangles = triangle_count(frame_);
}

int64_t FullHierarchy::vertices() const {
  int64_t count = frame_.rows * frame_.cols;
  for (const int64_t row : {int64_t{0}, frame_.rows - 1}) {
    if (is_pole(frame_, row)) count -= frame_.cols - 1;
  }
  return count;
}

std::unique_ptr<Session> FullHierarchy::session(const Options&) const {
  return std::make_unique<FullSession>(shared_from_this());
}

std::vector<float> FullHierarchy::heights() const {
  std::vector<float> heights(static_cast<size_t>(frame_.rows * frame_.cols));
  read_rows(*store_, kHeights, heights.data(), frame_.rows, frame_.cols);
  return heights;
}

Bytes FullHierarchy::coverage() const {
  return store_->has_page(kCoverage, 0) ? store_->page(kCoverage, 0) : Bytes();
}

FullHierarchy::Raster FullHierarchy::colors() const {
  Raster colors;
  if (!store_->has_page(kColors, 0)) return colors;
  const std::vector<int64_t> size = store_->array_of<int64_t>("colors");
  if (size.size() != 2) throw StoreError("full: " + store_->path() + " does not say the size of its colours");
  colors.width = static_cast<int>(size[0]);
  colors.height = static_cast<int>(size[1]);
  colors.pixels.resize(static_cast<size_t>(size[0] * size[1]));
  read_rows(*store_, kColors, colors.pixels.data(), size[1], size[0]);
  return colors;
}

FullHierarchy::Raster FullHierarchy::normals() const {
  if (!store_->has_page(kNormals, 0)) return {};
  Raster out{static_cast<int>(frame_.cols), static_cast<int>(frame_.rows), {}};
  out.pixels.resize(static_cast<size_t>(frame_.rows * frame_.cols));
  read_rows(*store_, kNormals, out.pixels.data(), frame_.rows, frame_.cols);
  return out;
}

}  // namespace full

const Method& full_method() {
  static const full::Full kMethod;
  return kMethod;
}

}  // namespace lodlab
