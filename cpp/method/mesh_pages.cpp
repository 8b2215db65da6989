// SPDX-License-Identifier: MIT
#include "method/mesh_pages.h"

#include <meshoptimizer.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "base/errors.h"
#include "base/parallel.h"
#include "geometry/two_floats.h"

namespace lodlab {
namespace {

enum Part : int { kHigh, kLow, kColors, kIndices };
constexpr int64_t kPage = 65536;                    ///< vertices, or triangles, of a page
constexpr int64_t kPagesOfMesh = int64_t{1} << 20;  ///< numbers of pages that one mesh may use

int64_t pages(int64_t count) { return (count + kPage - 1) / kPage; }

void for_pages(int64_t count, const std::function<void(int64_t page, int64_t first, int64_t size)>& visit) {
  parallel_for(pages(count), 1, [&](int64_t begin, int64_t end) {
    for (int64_t page = begin; page < end; ++page)
      visit(page, page * kPage, std::min(kPage, count - page * kPage));
  });
}

template <class T>
void put(StoreWriter& writer, int kind, int64_t id, const std::vector<T>& values) {
  for_pages(static_cast<int64_t>(values.size()), [&](int64_t page, int64_t first, int64_t size) {
    if (writer.has_page(kind, id * kPagesOfMesh + page)) return;
    Bytes bytes(meshopt_encodeVertexBufferBound(static_cast<size_t>(size), sizeof(T)));
    bytes.resize(meshopt_encodeVertexBuffer(reinterpret_cast<unsigned char*>(bytes.data()), bytes.size(),
                                            values.data() + first, static_cast<size_t>(size), sizeof(T)));
    writer.put_page(kind, id * kPagesOfMesh + page, bytes);
  });
}

[[noreturn]] void refuse(const Store& store, const char* what) {
  throw StoreError("store " + store.path() + ": a page of " + what + " is no such code");
}

template <class T>
std::vector<T> get(const Store& store, int kind, int64_t id, int64_t count, const char* what) {
  std::vector<T> out(static_cast<size_t>(count));
  for_pages(count, [&](int64_t page, int64_t first, int64_t size) {
    const Bytes bytes = store.page(kind, id * kPagesOfMesh + page);
    if (meshopt_decodeVertexBuffer(out.data() + first, static_cast<size_t>(size), sizeof(T),
                                   reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size()) != 0)
      refuse(store, what);
  });
  return out;
}

}  // namespace

CacheOrder cache_order(std::span<const uint32_t> indices, size_t vertices) {
  CacheOrder out;
  out.indices.resize(indices.size());
  meshopt_optimizeVertexCache(out.indices.data(), indices.data(), indices.size(), vertices);
  out.number.resize(vertices);
  out.used =
      meshopt_optimizeVertexFetchRemap(out.number.data(), out.indices.data(), indices.size(), vertices);
  meshopt_remapIndexBuffer(out.indices.data(), out.indices.data(), indices.size(), out.number.data());
  return out;
}

StoredMesh stored_mesh(const Mesh& mesh, std::span<const uint32_t> indices) {
  StoredMesh out;
  const size_t vertices = mesh.positions.size();
  CacheOrder order = cache_order(indices, vertices);
  out.indices = std::move(order.indices);
  out.high.resize(order.used);
  if (!mesh.in_floats) out.low.resize(order.used);
  if (!mesh.colors.empty()) out.colors.resize(order.used);
  for (size_t i = 0; i < vertices; ++i) {
    const uint32_t to = order.number[i];
    if (to == std::numeric_limits<uint32_t>::max()) continue;
    for (int k = 0; k < 3; ++k) {
      float low = 0.0f;
      split(mesh.positions[i][k], out.high[to][k], low);
      if (!out.low.empty()) out.low[to][k] = low;
    }
    if (!out.colors.empty()) out.colors[to] = mesh.colors[i];
  }
  return out;
}

double stored_step(const Box& box, bool in_floats) {
  if (in_floats) return 0.0;
  const glm::dvec3 far = glm::max(glm::abs(box.lo), glm::abs(box.hi));
  const double most = std::max({far.x, far.y, far.z});
  return std::max(most * 0x1p-49, static_cast<double>(std::numeric_limits<float>::denorm_min()));
}

void put_mesh(StoreWriter& writer, int kind, int64_t id, const StoredMesh& mesh) {
  put(writer, kind + kHigh, id, mesh.high);
  put(writer, kind + kLow, id, mesh.low);
  put(writer, kind + kColors, id, mesh.colors);
  for_pages(mesh.triangles(), [&](int64_t page, int64_t first, int64_t size) {
    const int64_t number = id * kPagesOfMesh + page;
    if (writer.has_page(kind + kIndices, number)) return;
    const size_t count = static_cast<size_t>(3 * size);
    Bytes bytes(meshopt_encodeIndexBufferBound(count, mesh.high.size()));
    bytes.resize(meshopt_encodeIndexBuffer(reinterpret_cast<unsigned char*>(bytes.data()), bytes.size(),
                                           mesh.indices.data() + 3 * first, count));
    writer.put_page(kind + kIndices, number, bytes);
  });
}

bool has_low(const Store& store, int kind, int64_t id) {
  return store.has_page(kind + kLow, id * kPagesOfMesh);
}

StoredMesh get_mesh(const Store& store, int kind, int64_t id, int64_t vertices, int64_t triangles) {
  StoredMesh out;
  out.high = get<glm::vec3>(store, kind + kHigh, id, vertices, "positions");
  if (has_low(store, kind, id)) out.low = get<glm::vec3>(store, kind + kLow, id, vertices, "positions");
  if (store.has_page(kind + kColors, id * kPagesOfMesh))
    out.colors = get<glm::u8vec4>(store, kind + kColors, id, vertices, "colours");
  out.indices.resize(static_cast<size_t>(3 * triangles));
  for_pages(triangles, [&](int64_t page, int64_t first, int64_t size) {
    const Bytes bytes = store.page(kind + kIndices, id * kPagesOfMesh + page);
    uint32_t* const at = out.indices.data() + 3 * first;
    const size_t count = static_cast<size_t>(3 * size);
    const bool read =
        meshopt_decodeIndexBuffer(at, count, sizeof(uint32_t),
                                  reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size()) == 0;
    if (!read || std::any_of(at, at + count, [&](uint32_t i) { return i >= vertices; }))
      refuse(store, "triangles");
  });
  return out;
}

}  // namespace lodlab
