// SPDX-License-Identifier: MIT
// Height fields that are read row by row, so that they may be larger than memory. What works on bands of rows
// (HeightRows) works on fields in memory (one band, never copied) and on windowed ones alike, and equal
// samples give equal results and hashes whatever the bands.
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

/// Whole rows of a field: [first_row, end_row). The frame is that of the whole field.
struct HeightRows : FieldFrame {
  HeightRows(const FieldFrame& frame, const float* data, int64_t first, int64_t end)
      : FieldFrame(frame), heights(data), first_row(first), end_row(end) {}
  HeightRows(const HeightField& field) : HeightRows(field, field.heights, 0, field.rows) {}

  const float* row(int64_t r) const { return heights + (r - first_row) * cols; }
  float at(int64_t r, int64_t col) const { return row(r)[col]; }

  const float* heights;  ///< of row first_row, then those after it
  int64_t first_row, end_row;
};

/// Writes `rows` whole rows, from row `first` on: heights, voids filled, and (if not null) 1 where a sample
/// is real, 0 in voids. Called by one thread at a time. What a row holds does not depend on the call.
using ReadRows = std::function<void(int64_t first, int64_t rows, float* heights, uint8_t* valid)>;

/// A field that only its reader holds.
struct WindowedField : FieldFrame {
  ReadRows read;
  int64_t at_once = 0;              ///< samples, about, that a pass over all rows reads at once
  std::string spec;                 ///< as HeightField::spec
  std::string hash;                 ///< as HeightField::hash() of the same samples
  int64_t voids = 0;                ///< samples
  std::vector<std::byte> coverage;  ///< as coverage.h

  int64_t rows_at_once() const { return std::clamp<int64_t>(at_once / cols, 1, rows); }
};

inline constexpr int64_t kSamplesAtOnce = int64_t{1} << 23;

/// Reads all rows once, for checks, range and hash. Throws as make_height_field does.
std::shared_ptr<const WindowedField> make_windowed_field(const FieldFrame& frame, ReadRows read,
                                                         std::string spec, const Progress& progress,
                                                         int64_t at_once = kSamplesAtOnce);

/// Bands of a field in memory (views of it) or of a windowed one (read into a buffer).
class Bands {
 public:
  explicit Bands(std::shared_ptr<const HeightField> field) : field_(std::move(field)) {}
  explicit Bands(std::shared_ptr<const WindowedField> field) : windowed_(std::move(field)) {}

  const FieldFrame& frame() const {
    return field_ != nullptr ? static_cast<const FieldFrame&>(*field_) : *windowed_;
  }
  /// The field in memory, or null.
  const HeightField* whole() const { return field_.get(); }
  /// The mask of coverage.h.
  std::vector<std::byte> coverage() const;
  /// Rows [first, end), valid until the next call. Rows that the last call gave are not read again.
  HeightRows rows(int64_t first, int64_t end);

 private:
  std::shared_ptr<const HeightField> field_;
  std::shared_ptr<const WindowedField> windowed_;
  std::vector<float> buffer_;
  int64_t first_ = 0, end_ = 0;  ///< rows in the buffer
};

}  // namespace lodlab
