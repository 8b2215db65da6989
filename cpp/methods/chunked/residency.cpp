// SPDX-License-Identifier: MIT
#include "methods/chunked/residency.h"

#include <algorithm>

#include "base/errors.h"
#include "methods/chunked/texture.h"

namespace lodlab::chunked {
namespace {

constexpr int64_t kAlign = 16;  // offsets serve as base vertex (8 bytes) and first index (2 or 4)

int64_t aligned(int64_t bytes) { return (bytes + kAlign - 1) / kAlign * kAlign; }

/// Of a texture with its mip levels, a third more.
int64_t texture_bytes(const Node& node) {
  return node.texture_side == 0 ? 0 : int64_t{node.texture_side + 1} * (node.texture_side + 1) * 16 / 3;
}

}  // namespace

Residency make_residency(const std::shared_ptr<const ChunkedHierarchy>& hierarchy,
                         const PagingOptions& caches) {
  const std::vector<Node>& nodes = hierarchy->node;
  Residency::Setup setup;
  int64_t geometry = 0, texture = 0, least = 0, widest = 0;
  for (size_t i = 0; i < nodes.size(); ++i) {
    const Node& node = nodes[i];
    const int64_t bytes =
        aligned(int64_t{node.vertices} * 8 + int64_t{node.indices} * hierarchy->index_bytes);
    setup.units.push_back({static_cast<int64_t>(i), bytes, texture_bytes(node)});
    geometry += bytes;
    texture += texture_bytes(node);
    if (i < hierarchy->roots) least += bytes + texture_bytes(node);
  }
  for (const Node& node : nodes) {
    int64_t family = 0;
    for (uint32_t c = node.first_child; c < node.first_child + node.children; ++c)
      family += setup.units[c].bytes + setup.units[c].beside;
    widest = std::max(widest, family);
  }
  const int64_t total = geometry + texture;
  const auto mib = [](int64_t bytes) { return std::to_string((bytes + (1 << 20) - 1) >> 20); };
  if (!caches.stream && total > caches.gpu_bytes) {
    throw InvalidInput("chunked: stream=false needs gpu_cache_mb of at least " + mib(total) + ", not " +
                       mib(caches.gpu_bytes));
  }
  if (caches.stream && least + widest > caches.gpu_bytes) {
    throw InvalidInput("chunked: the roots and one set of children need gpu_cache_mb of at least " +
                       mib(least + widest) + ", not " + mib(caches.gpu_bytes));
  }
  const double share =
      total > caches.gpu_bytes ? static_cast<double>(caches.gpu_bytes) / static_cast<double>(total) : 1.0;
  setup.capacity = static_cast<int64_t>(static_cast<double>(geometry) * share) / kAlign * kAlign;
  setup.beside_capacity = static_cast<int64_t>(static_cast<double>(texture) * share);
  setup.roots = hierarchy->roots;
  setup.kind = kGeometry;
  setup.beside_kind = kTexture;
  setup.stream = caches.stream;
  setup.cpu_bytes = caches.cpu_bytes;
  setup.fetch_delay = caches.fetch_delay;
  setup.decode = [hierarchy](int kind, int64_t id, Bytes stored) {
    if (kind == kTexture)
      return decode_texture(stored, hierarchy->node[static_cast<size_t>(id)].texture_side);
    return decode_page(stored, hierarchy->index_bytes);
  };
  return Residency(hierarchy->store, std::move(setup));
}

}  // namespace lodlab::chunked
