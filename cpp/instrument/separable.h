// SPDX-License-Identifier: MIT
// Filters of pictures that are a product of one filter along rows and one along columns. A kernel is even or
// odd, so that half of its weights say all; sums are floats, taken in one order whatever the threads.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

namespace lodlab::instrument {

/// weights[k] at the offsets k and -k; odd: negated at -k.
struct Kernel {
  std::vector<float> weights;
  bool odd = false;
  int radius() const { return static_cast<int>(weights.size()) - 1; }
};

/// out[i] = sum over k of weight(k) * at(k)[i] for i in [0, count). `at(offset)` is a pointer to `count`
/// values, shifted along the row or in the row so many further down.
template <class At>
void convolve(const Kernel& kernel, const At& at, int64_t count, float* out) {
  constexpr int64_t kBlock = 512;  // sums stay in the first cache
  for (int64_t from = 0; from < count; from += kBlock) {
    const int64_t n = std::min(kBlock, count - from);
    float* sum = out + from;
    const float* middle = at(0) + from;
    for (int64_t i = 0; i < n; ++i) sum[i] = kernel.weights[0] * middle[i];
    for (int k = 1; k <= kernel.radius(); ++k) {
      const float *after = at(k) + from, *before = at(-k) + from;
      const float weight = kernel.weights[static_cast<size_t>(k)];
      if (kernel.odd) {
        for (int64_t i = 0; i < n; ++i) sum[i] += weight * (after[i] - before[i]);
      } else {
        for (int64_t i = 0; i < n; ++i) sum[i] += weight * (after[i] + before[i]);
      }
    }
  }
}

}  // namespace lodlab::instrument
