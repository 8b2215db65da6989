// SPDX-License-Identifier: MIT
// What is kept of an edge: two bytes. They hold the logarithms, rounded up, of
//   weight  what the metric `roughness` multiplies its precision with: error a length, raised until claim 1
//           holds (closure.h);
//   low     the bound of what is drawn beside the edge at its coarsest resolution, as a weight x length;
//   mid     with three resolutions, that of the one between.
// With two resolutions each has a byte; with three, 6, 5 and 5 bits, `low` and `mid` as steps below what
// comes before them. The bound at an edge's finest resolution is that of its patch's children at their
// coarsest. A whole number of codes is an octave, and all three are on one scale, so that half a weight is a
// weight and a bound of one level is one of the next, exactly. The scale has 21 octaves below the largest
// weight, and nothing.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

namespace lodlab::seamless {

class CodeBook {
 public:
  /// `largest`: the weight of the largest code.
  CodeBook(int resolutions, double largest)
      : bytes_(resolutions == 2),
        steps_(resolutions == 2 ? 12 : 3),
        weight_bits_(resolutions == 2 ? 8 : 6),
        weights_(size_t{1} << weight_bits_) {
    const int top = (1 << weight_bits_) - 1;
    for (int i = 1; i <= top; ++i) weights_[static_cast<size_t>(i)] = largest * power(i - top);
  }

  /// Codes an octave.
  int steps() const { return steps_; }
  double largest() const { return weights_.back(); }
  double weight(uint16_t code) const { return weights_[weight_code(code)]; }
  /// The same, for loops: weight(code) is table[code & mask].
  const double* table() const { return weights_.data(); }
  unsigned mask() const { return (1u << weight_bits_) - 1u; }
  /// Source units, as `length` is: that of the edge.
  double low(uint16_t code, double length) const { return weights_[low_code(code)] * length; }
  double mid(uint16_t code, double length) const { return weights_[mid_code(code)] * length; }

  unsigned weight_code(uint16_t code) const { return code & mask(); }
  /// Weights whose product with the edge's length is the bound.
  unsigned low_code(uint16_t code) const {
    return bytes_ ? code >> 8u : below(weight_code(code), code >> weight_bits_);
  }
  unsigned mid_code(uint16_t code) const { return below(low_code(code), code >> (weight_bits_ + kPartBits)); }
  /// The smallest code whose weight is at least this, which is no larger than the largest.
  int weight_code_of(double weight) const;
  /// Of weight >= low >= mid, as codes of weights; bounds that are too far below are raised.
  uint16_t encode(int weight, int low, int mid) const;

 private:
  double power(int i) const {
    return std::ldexp(std::exp2((i - floor_div(i) * steps_) / double(steps_)), floor_div(i));
  }
  int floor_div(int i) const { return i >= 0 ? i / steps_ : -((-i + steps_ - 1) / steps_); }
  /// The last part is nothing.
  static constexpr unsigned kLastPart = 31;
  static constexpr int kPartBits = 5;
  static unsigned below(unsigned code, int part) {
    const unsigned steps = static_cast<unsigned>(part) & kLastPart;
    return steps == kLastPart ? 0u : code - std::min(code, steps);
  }

  bool bytes_;  ///< `low` has a byte of its own, the upper one
  int steps_, weight_bits_;
  std::vector<double> weights_;  // the first is 0
};

inline int CodeBook::weight_code_of(double weight) const {
  if (!(weight > 0.0)) return 0;
  return static_cast<int>(
      std::min(std::lower_bound(weights_.begin() + 1, weights_.end(), weight), weights_.end() - 1) -
      weights_.begin());
}

inline uint16_t CodeBook::encode(int weight, int low, int mid) const {
  if (bytes_) return static_cast<uint16_t>(weight | low << 8);
  constexpr int kLast = static_cast<int>(kLastPart);
  const int low_part = low == 0 ? kLast : std::min(weight - low, kLast - 1);
  const int mid_part = mid == 0 ? kLast : std::min(weight - low_part - mid, kLast - 1);
  return static_cast<uint16_t>(weight | low_part << weight_bits_ | mid_part << (weight_bits_ + kPartBits));
}

}  // namespace lodlab::seamless
