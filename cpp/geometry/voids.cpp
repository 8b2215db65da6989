// SPDX-License-Identifier: MIT
// Voids become a membrane: Laplace's equation with the real samples as boundary and no flux through the
// raster's edge. Multigrid V-cycles in correction form; the finest unknowns are the heights themselves.
//
// A coarse point is unknown only when all nine fine points around it are. Coarse corrections therefore
// vanish on every real sample, however thin the line that the real samples form, and cycles converge on any
// mask. Red-black sweeps over runs of unknowns make the result independent of the number of threads.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "base/errors.h"
#include "base/parallel.h"
#include "geometry/height_field.h"

namespace lodlab {
namespace {

constexpr int kSweeps = 2;  // before and after each coarse correction
constexpr int kCoarsestSweeps = 32;
constexpr int kMaxCycles = 60;
constexpr int64_t kRowsPerTask = 64;

/// Unknowns of one row from column `begin` to before `end`.
struct Run {
  int64_t begin, end;
};

struct Level {
  int64_t rows = 0, cols = 0;
  std::vector<uint8_t> unknown;
  std::vector<Run> runs;             // of all rows, in order
  std::vector<size_t> first_run;     // per row, and one past the end
  std::vector<float> value, source;  // empty at the finest level: the heights, zero

  void find_runs() {
    runs.clear();
    first_run.assign(static_cast<size_t>(rows) + 1, 0);
    for (int64_t r = 0; r < rows; ++r) {
      const uint8_t* row = unknown.data() + r * cols;
      for (int64_t c = 0; c < cols;) {
        c = std::find(row + c, row + cols, uint8_t{1}) - row;
        if (c == cols) break;
        const int64_t end = std::find(row + c, row + cols, uint8_t{0}) - row;
        runs.push_back({c, end});
        c = end;
      }
      first_run[static_cast<size_t>(r) + 1] = runs.size();
    }
  }
};

/// Sum and number of the neighbours inside the raster.
struct Around {
  float sum, count;
};

inline Around around(const float* v, int64_t rows, int64_t cols, int64_t r, int64_t c) {
  const float* p = v + r * cols + c;
  if (r > 0 && r + 1 < rows && c > 0 && c + 1 < cols) return {(p[-cols] + p[cols]) + (p[-1] + p[1]), 4.0f};
  Around out{0.0f, 0.0f};
  const auto take = [&out](float value) {
    out.sum += value;
    out.count += 1.0f;
  };
  if (r > 0) take(p[-cols]);
  if (r + 1 < rows) take(p[cols]);
  if (c > 0) take(p[-1]);
  if (c + 1 < cols) take(p[1]);
  return out;
}

class Membrane {
 public:
  Membrane(float* heights, int64_t rows, int64_t cols, std::vector<uint8_t> unknown) : heights_(heights) {
    Level finest;
    finest.rows = rows;
    finest.cols = cols;
    finest.unknown = std::move(unknown);
    finest.find_runs();
    levels_.push_back(std::move(finest));
    while (!levels_.back().runs.empty() && std::max(levels_.back().rows, levels_.back().cols) > 2) {
      levels_.push_back(coarser(levels_.back()));
    }
    if (levels_.size() > 1 && levels_.back().runs.empty()) levels_.pop_back();
  }

  /// Cycles until one changes no height by more than the tolerance.
  void solve(float tolerance) {
    for (int cycle = 0; cycle < kMaxCycles; ++cycle) {
      if (v_cycle(0) <= tolerance) return;
    }
  }

 private:
  static Level coarser(const Level& fine) {
    Level out;
    out.rows = (fine.rows + 1) / 2;
    out.cols = (fine.cols + 1) / 2;
    const size_t count = static_cast<size_t>(out.rows * out.cols);
    out.unknown.assign(count, 0);
    out.value.assign(count, 0.0f);
    out.source.assign(count, 0.0f);
    for (int64_t r = 0; r < fine.rows; r += 2) {
      for (size_t k = fine.first_run[r]; k < fine.first_run[r + 1]; ++k) {
        for (int64_t c = (fine.runs[k].begin + 1) / 2 * 2; c < fine.runs[k].end; c += 2) {
          out.unknown[(r / 2) * out.cols + c / 2] = all_unknown_around(fine, r, c);
        }
      }
    }
    out.find_runs();
    return out;
  }

  static bool all_unknown_around(const Level& level, int64_t r, int64_t c) {
    for (int64_t i = std::max<int64_t>(r - 1, 0); i <= std::min(r + 1, level.rows - 1); ++i) {
      for (int64_t j = std::max<int64_t>(c - 1, 0); j <= std::min(c + 1, level.cols - 1); ++j) {
        if (!level.unknown[i * level.cols + j]) return false;
      }
    }
    return true;
  }

  float* values(size_t l) { return l == 0 ? heights_ : levels_[l].value.data(); }
  float source(size_t l, int64_t i) const { return l == 0 ? 0.0f : levels_[l].source[i]; }

  template <class Body>  // body(row, run)
  void each_run(const Level& level, const Body& body) {
    parallel_for(level.rows, kRowsPerTask, [&](int64_t begin, int64_t end) {
      for (int64_t r = begin; r < end; ++r) {
        for (size_t k = level.first_run[r]; k < level.first_run[r + 1]; ++k) body(r, level.runs[k]);
      }
    });
  }

  void relax(size_t l, int sweeps) {
    Level& level = levels_[l];
    float* v = values(l);
    for (int half = 0; half < 2 * sweeps; ++half) {
      each_run(level, [&, half](int64_t r, Run run) {
        for (int64_t c = run.begin + ((run.begin + r + half) & 1); c < run.end; c += 2) {
          const Around a = around(v, level.rows, level.cols, r, c);
          v[r * level.cols + c] = (a.sum + source(l, r * level.cols + c)) / a.count;
        }
      });
    }
  }

  /// Restricts the residual by the transpose of the interpolation; the factor of the coarser mesh width
  /// cancels in two dimensions.
  void restrict_residual(size_t l) {
    const Level& fine = levels_[l];
    Level& coarse = levels_[l + 1];
    const float* v = values(l);
    const auto residual = [&](int64_t r, int64_t c) {
      const int64_t i = r * fine.cols + c;
      if (!fine.unknown[i]) return 0.0f;
      const Around a = around(v, fine.rows, fine.cols, r, c);
      return source(l, i) + (a.sum - a.count * v[i]);
    };
    each_run(coarse, [&](int64_t R, Run run) {
      for (int64_t C = run.begin; C < run.end; ++C) {
        float sum = 0.0f;
        for (int64_t r = std::max<int64_t>(2 * R - 1, 0); r <= std::min(2 * R + 1, fine.rows - 1); ++r) {
          for (int64_t c = std::max<int64_t>(2 * C - 1, 0); c <= std::min(2 * C + 1, fine.cols - 1); ++c) {
            sum += weight(r, 2 * R, fine.rows) * weight(c, 2 * C, fine.cols) * residual(r, c);
          }
        }
        coarse.source[R * coarse.cols + C] = sum;
        coarse.value[R * coarse.cols + C] = 0.0f;
      }
    });
  }

  /// Interpolation weight of the coarse point at `even` for fine index `i`; the last fine index of an even
  /// number has one coarse neighbour, which it copies.
  static float weight(int64_t i, int64_t even, int64_t count) {
    return i == even || i == count - 1 ? 1.0f : 0.5f;
  }

  float add_correction(size_t l) {
    const Level& fine = levels_[l];
    const Level& coarse = levels_[l + 1];
    float* v = values(l);
    std::vector<float> largest(static_cast<size_t>(fine.rows), 0.0f);
    each_run(fine, [&](int64_t r, Run run) {
      const int64_t r0 = r / 2 * coarse.cols;
      const int64_t r1 = std::min((r + 1) / 2, coarse.rows - 1) * coarse.cols;
      float most = largest[r];
      for (int64_t c = run.begin; c < run.end; ++c) {
        const int64_t c0 = c / 2, c1 = std::min((c + 1) / 2, coarse.cols - 1);
        const float* e = coarse.value.data();
        const float add = 0.25f * ((e[r0 + c0] + e[r0 + c1]) + (e[r1 + c0] + e[r1 + c1]));
        v[r * fine.cols + c] += add;
        most = std::max(most, std::abs(add));
      }
      largest[r] = most;
    });
    return *std::max_element(largest.begin(), largest.end());
  }

  /// Returns the largest correction that came from the next coarser level.
  float v_cycle(size_t l) {
    if (l + 1 == levels_.size()) {
      relax(l, kCoarsestSweeps);
      return 0.0f;
    }
    relax(l, kSweeps);
    restrict_residual(l);
    v_cycle(l + 1);
    const float largest = add_correction(l);
    relax(l, kSweeps);
    return largest;
  }

  float* heights_;
  std::vector<Level> levels_;
};

/// A first guess: means of the real samples, coarser and coarser, spread back to where there is none.
class Spread {
 public:
  static void run(float* heights, const std::vector<uint8_t>& unknown, int64_t rows, int64_t cols) {
    const int64_t r2 = (rows + 1) / 2, c2 = (cols + 1) / 2;
    std::vector<float> mean(static_cast<size_t>(r2 * c2));
    std::vector<uint8_t> none(mean.size());
    bool any = false;
    for (int64_t r = 0; r < r2; ++r) {
      for (int64_t c = 0; c < c2; ++c) {
        float sum = 0.0f, count = 0.0f;
        for (int64_t i = 2 * r; i < std::min(2 * r + 2, rows); ++i) {
          for (int64_t j = 2 * c; j < std::min(2 * c + 2, cols); ++j) {
            if (unknown[i * cols + j]) continue;
            sum += heights[i * cols + j];
            count += 1.0f;
          }
        }
        none[r * c2 + c] = count == 0.0f;
        mean[r * c2 + c] = count == 0.0f ? 0.0f : sum / count;
        any = any || count == 0.0f;
      }
    }
    if (any) run(mean.data(), none, r2, c2);
    interpolate(heights, unknown, rows, cols, mean, c2);
  }

 private:
  /// Bilinear between the centres of blocks of 2 x 2.
  static void interpolate(float* heights, const std::vector<uint8_t>& unknown, int64_t rows, int64_t cols,
                          const std::vector<float>& mean, int64_t c2) {
    const int64_t r2 = (rows + 1) / 2;
    for (int64_t r = 0; r < rows; ++r) {
      const int64_t near_r = r / 2, far_r = std::clamp<int64_t>(near_r + ((r & 1) ? 1 : -1), 0, r2 - 1);
      for (int64_t c = 0; c < cols; ++c) {
        if (!unknown[r * cols + c]) continue;
        const int64_t near_c = c / 2, far_c = std::clamp<int64_t>(near_c + ((c & 1) ? 1 : -1), 0, c2 - 1);
        heights[r * cols + c] = 0.5625f * mean[near_r * c2 + near_c] + 0.1875f * mean[near_r * c2 + far_c] +
                                0.1875f * mean[far_r * c2 + near_c] + 0.0625f * mean[far_r * c2 + far_c];
      }
    }
  }
};

}  // namespace

void fill_voids(float* heights, const uint8_t* valid, int64_t rows, int64_t cols) {
  if (rows < 1 || cols < 1) throw InvalidInput("fill_voids: a raster without samples");
  std::vector<uint8_t> unknown(static_cast<size_t>(rows * cols));
  int64_t voids = 0;
  float lo = std::numeric_limits<float>::infinity(), hi = -lo;
  for (int64_t i = 0; i < rows * cols; ++i) {
    unknown[i] = std::isnan(heights[i]) || (valid != nullptr && valid[i] == 0);
    voids += unknown[i];
    if (unknown[i]) continue;
    lo = std::min(lo, heights[i]);
    hi = std::max(hi, heights[i]);
  }
  if (voids == 0) return;
  if (voids == rows * cols) {
    throw InvalidInput("fill_voids: all " + std::to_string(voids) + " samples are void");
  }
  if (!std::isfinite(lo) || !std::isfinite(hi)) throw InvalidInput("fill_voids: a height is infinite");
  Spread::run(heights, unknown, rows, cols);
  const float rounding = 4.0f * std::numeric_limits<float>::epsilon() * std::max(std::abs(lo), std::abs(hi));
  Membrane(heights, rows, cols, std::move(unknown)).solve(std::max(1e-5f * (hi - lo), rounding));
  for (int64_t i = 0; i < rows * cols; ++i)
    heights[i] = std::clamp(heights[i], lo, hi);  // a membrane stays between
}

}  // namespace lodlab
