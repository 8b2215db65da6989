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
  if (field->voids > 0) field->coverage = coverage.take();
  set_range(*field, range);
  field->hash = hash.finish(*field, field->voids > 0);
  field->read = std::move(read);
  field->spec = std::move(spec);
  return field;
}

std::vector<std::byte> Bands::coverage() const {
  return field_ != nullptr ? coverage_bits(*field_) : windowed_->coverage;
}

HeightRows Bands::rows(int64_t first, int64_t end) {
  if (field_ != nullptr) return *field_;
  const int64_t cols = windowed_->cols;
  const int64_t kept_from = std::max(first, first_), kept_to = std::min(end, end_);
  const bool keeps = first >= first_ && first < kept_to;
  buffer_.resize(std::max(buffer_.size(), static_cast<size_t>((end - first) * cols)));
  int64_t next = first;
  if (keeps) {
    std::copy_n(buffer_.begin() + (kept_from - first_) * cols, (kept_to - kept_from) * cols, buffer_.begin());
    next = kept_to;
  }
  first_ = end_ = first;  // should the reader throw
  if (next < end) windowed_->read(next, end - next, buffer_.data() + (next - first) * cols, nullptr);
  end_ = end;
  return {*windowed_, buffer_.data(), first, end};
}

}  // namespace lodlab
