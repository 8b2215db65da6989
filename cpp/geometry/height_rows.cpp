// SPDX-License-Identifier: MIT
#include "geometry/height_rows.h"

#include <algorithm>

#include "geometry/height_check.h"

namespace lodlab {
namespace {

constexpr int64_t kSurveyed = int64_t{1} << 22;  // samples read at once

}  // namespace

std::shared_ptr<const WindowedField> make_windowed_field(const FieldFrame& frame, ReadRows read,
                                                         std::string spec, const Progress& progress) {
  check_frame(frame);
  auto field = std::make_shared<WindowedField>();
  static_cast<FieldFrame&>(*field) = frame;
  const int64_t step = std::clamp<int64_t>(kSurveyed / frame.cols, 1, frame.rows);
  std::vector<float> heights(static_cast<size_t>(step * frame.cols));
  HeightRange range;
  HeightHash hash;
  for (int64_t row = 0; row < frame.rows; row += step) {
    const int64_t rows = std::min(step, frame.rows - row);
    read(row, rows, heights.data());
    widen(range, frame, heights.data(), row, rows);
    hash.add(heights.data(), rows * frame.cols);
    if (progress) progress("reading", static_cast<double>(row + rows) / static_cast<double>(frame.rows));
  }
  set_range(*field, range);
  field->hash = hash.finish(*field, nullptr);
  field->read = std::move(read);
  field->spec = std::move(spec);
  return field;
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
  if (next < end) windowed_->read(next, end - next, buffer_.data() + (next - first) * cols);
  end_ = end;
  return {*windowed_, buffer_.data(), first, end};
}

}  // namespace lodlab
