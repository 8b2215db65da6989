// SPDX-License-Identifier: MIT
// Displacements in 32 bits (floats), 16 or 11 (steps above a lowest value). What an edge has is in steps of
// its own, which both faces read, as is what a face has inside; vertices stay floats. So what faces share
// decodes alike, and an edge's steps are no coarser than its own range asks for. A value decodes as low +
// step * q in floats, and is no farther from what it was than half a step and a float's rounding.
#pragma once

#include "methods/subdivision/pattern.h"

namespace lodlab::subdivision {

struct PackedHeights {
  struct Range {
    float low, step;
  };
  int bits = 32;
  std::vector<float> vertices;
  std::vector<Range> ranges;    ///< edges', then faces'; none at 32 bits
  std::vector<uint32_t> words;  ///< edges' values, then faces', from the lowest bit of each word on, unpadded

  int64_t bytes() const {
    return static_cast<int64_t>(sizeof(float) * vertices.size() + sizeof(Range) * ranges.size() +
                                sizeof(uint32_t) * words.size());
  }
};

/// InvalidInput for bits that are not 32, 16 or 11.
PackedHeights pack(const Samples& samples, std::span<const float> heights, int bits);

/// A value for each sample.
std::vector<float> unpack(const Samples& samples, const PackedHeights& packed);

/// The value at a place of a list of so many bits each.
uint32_t bits_at(std::span<const uint32_t> words, int64_t at, int bits);
void put_bits(std::span<uint32_t> words, int64_t at, int bits, uint32_t value);
/// What it decodes as.
float height_of(const PackedHeights::Range& range, int bits, uint32_t value);

}  // namespace lodlab::subdivision
