// SPDX-License-Identifier: MIT
#include "geometry/height_rows.h"

#include <algorithm>

#include "base/errors.h"
#include "geometry/coverage.h"
#include "geometry/height_check.h"

namespace lodlab {
std::shared_ptr<const WindowedField> make_windowed_field(const FieldFrame& frame, ReadRows read,
                                                         std::string spec, const Progress& progress,
                                                         int64_t at_once) {
  check_frame(frame);
  auto field = std::make_shared<WindowedField>();
  static_cast<FieldFrame&>(*field) = frame;
  field->at_once = at_once;
  const int64_t step = field->rows_at_once();
  std::vector<float> heights(static_cast<size_t>(step * frame.cols));
  // Masks of the rows read at once, after that of the row before them.
  std::vector<uint8_t> masks(static_cast<size_t>((step + 1) * frame.cols));
  uint8_t* const valid = masks.data() + frame.cols;
  CoverageBits coverage(frame);
  HeightRange range;
  HeightHash hash;
  for (int64_t row = 0; row < frame.rows; row += step) {
    const int64_t rows = std::min(step, frame.rows - row), count = rows * frame.cols;
    read(row, rows, heights.data(), valid);
    widen(range, frame, heights.data(), row, rows);
    hash.add(heights.data(), count);
    hash.add_mask(valid, count);
    field->voids += std::count(valid, valid + count, uint8_t{0});
    for (int64_t i = row == 0 ? 1 : 0; i < rows; ++i)
      coverage.set_row(row + i - 1, valid + (i - 1) * frame.cols, valid + i * frame.cols);
    std::copy_n(valid + (rows - 1) * frame.cols, frame.cols, masks.data());
    if (progress) progress("reading", static_cast<double>(row + rows) / static_cast<double>(frame.rows));
  }
  if (field->voids == frame.rows * frame.cols) throw InvalidInput("height field: all samples are void");
  if (field->voids > 0) field->coverage_of_samples = coverage.take();
  set_range(*field, range);
  field->hash_of_samples = hash.finish(*field, field->voids > 0);
  field->reader = std::move(read);
  field->spec = std::move(spec);
  return field;
}

HeightRows WindowedField::read(int64_t first, int64_t end_row, RowBuffer& b) const {
  const int64_t kept_to = std::min(end_row, b.end), size = (end_row - first) * cols;
  b.heights.resize(std::max(b.heights.size(), static_cast<size_t>(size)));
  if (b.masks) b.valid.resize(b.heights.size());
  int64_t next = first;
  if (first >= b.first && first < kept_to) {
    const int64_t from = (first - b.first) * cols, count = (kept_to - first) * cols;
    std::copy_n(b.heights.begin() + from, count, b.heights.begin());
    if (b.masks) std::copy_n(b.valid.begin() + from, count, b.valid.begin());
    next = kept_to;
  }
  b.first = b.end = first;  // should the reader throw
  const int64_t at = (next - first) * cols;
  if (next < end_row)
    reader(next, end_row - next, b.heights.data() + at, b.masks ? b.valid.data() + at : nullptr);
  b.end = end_row;
  const bool masked = b.masks && has_voids();
  return {*this, b.heights.data(), masked ? b.valid.data() : nullptr, first, end_row};
}

}  // namespace lodlab
