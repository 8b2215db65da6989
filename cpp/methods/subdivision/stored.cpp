// SPDX-License-Identifier: MIT
// The store: the control mesh by meshoptimizer's codecs, codes of bounds, pages of heights.
#include <meshoptimizer.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "base/errors.h"
#include "methods/subdivision/pages.h"
#include "methods/subdivision/subdivision.h"

namespace lodlab::subdivision {
namespace {

constexpr size_t kPageBytes = size_t{1} << 16;

struct Vertex {
  vec3 position, normal;
  float height;
};
static_assert(sizeof(Vertex) == 28);

/// Bytes in pages of at most kPageBytes.
void put_bytes(StoreWriter& writer, int kind, std::span<const std::byte> bytes) {
  for (size_t first = 0, page = 0; first < bytes.size(); first += kPageBytes, ++page) {
    const auto id = static_cast<int64_t>(page);
    if (writer.has_page(kind, id)) continue;
    writer.put_page(kind, id, bytes.subspan(first, std::min(kPageBytes, bytes.size() - first)));
  }
}

[[noreturn]] void refuse(const Store& store, const char* what) {
  throw StoreError("subdivision: " + store.path() + ": its " + what + " are none");
}

template <class T>
std::vector<T> get_bytes(const Store& store, int kind, size_t count, const char* what) {
  std::vector<T> out(count);
  const std::span<std::byte> all = std::as_writable_bytes(std::span(out));
  for (size_t first = 0, page = 0; first < all.size(); first += kPageBytes, ++page) {
    const Bytes bytes = store.page(kind, static_cast<int64_t>(page));
    if (bytes.size() != std::min(kPageBytes, all.size() - first)) refuse(store, what);
    std::copy(bytes.begin(), bytes.end(), all.begin() + static_cast<ptrdiff_t>(first));
  }
  return out;
}

template <class T>
Bytes coded_vertices(const std::vector<T>& values) {
  Bytes bytes(meshopt_encodeVertexBufferBound(values.size(), sizeof(T)));
  bytes.resize(meshopt_encodeVertexBuffer(reinterpret_cast<unsigned char*>(bytes.data()), bytes.size(),
                                          values.data(), values.size(), sizeof(T)));
  return bytes;
}

template <class T>
std::vector<T> get_vertices(const Store& store, int kind, size_t count, const char* what) {
  std::vector<T> out(count);
  const Bytes bytes = store.page(kind, 0);
  if (meshopt_decodeVertexBuffer(out.data(), count, sizeof(T),
                                 reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size()) != 0)
    refuse(store, what);
  return out;
}

Bytes coded_faces(const std::vector<Face>& faces, size_t vertices) {
  std::vector<uint32_t> indices;
  indices.reserve(3 * faces.size());
  for (const Face& f : faces) indices.insert(indices.end(), f.begin(), f.end());
  Bytes bytes(meshopt_encodeIndexBufferBound(indices.size(), vertices));
  bytes.resize(meshopt_encodeIndexBuffer(reinterpret_cast<unsigned char*>(bytes.data()), bytes.size(),
                                         indices.data(), indices.size()));
  return bytes;
}

/// False: they are no code of faces over so many vertices.
bool decode_faces(const Bytes& bytes, std::vector<Face>& faces, size_t vertices) {
  std::vector<uint32_t> indices(3 * faces.size());
  if (meshopt_decodeIndexBuffer(indices.data(), indices.size(), sizeof(uint32_t),
                                reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size()) != 0)
    return false;
  for (size_t i = 0; i < indices.size(); ++i) {
    if (indices[i] >= vertices) return false;
    faces[i / 3][i % 3] = indices[i];
  }
  return true;
}

}  // namespace

uint32_t low_code_for(double largest) {
  const int exponent = std::max(std::ilogb(std::max(largest, 1e-30)) - 31, -100);
  return std::bit_cast<uint32_t>(std::ldexp(1.0f, exponent));
}

uint8_t code_above(uint32_t low_code, double bound) {
  uint32_t code = 0;
  while (code < 255 && double{bound_of_code(low_code, code)} < bound) ++code;
  return static_cast<uint8_t>(code);
}

double Stored::bound(int64_t face, int level) const {
  const size_t at = static_cast<size_t>(face) * codes_a_face() + static_cast<size_t>(level);
  return double{bound_of_code(shape.low_code, codes[at])};
}

std::vector<Face> as_coded(const std::vector<Face>& faces, int64_t vertices) {
  std::vector<Face> out(faces.size());
  if (!decode_faces(coded_faces(faces, static_cast<size_t>(vertices)), out, static_cast<size_t>(vertices)))
    throw StoreError("subdivision: meshoptimizer's code of a control mesh does not decode");
  return out;
}

void put(StoreWriter& writer, const Stored& stored, const PackedHeights& packed) {
  std::vector<Vertex> vertices;
  for (size_t v = 0; v < stored.control.positions.size(); ++v)
    vertices.push_back(
        {vec3(stored.control.positions[v]), vec3(stored.control.normals[v]), stored.heights[v]});
  if (!writer.has_page(kVertices, 0)) writer.put_page(kVertices, 0, coded_vertices(vertices));
  if (!writer.has_page(kTriangles, 0))
    writer.put_page(kTriangles, 0, coded_faces(stored.control.faces, vertices.size()));
  put_bytes(writer, kCodes, as_bytes(stored.codes));
  const Samples samples(stored.control, Pattern::of_degree(stored.shape.degree));
  for (int64_t group = 0; group < groups_of(samples.control_faces()); ++group) {
    if (!writer.has_page(kHeights, group))
      writer.put_page(kHeights, group, group_page(samples, packed, group));
  }
  writer.put_array("shape", as_bytes(std::vector{stored.shape}));
}

Stored get(const Store& store) {
  Stored out;
  const auto shapes = store.array_of<Stored::Shape>("shape");
  if (shapes.size() != 1 || shapes[0].vertices < 3 || shapes[0].faces < 1) refuse(store, "numbers");
  out.shape = shapes[0];
  const auto count = static_cast<size_t>(out.shape.vertices);
  const auto vertices = get_vertices<Vertex>(store, kVertices, count, "vertices");
  for (const Vertex& v : vertices) {
    out.control.positions.emplace_back(v.position);
    out.control.normals.emplace_back(v.normal);
    out.heights.push_back(v.height);
  }
  out.control.faces.resize(static_cast<size_t>(out.shape.faces));
  if (!decode_faces(store.page(kTriangles, 0), out.control.faces, count)) refuse(store, "triangles");
  const Samples samples(out.control, Pattern::of_degree(out.shape.degree));
  out.codes = get_bytes<uint8_t>(store, kCodes, out.codes_a_face() * out.control.faces.size(), "bounds");
  out.heights.resize(static_cast<size_t>(samples.count()));
  for (int64_t group = 0; group < groups_of(samples.control_faces()); ++group) {
    if (!read_page(samples, out.shape.bits, group, store.page(kHeights, group), out.heights))
      refuse(store, "heights");
  }
  return out;
}

}  // namespace lodlab::subdivision
