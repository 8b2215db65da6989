// SPDX-License-Identifier: MIT
// What is kept of an edge: two bytes. They hold the logarithms, rounded up, of
//   weight  what the metric `roughness` multiplies its precision with: error a length, raised until claim 1
//   holds
//           (closure.h);
//   low     the bound of what is drawn beside the edge at its coarsest resolution, as a part of weight x
//   length; mid     with three resolutions, that of the one between, as a part of `low`.
// The bound at an edge's finest resolution is that of its patch's children at their coarsest. A whole number
// of codes is an octave, so that half a weight is a weight, exactly.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

namespace lodlab::seamless {

class CodeBook {
 public:
  /// `largest`: the weight of the largest code.
  CodeBook(int resolutions, double largest)
      : steps_(resolutions == 2 ? 8 : 2),
        weight_bits_(resolutions == 2 ? 8 : 6),
        part_bits_(resolutions == 2 ? 8 : 5),
        weights_(size_t{1} << weight_bits_),
        parts_(size_t{1} << part_bits_) {
    const int top = (1 << weight_bits_) - 1;
    for (int i = 1; i <= top; ++i) weights_[static_cast<size_t>(i)] = largest * power(i - top);
    for (int i = 0; i < (1 << part_bits_) - 1; ++i) parts_[static_cast<size_t>(i)] = power(-i);
  }

  /// Codes an octave.
  int steps() const { return steps_; }
  double largest() const { return weights_.back(); }
  double weight(uint16_t code) const { return weights_[weight_code(code)]; }
  /// Source units, as `length` is: that of the edge.
  double low(uint16_t code, double length) const {
    return weight(code) * length * parts_[(code >> weight_bits_) & part_mask()];
  }
  double mid(uint16_t code, double length) const {
    return low(code, length) * parts_[(code >> (weight_bits_ + part_bits_)) & part_mask()];
  }

  unsigned weight_code(uint16_t code) const { return code & ((1u << weight_bits_) - 1u); }
  /// The smallest code whose weight is at least this, which is no larger than the largest.
  int weight_code_of(double weight) const;
  /// The code of an edge: `weight_code` is one whose weight x length is at least `low` >= `mid`.
  uint16_t encode(int weight_code, double low, double mid, double length) const;

 private:
  double power(int i) const {
    return std::ldexp(std::exp2((i - floor_div(i) * steps_) / double(steps_)), floor_div(i));
  }
  int floor_div(int i) const { return i >= 0 ? i / steps_ : -((-i + steps_ - 1) / steps_); }
  unsigned part_mask() const { return (1u << part_bits_) - 1u; }
  /// The largest code whose part of `whole` is at least `value`; the last one is nothing.
  unsigned part_code(double value, double whole) const;

  int steps_, weight_bits_, part_bits_;
  std::vector<double> weights_, parts_;  // the first weight and the last part are 0
};

inline int CodeBook::weight_code_of(double weight) const {
  if (!(weight > 0.0)) return 0;
  int low = 1, high = static_cast<int>(weights_.size()) - 1;
  while (low < high) {
    const int middle = (low + high) / 2;
    if (weights_[static_cast<size_t>(middle)] >= weight) {
      high = middle;
    } else {
      low = middle + 1;
    }
  }
  return low;
}

inline unsigned CodeBook::part_code(double value, double whole) const {
  const auto last = static_cast<unsigned>(parts_.size()) - 1;
  if (!(value > 0.0)) return last;
  unsigned code = 0;
  while (code + 1 < last && whole * parts_[code + 1] >= value) ++code;
  return code;
}

inline uint16_t CodeBook::encode(int weight_code, double low, double mid, double length) const {
  const auto weight = static_cast<unsigned>(weight_code);
  const double whole = weights_[weight] * length;
  const unsigned low_code = part_code(low, whole);
  unsigned code = weight | low_code << weight_bits_;
  if (weight_bits_ + 2 * part_bits_ <= 16) {
    code |= part_code(mid, whole * parts_[low_code]) << (weight_bits_ + part_bits_);
  }
  return static_cast<uint16_t>(code);
}

}  // namespace lodlab::seamless
