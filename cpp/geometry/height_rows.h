// SPDX-License-Identifier: MIT
// Height fields that are read row by row, so that they may be larger than memory.
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "base/progress.h"
#include "geometry/height_field.h"

namespace lodlab {

/// Writes `rows` whole rows, from row `first` on: heights, voids filled, and (if not null) 1 where a sample
/// is real, 0 in voids. Called by one thread at a time. What a row holds does not depend on the call.
using ReadRows = std::function<void(int64_t first, int64_t rows, float* heights, uint8_t* valid)>;

inline constexpr int64_t kSamplesAtOnce = int64_t{1} << 23;

/// A field that only its reader holds.
struct WindowedField final : FieldSource {
  ReadRows reader;
  int64_t at_once = 0;          ///< samples, about, that a pass over all rows reads at once
  std::string hash_of_samples;  ///< that of a HeightField of the same samples
  int64_t voids = 0;            ///< samples
  std::vector<std::byte> coverage_of_samples;

  std::string hash() const override { return hash_of_samples; }
  HeightRows read(int64_t first, int64_t end, RowBuffer& buffer) const override;
  int64_t rows_at_once() const override { return std::clamp<int64_t>(at_once / cols, 1, rows); }
  bool has_voids() const override { return voids > 0; }
  std::vector<std::byte> coverage() const override { return coverage_of_samples; }
};

/// Reads all rows once, for checks, range and hash. Throws as make_height_field does.
std::shared_ptr<const WindowedField> make_windowed_field(const FieldFrame& frame, ReadRows read,
                                                         std::string spec, const Progress& progress,
                                                         int64_t at_once = kSamplesAtOnce);

}  // namespace lodlab
