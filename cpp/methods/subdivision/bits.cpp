// SPDX-License-Identifier: MIT
#include "methods/subdivision/bits.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <string>

#include "base/errors.h"

namespace lodlab::subdivision {
namespace {

/// Calls do_block(first sample, samples) for each edge, then for each face's inside.
template <class DoBlock>
void for_blocks(const Samples& samples, const DoBlock& do_block) {
  const int64_t on_edge = samples.pattern().n() - 1, inside = samples.pattern().inside();
  for (int64_t s = samples.first_on_edges(); s < samples.first_inside(); s += on_edge) do_block(s, on_edge);
  if (inside == 0) return;
  for (int64_t s = samples.first_inside(); s < samples.count(); s += inside) do_block(s, inside);
}

}  // namespace

void put_bits(std::span<uint32_t> words, int64_t at, int bits, uint32_t value) {
  const auto word = static_cast<size_t>(at * bits / 32);
  const auto both = uint64_t{value} << (at * bits % 32);
  words[word] |= static_cast<uint32_t>(both);
  if (both >> 32 != 0) words[word + 1] |= static_cast<uint32_t>(both >> 32);
}

uint32_t bits_at(std::span<const uint32_t> words, int64_t at, int bits) {
  const auto word = static_cast<size_t>(at * bits / 32);
  const int shift = static_cast<int>(at * bits % 32);
  uint64_t both = words[word];
  if (shift + bits > 32) both |= uint64_t{words[word + 1]} << 32;
  return static_cast<uint32_t>(both >> shift) & static_cast<uint32_t>((uint64_t{1} << bits) - 1);
}

float height_of(const PackedHeights::Range& range, int bits, uint32_t value) {
  if (bits == 32) return std::bit_cast<float>(value);
  return range.low + range.step * static_cast<float>(value);
}

PackedHeights pack(const Samples& samples, std::span<const float> heights, int bits) {
  if (bits != 32 && bits != 16 && bits != 11)
    throw InvalidInput("subdivision: bits " + std::to_string(bits) + "; they must be 32, 16 or 11");
  PackedHeights out;
  out.bits = bits;
  const int64_t vertices = samples.first_on_edges();
  out.vertices.assign(heights.begin(), heights.begin() + vertices);
  out.words.assign(static_cast<size_t>(((samples.count() - vertices) * bits + 31) / 32), 0);
  const double most = std::ldexp(1.0, bits) - 1.0;
  for_blocks(samples, [&](int64_t first, int64_t count) {
    const std::span<const float> block =
        heights.subspan(static_cast<size_t>(first), static_cast<size_t>(count));
    const auto [low, high] = std::minmax_element(block.begin(), block.end());
    const auto step = static_cast<float>((double{*high} - double{*low}) / most);
    if (bits != 32) out.ranges.push_back({*low, step});
    for (int64_t k = 0; k < count; ++k) {
      const float value = block[static_cast<size_t>(k)];
      uint32_t q = std::bit_cast<uint32_t>(value);
      if (bits != 32) {
        const double steps = step > 0.0f ? (double{value} - double{*low}) / double{step} : 0.0;
        q = static_cast<uint32_t>(std::clamp(std::nearbyint(steps), 0.0, most));
      }
      put_bits(out.words, first - vertices + k, bits, q);
    }
  });
  return out;
}

std::vector<float> unpack(const Samples& samples, const PackedHeights& packed) {
  std::vector<float> out(static_cast<size_t>(samples.count()));
  std::copy(packed.vertices.begin(), packed.vertices.end(), out.begin());
  const int64_t vertices = samples.first_on_edges();
  size_t block = 0;
  for_blocks(samples, [&](int64_t first, int64_t count) {
    const PackedHeights::Range range = packed.bits == 32 ? PackedHeights::Range{} : packed.ranges[block++];
    for (int64_t s = first; s < first + count; ++s)
      out[static_cast<size_t>(s)] =
          height_of(range, packed.bits, bits_at(packed.words, s - vertices, packed.bits));
  });
  return out;
}

}  // namespace lodlab::subdivision
