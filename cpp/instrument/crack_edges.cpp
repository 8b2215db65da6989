// SPDX-License-Identifier: MIT
// Every edge becomes a 64-bit key: 62 bits of a hash that both directions share, and the direction. Keys are
// scattered into partitions by their leading bits and counted there, in tables that fit the processor's
// cache. Whatever is not there once in each direction (the source's boundary, cracks, by chance two edges
// with one hash) is looked at again with its real vertices, so that no count rests on the hash.
#include "instrument/crack_edges.h"

#include <algorithm>
#include <array>
#include <bit>
#include <compare>
#include <vector>

#include "base/parallel.h"
#include "instrument/captured.h"

namespace lodlab::instrument {
namespace {

using Vertex = std::array<uint32_t, 3>;  ///< bits of x, y, z; -0 is 0

constexpr uint64_t kNoEdge = 0;  // keys of dropped triangles
constexpr uint64_t kDirection = 1, kIsEdge = 2;
constexpr int64_t kKeysPerPartition = 8192;
constexpr int kMostPartitionBits = 13;

Vertex bits_of(const render::CapturedVertex& v) {
  return {std::bit_cast<uint32_t>(v.x + 0.0f), std::bit_cast<uint32_t>(v.y + 0.0f),
          std::bit_cast<uint32_t>(v.z + 0.0f)};
}

uint64_t mix(uint64_t x) {  // finalizer with full avalanche (two rounds of multiply and shift)
  x = (x ^ (x >> 32)) * 0xd6e8feb86659fd93u;
  x = (x ^ (x >> 32)) * 0xd6e8feb86659fd93u;
  return x ^ (x >> 32);
}

uint64_t hash_of(const Vertex& v) {
  return mix((static_cast<uint64_t>(v[0]) << 32 | v[1]) + mix(v[2] + 0x9e3779b97f4a7c15u));
}

/// The keys of a triangle's edges, or three times kNoEdge.
void edge_keys(const render::CapturedVertex* v, uint64_t* keys) {
  keys[0] = keys[1] = keys[2] = kNoEdge;
  if (is_filler(v)) return;
  const Vertex corner[3] = {bits_of(v[0]), bits_of(v[1]), bits_of(v[2])};
  if (corner[0] == corner[1] || corner[1] == corner[2] || corner[2] == corner[0]) return;
  const uint64_t hash[3] = {hash_of(corner[0]), hash_of(corner[1]), hash_of(corner[2])};
  for (int i = 0; i < 3; ++i) {
    const uint64_t a = hash[i], b = hash[(i + 1) % 3];
    const uint64_t both = mix(std::min(a, b) * 0x9e3779b97f4a7c15u + std::max(a, b));
    keys[i] = (both & ~(kDirection | kIsEdge)) | kIsEdge | (a < b ? kDirection : 0);
  }
}

std::vector<uint64_t> all_keys(const render::Captured& captured) {
  std::vector<uint64_t> keys(captured.vertices.size());
  parallel_for(captured.triangles(), 16384, [&](int64_t begin, int64_t end) {
    for (int64_t t = begin; t < end; ++t) edge_keys(&captured.vertices[3 * t], &keys[3 * t]);
  });
  return keys;
}

/// The keys, dropped ones left out, ordered by their leading bits; `starts` says where partitions begin.
struct Partitions {
  std::vector<uint64_t> keys;
  std::vector<int64_t> starts;
};

Partitions partition(const std::vector<uint64_t>& keys) {
  const int64_t count = static_cast<int64_t>(keys.size());
  int bits = 0;
  while (bits < kMostPartitionBits && (kKeysPerPartition << bits) < count) ++bits;
  const size_t parts = size_t{1} << bits;
  const auto part_of = [bits](uint64_t key) {
    return bits == 0 ? size_t{0} : static_cast<size_t>(key >> (64 - bits));
  };
  const int64_t block = std::max<int64_t>(int64_t{1} << 16, (count + 63) / 64);
  const int64_t blocks = (count + block - 1) / block;
  std::vector<std::vector<int64_t>> at(static_cast<size_t>(blocks), std::vector<int64_t>(parts, 0));
  parallel_for(blocks, 1, [&](int64_t begin, int64_t end) {
    for (int64_t b = begin; b < end; ++b) {
      for (int64_t i = b * block; i < std::min(count, (b + 1) * block); ++i) {
        if (keys[i] != kNoEdge) ++at[b][part_of(keys[i])];
      }
    }
  });
  Partitions out;
  int64_t total = 0;
  for (size_t part = 0; part < parts; ++part) {
    out.starts.push_back(total);
    for (std::vector<int64_t>& row : at) {
      const int64_t here = row[part];
      row[part] = total;
      total += here;
    }
  }
  out.starts.push_back(total);
  out.keys.resize(static_cast<size_t>(total));
  parallel_for(blocks, 1, [&](int64_t begin, int64_t end) {
    for (int64_t b = begin; b < end; ++b) {
      for (int64_t i = b * block; i < std::min(count, (b + 1) * block); ++i) {
        if (keys[i] != kNoEdge) out.keys[at[b][part_of(keys[i])]++] = keys[i];
      }
    }
  });
  return out;
}

/// Counts of one partition's edges by direction, in a table with open addressing.
class EdgeTable {
 public:
  void start(int64_t keys) {
    mask_ = std::bit_ceil(static_cast<uint64_t>(2 * keys + 1)) - 1;
    slots_.assign(mask_ + 1, Slot{});
  }
  void add(uint64_t key) {
    const uint64_t edge = key | kDirection;
    uint64_t i = (key >> 2) & mask_;
    while (slots_[i].edge != kNoEdge && slots_[i].edge != edge) i = (i + 1) & mask_;
    slots_[i].edge = edge;
    ++((key & kDirection) != 0 ? slots_[i].forward : slots_[i].backward);
  }
  /// Sorted: the edges that are not there exactly once in each direction.
  std::vector<uint64_t> unmatched() const {
    std::vector<uint64_t> out;
    for (const Slot& slot : slots_) {
      if (slot.edge != kNoEdge && (slot.forward != 1 || slot.backward != 1)) out.push_back(slot.edge);
    }
    std::sort(out.begin(), out.end());
    return out;
  }

 private:
  struct Slot {
    uint64_t edge = kNoEdge;
    uint32_t forward = 0, backward = 0;
  };
  uint64_t mask_ = 0;
  std::vector<Slot> slots_;
};

/// Sorted: the keys, without direction, that are not one edge and its one opposite.
std::vector<uint64_t> unmatched(const Partitions& parts) {
  const int64_t count = static_cast<int64_t>(parts.starts.size()) - 1;
  std::vector<std::vector<uint64_t>> found(static_cast<size_t>(count));
  parallel_for(count, 8, [&](int64_t begin, int64_t end) {
    EdgeTable table;
    for (int64_t part = begin; part < end; ++part) {
      const int64_t first = parts.starts[part], last = parts.starts[part + 1];
      table.start(last - first);
      for (int64_t i = first; i < last; ++i) table.add(parts.keys[i]);
      found[part] = table.unmatched();
    }
  });
  std::vector<uint64_t> out;
  for (const auto& part : found) out.insert(out.end(), part.begin(), part.end());
  return out;
}

struct Edge {
  Vertex low, high;
  bool forward;  ///< from low to high
  uint32_t node;
  auto operator<=>(const Edge&) const = default;
};

/// The edges behind the unmatched keys, in order.
std::vector<Edge> edges_of(const render::Captured& captured, const std::vector<uint64_t>& keys,
                           const std::vector<uint64_t>& wanted) {
  constexpr int kFilterBits = 18;  // most keys are turned away by one look at a small table
  std::vector<bool> filter(size_t{1} << kFilterBits, false);
  for (const uint64_t key : wanted) filter[key >> (64 - kFilterBits)] = true;
  std::vector<Edge> out;
  for (size_t i = 0; i < keys.size(); ++i) {
    if (keys[i] == kNoEdge || !filter[keys[i] >> (64 - kFilterBits)]) continue;
    if (!std::binary_search(wanted.begin(), wanted.end(), keys[i] | kDirection)) continue;
    const size_t next = i % 3 == 2 ? i - 2 : i + 1;
    const Vertex a = bits_of(captured.vertices[i]), b = bits_of(captured.vertices[next]);
    const uint32_t node = captured.vertices[i].node;
    out.push_back(a < b ? Edge{a, b, true, node} : Edge{b, a, false, node});
  }
  std::sort(out.begin(), out.end());
  return out;
}

glm::dvec3 relative(const Vertex& v) {
  return {std::bit_cast<float>(v[0]), std::bit_cast<float>(v[1]), std::bit_cast<float>(v[2])};
}

}  // namespace

int64_t crack_edges(const render::Captured& captured,
                    const std::function<bool(const UnmatchedEdge&)>& excused) {
  const std::vector<uint64_t> keys = all_keys(captured);
  const std::vector<uint64_t> wanted = unmatched(partition(keys));
  const std::vector<Edge> edges = edges_of(captured, keys, wanted);
  int64_t cracks = 0;
  for (size_t i = 0; i < edges.size();) {
    int64_t forward = 0, backward = 0;
    size_t next = i;
    for (; next < edges.size() && edges[next].low == edges[i].low && edges[next].high == edges[i].high;
         ++next) {
      ++(edges[next].forward ? forward : backward);
    }
    const int64_t wrong = (backward != 1 ? forward : 0) + (forward != 1 ? backward : 0);
    if (wrong > 0) {
      const UnmatchedEdge edge{relative(edges[i].low), relative(edges[i].high), edges[i].node,
                               forward == backward};
      if (!excused(edge)) cracks += wrong;
    }
    i = next;
  }
  return cracks;
}

}  // namespace lodlab::instrument
