// SPDX-License-Identifier: MIT
// A sum of octaves of gradient noise (Perlin 2002) whose lattices double from 2 to 4096 samples. The
// widest octaves are folded into ridges, and each octave is weighted by what stands above it, so that
// valleys are smooth and crests are broken (Musgrave's ridged multifractal).
// A row is evaluated octave by octave: along a lattice cell noise is a blend of two lines in x, whose
// coefficients come from integer hashes of the lattice point. Every operation is a single float addition
// or multiplication, never contracted, so that vector and scalar code and all windows agree.
#include "geometry/fractal.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "base/errors.h"
#include "base/mix.h"
#include "base/parallel.h"

#if defined(__clang__)
#pragma clang fp contract(off)
#elif defined(__GNUC__)
#pragma GCC optimize("fp-contract=off")
#endif

namespace lodlab {
namespace {

constexpr int kFinest = 1, kWidest = 12;  // binary logarithms of the lattice widths, samples
constexpr int kRidged = 5;                // octaves this wide and wider are folded into ridges
constexpr int kOctaves = kWidest - kFinest + 1;

/// Amplitude in metres per octave, finest first, at roughness 0.5: fitted to the RMS height differences
/// of a 3-arc-second tile of the Cascades at lags of 1 to 64 samples.
constexpr std::array<float, kOctaves> kAmplitude = {7.0f,   26.0f,  85.0f,  170.0f, 300.0f, 480.0f,
                                                    650.0f, 650.0f, 700.0f, 700.0f, 800.0f, 800.0f};

struct Gradient {
  float x, y;
};

/// One of 16 directions, so that no sine is needed.
inline Gradient gradient(uint64_t octave_seed, int64_t row, int64_t col) {
  static constexpr float kC = 0.92387953f, kS = 0.38268343f, kD = 0.70710678f;
  static constexpr std::array<Gradient, 16> kDirections = {{{1, 0},
                                                            {kC, kS},
                                                            {kD, kD},
                                                            {kS, kC},
                                                            {0, 1},
                                                            {-kS, kC},
                                                            {-kD, kD},
                                                            {-kC, kS},
                                                            {-1, 0},
                                                            {-kC, -kS},
                                                            {-kD, -kD},
                                                            {-kS, -kC},
                                                            {0, -1},
                                                            {kS, -kC},
                                                            {kD, -kD},
                                                            {kC, -kS}}};
  const uint64_t h =
      mix(octave_seed ^ mix(static_cast<uint64_t>(row) * 0x9e3779b97f4a7c15ull + static_cast<uint64_t>(col)));
  return kDirections[h >> 60];
}

inline float fade(float t) { return t * t * t * (t * (t * 6.0f - 15.0f) + 10.0f); }

/// One octave: its lattice, shifted so that lattices do not share points, and its tables along a cell.
struct Octave {
  int log2_width = 0;
  uint64_t seed = 0;
  int64_t row_shift = 0, col_shift = 0;
  float amplitude = 0.0f;
  std::vector<float> t, u;  // position within a cell at half samples, and its fade

  Octave(const Fractal& fractal, int index) : log2_width(kFinest + index) {
    const int64_t width = int64_t{1} << log2_width;
    seed = mix(fractal.seed * 0xd1342543de82ef95ull + static_cast<uint64_t>(index) + 1);
    row_shift = static_cast<int64_t>(mix(seed ^ 1) % static_cast<uint64_t>(width));
    col_shift = static_cast<int64_t>(mix(seed ^ 2) % static_cast<uint64_t>(width));
    const double finer = kWidest - log2_width;
    amplitude = static_cast<float>(kAmplitude[index] * std::exp2((fractal.roughness - 0.5) * finer));
    t.resize(static_cast<size_t>(width));
    u.resize(t.size());
    for (int64_t i = 0; i < width; ++i) {
      t[i] = (static_cast<float>(i) + 0.5f) / static_cast<float>(width);
      u[i] = fade(t[i]);
    }
  }

  /// Noise of about -1 to 1 along a row, columns col0 to col0 + count.
  void row_of_noise(int64_t row, int64_t col0, int64_t count, float* out) const {
    const int64_t width = int64_t{1} << log2_width;
    const int64_t lattice_row = (row + row_shift) >> log2_width;
    const int64_t inside = (row + row_shift) & (width - 1);
    const float ty = t[inside], uy = u[inside];
    const auto line = [&](int64_t lattice_col) {  // noise of this column's points as a line in x
      const Gradient above = gradient(seed, lattice_row, lattice_col);
      const Gradient below = gradient(seed, lattice_row + 1, lattice_col);
      const float a = above.y * ty, b = below.y * (ty - 1.0f);
      return Gradient{above.x + uy * (below.x - above.x), a + uy * (b - a)};  // slope, value at 0
    };
    int64_t col = col0 + col_shift;
    const int64_t end = col + count;
    int64_t cell = col >> log2_width;
    Gradient left = line(cell);
    for (; col < end; ++cell) {
      const Gradient right = line(cell + 1);
      const int64_t begin_in = col & (width - 1);
      const int64_t span = std::min(width - begin_in, end - col);
      const float* tx = t.data() + begin_in;
      const float* ux = u.data() + begin_in;
      for (int64_t i = 0; i < span; ++i) {
        const float a = left.y + left.x * tx[i];
        const float b = right.y + right.x * (tx[i] - 1.0f);
        out[i] = 1.5f * (a + ux[i] * (b - a));
      }
      out += span;
      col += span;
      left = right;
    }
  }
};

/// Adds the octaves to one row, widest first.
void row_of_heights(const std::vector<Octave>& octaves, int64_t row, int64_t col0, int64_t count,
                    float* heights, float* noise, float* weight) {
  std::fill(heights, heights + count, 0.0f);
  std::fill(weight, weight + count, 1.0f);
  for (int index = kOctaves - 1; index >= 0; --index) {
    const Octave& octave = octaves[static_cast<size_t>(index)];
    octave.row_of_noise(row, col0, count, noise);
    const float amplitude = octave.amplitude;
    if (octave.log2_width >= kRidged) {
      for (int64_t i = 0; i < count; ++i) {
        const float fold = 1.0f - std::abs(noise[i]);
        const float ridge = fold * fold;
        heights[i] += amplitude * weight[i] * (ridge - 0.5f);
        weight[i] = std::min(1.0f, weight[i] * (0.25f + 1.5f * ridge));
      }
    } else {
      for (int64_t i = 0; i < count; ++i) heights[i] += amplitude * (0.15f + 1.1f * weight[i]) * noise[i];
    }
  }
  for (int64_t i = 0; i < count; ++i) heights[i] += 1000.0f;
}

}  // namespace

void fractal_heights(const Fractal& fractal, int64_t row0, int64_t col0, int64_t rows, int64_t cols,
                     float* heights) {
  if (!(fractal.roughness >= 0.0 && fractal.roughness <= 1.0)) {
    throw InvalidInput("fractal: roughness " + std::to_string(fractal.roughness) + " is not within 0 to 1");
  }
  if (rows < 0 || cols < 0) throw InvalidInput("fractal: a window of negative size");
  constexpr int64_t kLimit = int64_t{1} << 40;
  for (const int64_t index : {row0, col0, row0 + rows, col0 + cols}) {
    if (index < -kLimit || index > kLimit) {
      throw InvalidInput("fractal: index " + std::to_string(index) + " is not within +-2^40");
    }
  }
  std::vector<Octave> octaves;
  for (int index = 0; index < kOctaves; ++index) octaves.emplace_back(fractal, index);
  parallel_for(rows, 16, [&](int64_t begin, int64_t end) {
    std::vector<float> noise(static_cast<size_t>(cols)), weight(noise.size());
    for (int64_t r = begin; r < end; ++r) {
      row_of_heights(octaves, row0 + r, col0, cols, heights + r * cols, noise.data(), weight.data());
    }
  });
}

}  // namespace lodlab
