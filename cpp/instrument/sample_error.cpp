// SPDX-License-Identifier: MIT
// Each figure is reduced row by row, then over rows in order: the same for any number of threads.
#include "instrument/sample_error.h"

#include <algorithm>
#include <map>

#include "base/parallel.h"

namespace lodlab::instrument {
namespace {

int64_t row_grain(const HeightField& field) { return std::max<int64_t>(1, 16384 / field.cols); }

template <class Result, class Body>
std::vector<Result> per_row(const HeightField& field, const Body& body) {
  std::vector<Result> rows(static_cast<size_t>(field.rows));
  parallel_for(field.rows, row_grain(field), [&](int64_t begin, int64_t end) {
    for (int64_t row = begin; row < end; ++row) rows[static_cast<size_t>(row)] = body(row);
  });
  return rows;
}

}  // namespace

SampleError sample_error(const HeightField& field, const DrawnSurface& surface) {
  struct Row {
    double max = 0.0, squares = 0.0;
    int64_t holes = 0, samples = 0;
  };
  const auto rows = per_row<Row>(field, [&](int64_t row) {
    Row out;
    for (int64_t col = 0; col < field.cols; ++col) {
      if (!field.is_valid(row, col)) continue;
      ++out.samples;
      const double deviation = surface.deviation(row * field.cols + col);
      if (std::isnan(deviation)) {
        ++out.holes;
      } else {
        out.max = std::max(out.max, std::abs(deviation));
        out.squares += deviation * deviation;
      }
    }
    return out;
  });
  SampleError out;
  double max = 0.0, squares = 0.0;
  for (const Row& row : rows) {
    max = std::max(max, row.max);
    squares += row.squares;
    out.holes += row.holes;
    out.samples += row.samples;
  }
  if (out.samples == 0) return out;
  out.max = out.holes > 0 ? kInfinite : max;
  out.rms = out.holes > 0 ? kInfinite : std::sqrt(squares / static_cast<double>(out.samples));
  return out;
}

double sample_error_px(const HeightField& field, const SampleGrid& grid, const DrawnSurface& surface,
                       const InView& in_view) {
  // -1 says that no sample of the row is in view. Once one is, exact samples need no test.
  const Camera& camera = in_view.camera();
  const auto rows = per_row<double>(field, [&](int64_t row) {
    double worst = -1.0;
    for (int64_t col = 0; col < field.cols; ++col) {
      const double deviation = surface.deviation(row * field.cols + col);
      if (worst >= 0.0 && deviation == 0.0) continue;
      if (!field.is_valid(row, col)) continue;
      const glm::dvec3 sample = grid.relative(row, col, grid.height(field, row, col), camera.eye);
      if (!in_view(sample)) continue;
      if (std::isnan(deviation)) return kInfinite;
      const glm::dvec3 drawn = sample + deviation * grid.up(row, col);
      worst = std::max(worst, screen_distance(camera, sample, drawn));
    }
    return worst;
  });
  const double worst = *std::max_element(rows.begin(), rows.end());
  return worst < 0.0 ? kUndefined : worst;
}

double surface_jump(const HeightField& field, const SampleGrid& grid, const DrawnSurface& before,
                    const DrawnSurface& after, const InView& in_view) {
  // -1 says that no sample of the row qualifies.
  const Camera& camera = in_view.camera();
  const auto rows = per_row<double>(field, [&](int64_t row) {
    double worst = -1.0;
    for (int64_t col = 0; col < field.cols; ++col) {
      const int64_t index = row * field.cols + col;
      if (!field.is_valid(row, col) || !before.covered(index) || !after.covered(index)) continue;
      const double from = before.deviation(index), to = after.deviation(index);
      if (worst >= 0.0 && from == to) continue;
      const glm::dvec3 sample = grid.relative(row, col, grid.height(field, row, col), camera.eye);
      if (!in_view(sample)) continue;
      const glm::dvec3 up = grid.up(row, col);
      worst = std::max(worst, screen_distance(camera, sample + from * up, sample + to * up));
    }
    return worst;
  });
  const double worst = *std::max_element(rows.begin(), rows.end());
  return worst < 0.0 ? kUndefined : worst;
}

std::vector<NodeError> worst_of_nodes(const render::Captured& captured,
                                      const std::vector<float>& worst_of_triangle) {
  std::map<uint32_t, float> by_node;
  for (size_t triangle = 0; triangle < worst_of_triangle.size(); ++triangle) {
    if (worst_of_triangle[triangle] < 0.0f) continue;
    float& seen = by_node[captured.vertices[3 * triangle].node];
    seen = std::max(seen, worst_of_triangle[triangle]);
  }
  std::vector<NodeError> out;
  for (const auto& [node, max] : by_node) out.push_back({node, max});
  return out;
}

}  // namespace lodlab::instrument
