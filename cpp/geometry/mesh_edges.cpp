// SPDX-License-Identifier: MIT
#include "geometry/mesh_edges.h"

#include <algorithm>
#include <tuple>

#include "base/parallel.h"

namespace lodlab {
namespace {

constexpr int64_t kGrain = 1 << 14;

/// Items 0 to count - 1 in groups by a vertex each (`skip`: in none), each group sorted: the items, and where
/// groups begin.
struct Groups {
  std::vector<uint32_t> items, begin;
};
constexpr uint32_t kNone = ~uint32_t{0};

template <class VertexOf, class Less>
Groups group(int64_t count, int64_t vertices, const VertexOf& vertex, const Less& less) {
  Groups g;
  g.begin.assign(static_cast<size_t>(vertices) + 2, 0);
  for (int64_t i = 0; i < count; ++i) {
    const uint32_t v = vertex(static_cast<uint32_t>(i));
    if (v != kNone) ++g.begin[v + 2];
  }
  for (size_t v = 2; v < g.begin.size(); ++v) g.begin[v] += g.begin[v - 1];
  g.items.resize(g.begin.back());
  for (int64_t i = 0; i < count; ++i) {
    const uint32_t v = vertex(static_cast<uint32_t>(i));
    if (v != kNone) g.items[g.begin[v + 1]++] = static_cast<uint32_t>(i);
  }
  g.begin.pop_back();
  parallel_for(vertices, kGrain, [&](int64_t first, int64_t last) {
    for (int64_t v = first; v < last; ++v) {
      std::sort(g.items.begin() + g.begin[v], g.items.begin() + g.begin[v + 1], less);
    }
  });
  return g;
}

std::array<uint32_t, 3> sorted(Face f) {
  std::sort(f.begin(), f.end());
  return f;
}

}  // namespace

MeshEdges mesh_edges(std::span<const Face> faces, int64_t vertices) {
  const auto ends = [&](uint32_t side) {
    return std::minmax({vertex_of(faces, side), vertex_of(faces, side_end(side))});
  };
  Groups g = group(
      static_cast<int64_t>(faces.size()) * 3, vertices,
      [&](uint32_t side) { return collapsed(faces[side / 3]) ? kNone : ends(side).first; },
      [&](uint32_t a, uint32_t b) {
        return std::pair{ends(a).second, a} < std::pair{ends(b).second, b};
      });
  MeshEdges edges;
  for (size_t i = 0; i < g.items.size(); ++i) {
    if (i == 0 || ends(g.items[i]) != ends(g.items[i - 1])) edges.first.push_back(static_cast<uint32_t>(i));
  }
  edges.first.push_back(static_cast<uint32_t>(g.items.size()));
  edges.sides = std::move(g.items);
  return edges;
}

std::vector<uint32_t> first_alike(std::span<const Face> faces, int64_t vertices) {
  const Groups g = group(
      static_cast<int64_t>(faces.size()), vertices, [&](uint32_t t) { return sorted(faces[t])[0]; },
      [&](uint32_t a, uint32_t b) {
        return std::pair{sorted(faces[a]), a} < std::pair{sorted(faces[b]), b};
      });
  std::vector<uint32_t> first(faces.size());
  for (size_t i = 0; i < g.items.size(); ++i) {
    const bool alike = i > 0 && sorted(faces[g.items[i]]) == sorted(faces[g.items[i - 1]]);
    first[g.items[i]] = alike ? first[g.items[i - 1]] : g.items[i];
  }
  return first;
}

Sets fans(std::span<const Face> faces, const MeshEdges& edges, size_t most_sides) {
  Sets corners(static_cast<int64_t>(faces.size()) * 3);
  for (int64_t edge = 0; edge < edges.count(); ++edge) {
    const auto sides = edges.of(edge);
    if (sides.size() < 2 || sides.size() > most_sides) continue;
    const uint32_t a = sides[0], b = side_end(a);
    for (const uint32_t side : sides.subspan(1)) {
      const bool along = vertex_of(faces, side) == vertex_of(faces, a);
      corners.join(a, along ? side : side_end(side));
      corners.join(b, along ? side_end(side) : side);
    }
  }
  return corners;
}

}  // namespace lodlab
