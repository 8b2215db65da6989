// SPDX-License-Identifier: MIT
// The store of `full`: the heights as they are, the coverage mask, and maps: the colour raster if one is
// given, normals if they are asked for.
#include <mutex>

#include "base/errors.h"
#include "base/parallel.h"
#include "geometry/coverage.h"
#include "geometry/normals.h"
#include "imageio/image.h"
#include "method/maps_option.h"
#include "method/sample_code.h"
#include "methods/full/full.h"

namespace lodlab::full {
namespace {

constexpr int64_t kPageSamples = 65536;

/// Writes rows of 4-byte samples as pages, those that are there already left out.
void put_rows(StoreWriter& writer, PageKind kind, const char* stage, const uint32_t* samples, int64_t rows,
              int64_t columns, const Progress& progress) {
  const int64_t pages = page_count(rows, columns), step = rows_per_page(columns);
  Count count_page(progress, stage, pages);
  parallel_for(pages, 1, [&](int64_t begin, int64_t end) {
    for (int64_t page = begin; page < end; ++page) {
      const int64_t first = page * step, count = std::min(step, rows - first) * columns;
      if (!writer.has_page(kind, page))
        writer.put_page(kind, page, encode_samples(samples + first * columns, count));
      count_page();
    }
  });
}

Box bounds(const HeightField& field) {
  Box box;
  if (!field.planet) {
    box.add(field.position(0, 0, field.z_min));
    box.add(field.position(field.rows - 1, field.cols - 1, field.z_max));
    return box;
  }
  std::mutex mutex;
  parallel_for(field.rows, 64, [&](int64_t begin, int64_t end) {
    Box part;
    for (int64_t row = begin; row < end; ++row) {
      for (int64_t col = 0; col < field.cols; ++col) part.add(field.position(row, col, field.at(row, col)));
    }
    const std::lock_guard lock(mutex);
    box.add(part);
  });
  return box;
}

void put_colors(const std::string& file, StoreWriter& writer, const Progress& progress) {
  const ImageU8 image = read_rgba8(file);
  const auto* pixels = reinterpret_cast<const uint32_t*>(image.samples.data());
  put_rows(writer, kColors, "colours", pixels, image.height, image.width, progress);
  writer.put_array("colors", as_bytes(std::vector<int64_t>{image.width, image.height}));
}

void put_normals(const HeightField& field, StoreWriter& writer, const Progress& progress) {
  const std::vector<uint32_t> texels = normal_texels(Normals(field), field, 0, field.rows);
  put_rows(writer, kNormals, "normals", texels.data(), field.rows, field.cols, progress);
}

}  // namespace

int64_t rows_per_page(int64_t columns) { return std::max<int64_t>(1, kPageSamples / columns); }

int64_t page_count(int64_t rows, int64_t columns) {
  const int64_t step = rows_per_page(columns);
  return (rows + step - 1) / step;
}

void build(const HeightField& field, const Options& options, StoreWriter& writer, const Progress& progress) {
  static_assert(sizeof(float) == sizeof(uint32_t));
  const auto* samples = reinterpret_cast<const uint32_t*>(field.heights);
  put_rows(writer, kHeights, "heights", samples, field.rows, field.cols, progress);
  const Bytes coverage = coverage_bits(field);
  if (!coverage.empty() && !writer.has_page(kCoverage, 0)) writer.put_page(kCoverage, 0, coverage);
  if (!options.text("attribute").empty()) put_colors(options.text("attribute"), writer, progress);
  if (has_normals(options)) put_normals(field, writer, progress);
  const Box box = bounds(field);
  writer.put_array("box",
                   as_bytes(std::vector<double>{box.lo.x, box.lo.y, box.lo.z, box.hi.x, box.hi.y, box.hi.z}));
}

}  // namespace lodlab::full
