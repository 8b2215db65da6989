// SPDX-License-Identifier: MIT
#include "methods/chunked/residency.h"

#include <algorithm>

#include "base/errors.h"
#include "method/pools.h"
#include "methods/chunked/texture.h"
#include "render/surface.h"

namespace lodlab::chunked {
namespace {

constexpr int64_t kAlign = 16;  // offsets serve as base vertex (8 bytes) and first index (2 or 4)

int64_t aligned(int64_t bytes) { return (bytes + kAlign - 1) / kAlign * kAlign; }

int64_t mesh_bytes(const ChunkedHierarchy& tree, const Node& node) {
  return int64_t{node.vertices} * 8 + int64_t{node.indices} * tree.index_bytes;
}

/// Of a texture with its mip levels, a third more.
int64_t texture_bytes(const Node& node) {
  return node.texture_side == 0 ? 0 : int64_t{node.texture_side + 1} * (node.texture_side + 1) * 16 / 3;
}

/// What the roots, and the largest set of children, take of one kind of memory.
struct Need {
  int64_t all = 0, roots = 0, family = 0;
};

template <class Bytes>
Need need_of(const ChunkedHierarchy& tree, const Bytes& bytes) {
  Need need;
  for (uint32_t i = 0; i < tree.node.size(); ++i) {
    need.all += bytes(i);
    if (i < tree.roots) need.roots += bytes(i);
    int64_t family = 0;
    for (uint32_t c = 0; c < tree.node[i].children; ++c) family += bytes(tree.node[i].first_child + c);
    need.family = std::max(need.family, family);
  }
  return need;
}

[[noreturn]] void refuse(const std::string& what, const char* option, int64_t least, int64_t given) {
  throw InvalidInput("chunked: " + what + " " + option + " of at least " +
                     std::to_string((least + (1 << 20) - 1) >> 20) + ", not " + std::to_string(given >> 20));
}

/// As decoded. While streaming a chunk goes to the GPU when its texture is in main memory with it.
void check_main_memory(const ChunkedHierarchy& tree, const PagingOptions& caches) {
  int64_t least = 0;
  for (const Node& node : tree.node) {
    const int64_t mesh = static_cast<int64_t>(sizeof(PageHead)) + mesh_bytes(tree, node);
    const int64_t side = node.texture_side == 0 ? 0 : node.texture_side + 1, texture = 4 * side * side;
    least = std::max(least, caches.stream ? mesh + texture : std::max(mesh, texture));
  }
  if (least > caches.cpu_bytes) refuse("the largest chunk needs", "cpu_cache_mb", least, caches.cpu_bytes);
}

}  // namespace

Plan make_plan(const std::shared_ptr<const ChunkedHierarchy>& hierarchy, const PagingOptions& caches) {
  constexpr int64_t kFewestPieces = 64;
  const ChunkedHierarchy& tree = *hierarchy;
  Residency::Setup setup;
  int64_t leaves = 0;  // no cut has more nodes
  for (size_t i = 0; i < tree.node.size(); ++i) {
    const Node& node = tree.node[i];
    setup.units.push_back({static_cast<int64_t>(i), aligned(mesh_bytes(tree, node)), texture_bytes(node)});
    leaves += node.children == 0;
  }
  const Need meshes = need_of(tree, [&](uint32_t id) { return setup.units[id].bytes; });
  const Need textures = need_of(tree, [&](uint32_t id) { return setup.units[id].beside; });
  const auto pool = [&](const Need& need, int64_t slot) {
    const int64_t least = caches.stream ? std::min(need.all, need.roots + need.family) : need.all;
    return Pool{slot, (need.all + slot - 1) / slot, (least + slot - 1) / slot};
  };
  std::vector<Pool> pools{pool(meshes, kAlign),
                          pool(textures, 1),
                          {kInstanceBytes + kCommandBytes, leaves, std::min(leaves, kFewestPieces)}};
  const int64_t field = render::Surface::bytes_of(tree.frame, !tree.coverage().empty());
  const int64_t least = field + least_of(pools);
  if (least > caches.gpu_bytes) {
    refuse(caches.stream ? "the roots and one set of children need" : "stream=false needs", "gpu_cache_mb",
           least, caches.gpu_bytes);
  }
  check_main_memory(tree, caches);
  part_room(caches.gpu_bytes - field, pools);
  setup.capacity = pools[0].capacity;
  setup.beside_capacity = pools[1].capacity;
  setup.roots = tree.roots;
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
  return {std::move(setup), pools[2].capacity / pools[2].slot};
}

}  // namespace lodlab::chunked
