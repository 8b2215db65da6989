// SPDX-License-Identifier: MIT
#include "methods/subdivision/pages.h"

#include <algorithm>
#include <cstring>
#include <unordered_map>

namespace lodlab::subdivision {
namespace {

struct Group {
  int64_t first, last;                              ///< faces
  std::vector<int64_t> edges;                       ///< in the order of first use
  std::unordered_map<int64_t, int64_t> edge_place;  ///< among them
  int64_t on_edge, inside;                          ///< samples of a block

  Group(const Samples& samples, int64_t group)
      : first(group * kGroupFaces),
        last(std::min(first + kGroupFaces, samples.control_faces())),
        on_edge(samples.pattern().n() - 1),
        inside(samples.pattern().inside()) {
    for (int64_t f = first; f < last; ++f) {
      for (int side = 0; side < 3; ++side) {
        const int64_t edge = samples.edge(f, side);
        if (edge_place.emplace(edge, static_cast<int64_t>(edges.size())).second) edges.push_back(edge);
      }
    }
  }
  int64_t edge_values() const { return static_cast<int64_t>(edges.size()) * on_edge; }
  int64_t values() const { return edge_values() + (last - first) * inside; }
  int64_t blocks() const { return static_cast<int64_t>(edges.size()) + (inside > 0 ? last - first : 0); }
  /// Calls do_block(block of the page, of the store, its first sample, samples).
  template <class DoBlock>
  void for_blocks(const Samples& samples, const DoBlock& do_block) const {
    const auto count = static_cast<int64_t>(edges.size());
    for (int64_t b = 0; b < blocks(); ++b) {
      if (b < count) {
        const int64_t edge = edges[static_cast<size_t>(b)];
        do_block(b, edge, samples.first_on_edges() + edge * on_edge, on_edge);
      } else {
        const int64_t face = first + b - count;
        do_block(b, samples.edges().count() + face, samples.first_inside() + face * inside, inside);
      }
    }
  }
};

struct Parts {
  size_t ranges, words;  ///< bytes
  Parts(const Group& group, int bits)
      : ranges(bits == 32 ? 0 : static_cast<size_t>(group.blocks()) * sizeof(PackedHeights::Range)),
        words(static_cast<size_t>((group.values() * bits + 31) / 32) * sizeof(uint32_t)) {}
};

template <class T>
std::vector<T> values_of(std::span<const std::byte> bytes) {
  std::vector<T> out(bytes.size() / sizeof(T));
  std::memcpy(out.data(), bytes.data(), bytes.size());
  return out;
}

/// Heights of a page's blocks, one after the other; none: it is no such page.
std::vector<float> page_heights(const Samples& samples, const Group& group, int bits,
                                std::span<const std::byte> page) {
  const Parts parts(group, bits);
  if (page.size() != parts.ranges + parts.words) return {};
  const auto ranges = values_of<PackedHeights::Range>(page.first(parts.ranges));
  const auto words = values_of<uint32_t>(page.subspan(parts.ranges));
  std::vector<float> out;
  out.reserve(static_cast<size_t>(group.values()));
  group.for_blocks(samples, [&](int64_t block, int64_t, int64_t, int64_t count) {
    const auto range = ranges.empty() ? PackedHeights::Range{} : ranges[static_cast<size_t>(block)];
    for (int64_t k = 0; k < count; ++k)
      out.push_back(height_of(range, bits, bits_at(words, static_cast<int64_t>(out.size()), bits)));
  });
  return out;
}

}  // namespace

Bytes group_page(const Samples& samples, const PackedHeights& packed, int64_t id) {
  const Group group(samples, id);
  const Parts parts(group, packed.bits);
  std::vector<PackedHeights::Range> ranges;
  std::vector<uint32_t> words(parts.words / sizeof(uint32_t), 0);
  int64_t at = 0;
  group.for_blocks(samples, [&](int64_t, int64_t of_store, int64_t first, int64_t count) {
    if (packed.bits != 32) ranges.push_back(packed.ranges[static_cast<size_t>(of_store)]);
    for (int64_t s = first - samples.first_on_edges(), end = s + count; s < end; ++s)
      put_bits(words, at++, packed.bits, bits_at(packed.words, s, packed.bits));
  });
  Bytes out(parts.ranges + parts.words);
  std::memcpy(out.data(), ranges.data(), parts.ranges);
  std::memcpy(out.data() + parts.ranges, words.data(), parts.words);
  return out;
}

bool read_page(const Samples& samples, int bits, int64_t id, std::span<const std::byte> page,
               std::vector<float>& heights) {
  const Group group(samples, id);
  const std::vector<float> values = page_heights(samples, group, bits, page);
  if (static_cast<int64_t>(values.size()) != group.values()) return false;
  auto from = values.begin();
  group.for_blocks(samples, [&](int64_t, int64_t, int64_t first, int64_t count) {
    std::copy(from, from + count, heights.begin() + first);
    from += count;
  });
  return true;
}

Bytes decode_page(const Samples& samples, int bits, int64_t id, std::span<const std::byte> page,
                  std::span<const float> heights) {
  const Group group(samples, id);
  const std::vector<float> values = page_heights(samples, group, bits, page);
  const auto points = static_cast<size_t>(samples.pattern().points());
  std::vector<int64_t> of(points);
  std::vector<float> out;
  out.reserve(static_cast<size_t>(group.last - group.first) * points);
  for (int64_t f = group.first; f < group.last; ++f) {
    samples.of_face(f, of);
    for (const int64_t s : of) {
      if (s < samples.first_on_edges()) {
        out.push_back(heights[static_cast<size_t>(s)]);
        continue;
      }
      int64_t at = group.edge_values() + s - samples.first_inside() - group.first * group.inside;
      if (s < samples.first_inside()) {
        const int64_t on_edges = s - samples.first_on_edges();
        at = group.edge_place.at(on_edges / group.on_edge) * group.on_edge + on_edges % group.on_edge;
      }
      out.push_back(values.at(static_cast<size_t>(at)));
    }
  }
  Bytes bytes(out.size() * sizeof(float));
  std::memcpy(bytes.data(), out.data(), bytes.size());
  return bytes;
}

}  // namespace lodlab::subdivision
