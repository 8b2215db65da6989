// SPDX-License-Identifier: MIT
#include "instrument/drawn_surface.h"

#include <string>

#include "base/errors.h"
#include "base/parallel.h"
#include "instrument/captured.h"
#include "instrument/surface_writer.h"

namespace lodlab::instrument {
namespace {

constexpr int64_t kGrain = 4096;

void keep_smallest(std::atomic<int64_t>& smallest, int64_t value) {
  int64_t seen = smallest.load();
  while (value < seen && !smallest.compare_exchange_weak(seen, value)) {
  }
}

template <class Rasterizer>
void rasterize(const Rasterizer& rasterizer, const render::Captured& captured, const SurfaceWriter& prototype,
               std::vector<float>* worst_of_triangle) {
  std::atomic<int64_t> first_bad{captured.triangles()};
  parallel_for(captured.triangles(), kGrain, [&](int64_t begin, int64_t end) {
    SurfaceWriter out = prototype;
    for (int64_t triangle = begin; triangle < end; ++triangle) {
      const TriangleVertices vertices = captured.vertices.data() + 3 * triangle;
      if (!is_finite(vertices[0]) || !is_finite(vertices[1]) || !is_finite(vertices[2]))
        return keep_smallest(first_bad, triangle);
      if (is_filler(vertices)) continue;
      out.start_triangle();
      rasterizer.draw(vertices, out);
      if (worst_of_triangle != nullptr) (*worst_of_triangle)[static_cast<size_t>(triangle)] = out.worst();
    }
  });
  if (first_bad < captured.triangles()) check_finite(captured, first_bad);
}

}  // namespace

DrawnSurface::DrawnSurface(const HeightField& field, const SampleGrid& grid, const render::Captured& captured,
                           std::vector<float>* worst_of_triangle)
    : keys_(static_cast<size_t>(field.rows * field.cols), 0) {
  if (captured.vertices.size() % 3 != 0) {
    throw InvalidInput("measure: " + std::to_string(captured.vertices.size()) +
                       " captured vertices; three a triangle are needed");
  }
  if (worst_of_triangle != nullptr) worst_of_triangle->assign(captured.vertices.size() / 3, -1.0f);
  std::vector<uint32_t> unsure(field.planet ? keys_.size() : 0, SurfaceWriter::kNothing);
  const SurfaceWriter writer(field, grid, keys_, unsure);
  if (field.planet) {
    rasterize(PlanetRasterizer(grid, captured.eye), captured, writer, worst_of_triangle);
    for (size_t i = 0; i < keys_.size(); ++i) {
      if (keys_[i] == 0 && unsure[i] != SurfaceWriter::kNothing) keys_[i] = unsure[i];
    }
    for (const int64_t row : {int64_t{0}, field.rows - 1}) {
      if (grid.is_pole(row))
        std::fill_n(keys_.begin() + row * field.cols, field.cols, keys_[row * field.cols]);
    }
  } else {
    rasterize(FlatRasterizer(grid, captured.eye), captured, writer, worst_of_triangle);
  }
}

}  // namespace lodlab::instrument
