// SPDX-License-Identifier: MIT
// The page of a chunk: meshoptimizer's vertex and index codecs behind a head that tells the sizes.
#include <meshoptimizer.h>

#include <cstring>

#include "base/errors.h"
#include "methods/chunked/hierarchy.h"

namespace lodlab::chunked {
namespace {

struct StoredHead {
  PageHead page;
  uint32_t vertex_bytes, index_bytes;
};

template <class Index>
void decode_indices(const StoredHead& head, const unsigned char* data, std::byte* out, bool& ok) {
  ok = ok && meshopt_decodeIndexBuffer(reinterpret_cast<Index*>(out), head.page.indices, sizeof(Index), data,
                                       head.index_bytes) == 0;
}

}  // namespace

Bytes encode_page(const ChunkMesh& mesh) {
  // Vertices of the surface by first use; the bottoms of skirts come last, along the edge.
  std::vector<uint32_t> indices(mesh.indices);
  std::vector<uint32_t> remap(mesh.surface_vertices);
  meshopt_optimizeVertexFetchRemap(remap.data(), indices.data(), mesh.surface_indices, mesh.surface_vertices);
  std::vector<Vertex> vertices(mesh.vertices);
  for (uint32_t v = 0; v < mesh.surface_vertices; ++v) vertices[remap[v]] = mesh.vertices[v];
  for (auto& index : indices) {
    if (index < mesh.surface_vertices) index = remap[index];
  }
  StoredHead head{{static_cast<uint32_t>(vertices.size()), mesh.surface_vertices,
                   static_cast<uint32_t>(indices.size()), mesh.surface_indices},
                  0,
                  0};
  const size_t vertex_room = meshopt_encodeVertexBufferBound(vertices.size(), sizeof(Vertex));
  const size_t index_room = meshopt_encodeIndexBufferBound(indices.size(), vertices.size());
  Bytes out(sizeof head + vertex_room + index_room);
  auto* data = reinterpret_cast<unsigned char*>(out.data()) + sizeof head;
  head.vertex_bytes = static_cast<uint32_t>(
      meshopt_encodeVertexBuffer(data, vertex_room, vertices.data(), vertices.size(), sizeof(Vertex)));
  head.index_bytes = static_cast<uint32_t>(
      meshopt_encodeIndexBuffer(data + head.vertex_bytes, index_room, indices.data(), indices.size()));
  std::memcpy(out.data(), &head, sizeof head);
  out.resize(sizeof head + head.vertex_bytes + head.index_bytes);
  return out;
}

Bytes decode_page(const Bytes& stored, int index_bytes) {
  StoredHead head{};
  if (stored.size() >= sizeof head) std::memcpy(&head, stored.data(), sizeof head);
  bool ok = stored.size() >= sizeof head &&
            stored.size() == sizeof head + size_t{head.vertex_bytes} + head.index_bytes;
  if (!ok) throw StoreError("chunked: a page of " + std::to_string(stored.size()) + " bytes is not a chunk");
  const size_t vertex_size = size_t{head.page.vertices} * sizeof(Vertex);
  Bytes out(sizeof(PageHead) + vertex_size + size_t{head.page.indices} * static_cast<size_t>(index_bytes));
  std::memcpy(out.data(), &head.page, sizeof(PageHead));
  const auto* data = reinterpret_cast<const unsigned char*>(stored.data()) + sizeof head;
  std::byte* vertices = out.data() + sizeof(PageHead);
  ok = meshopt_decodeVertexBuffer(vertices, head.page.vertices, sizeof(Vertex), data, head.vertex_bytes) == 0;
  if (index_bytes == 2) {
    decode_indices<uint16_t>(head, data + head.vertex_bytes, vertices + vertex_size, ok);
  } else {
    decode_indices<uint32_t>(head, data + head.vertex_bytes, vertices + vertex_size, ok);
  }
  if (!ok) throw StoreError("chunked: a page does not decode");
  return out;
}

}  // namespace lodlab::chunked
