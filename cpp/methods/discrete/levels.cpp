// SPDX-License-Identifier: MIT
// The levels that are made here: by meshoptimizer, each from the one before it, with half its triangles.
#include <meshoptimizer.h>

#include <algorithm>
#include <limits>
#include <tuple>

#include "base/parallel.h"
#include "geometry/mesh_edges.h"
#include "geometry/mesh_repair.h"
#include "methods/discrete/discrete.h"

namespace lodlab::discrete {
namespace {

/// A simplification that leaves more than this share of the triangles has come to its end.
constexpr double kStuck = 0.9;

/// Terrain is simplified as if its relief were this share of its extent: distances to planes are then those
/// along the vertical, by which it is measured. Half of a real terrain's triangles so leave 17 m of error in
/// place of 45.
constexpr double kFlatRelief = 0.002;

/// Positions within a box of size 1; `field`: what they are samples of, or null.
std::vector<glm::vec3> in_floats(const Mesh& mesh, const HeightField* field) {
  std::vector<glm::vec3> out(mesh.positions.size());
  const glm::dvec3 centre = mesh.box.center();
  glm::dvec3 scale(1.0 / std::max(mesh.extent(), std::numeric_limits<double>::min()));
  if (field != nullptr) {
    const double relief = scale.z * (field->z_max - field->z_min);
    if (relief > kFlatRelief) scale.z *= kFlatRelief / relief;
  }
  for (size_t i = 0; i < out.size(); ++i) out[i] = scale * (mesh.positions[i] - centre);
  return out;
}

/// Triangles less those back to back: pairs of the same three vertices in opposite senses. Where a collapse
/// pinches a surface it leaves such fins, and at their root an edge of four triangles.
std::vector<uint32_t> without_fins(const std::vector<uint32_t>& indices, const std::vector<uint32_t>& at) {
  struct Sense {
    Face vertices;  ///< in order
    bool even;      ///< whether the order is the triangle's own, turned round
    size_t triangle;
  };
  std::vector<Sense> sorted(indices.size() / 3);
  for (size_t t = 0; t < sorted.size(); ++t) {
    const Face f{at[indices[3 * t]], at[indices[3 * t + 1]], at[indices[3 * t + 2]]};
    Face vertices = f;
    std::sort(vertices.begin(), vertices.end());
    const auto least = static_cast<size_t>(std::min_element(f.begin(), f.end()) - f.begin());
    sorted[t] = {vertices, f[(least + 1) % 3] == vertices[1], t};
  }
  std::sort(sorted.begin(), sorted.end(), [](const Sense& a, const Sense& b) {
    return std::tie(a.vertices, a.even, a.triangle) < std::tie(b.vertices, b.even, b.triangle);
  });
  std::vector<uint8_t> gone(sorted.size(), 0);
  for (size_t first = 0; first < sorted.size();) {
    size_t even = first;
    while (even < sorted.size() && sorted[even].vertices == sorted[first].vertices && !sorted[even].even)
      ++even;
    size_t end = even;
    while (end < sorted.size() && sorted[end].vertices == sorted[first].vertices) ++end;
    for (size_t k = 0; k < std::min(even - first, end - even); ++k)
      gone[sorted[first + k].triangle] = gone[sorted[even + k].triangle] = 1;
    first = end;
  }
  std::vector<uint32_t> out;
  for (size_t i = 0; i < indices.size(); ++i)
    if (gone[i / 3] == 0) out.push_back(indices[i]);
  return out;
}

/// The faces of a mesh that are listed, with the vertices that they use.
std::shared_ptr<const Mesh> part_of(const Mesh& mesh, std::span<const uint32_t> listed,
                                    std::vector<uint32_t>& renamed) {
  struct Held {
    std::vector<glm::dvec3> positions;
    std::vector<Face> faces;
    std::vector<glm::u8vec4> colors;
  };
  const auto held = std::make_shared<Held>();
  std::vector<uint32_t> used;
  for (const uint32_t face : listed) {
    Face out;
    for (size_t k = 0; k < 3; ++k) {
      const uint32_t vertex = mesh.faces[face][k];
      if (renamed[vertex] == ~0u) {
        renamed[vertex] = static_cast<uint32_t>(used.size());
        used.push_back(vertex);
        held->positions.push_back(mesh.positions[vertex]);
        if (!mesh.colors.empty()) held->colors.push_back(mesh.colors[vertex]);
      }
      out[k] = renamed[vertex];
    }
    held->faces.push_back(out);
  }
  for (const uint32_t vertex : used) renamed[vertex] = ~0u;
  return make_mesh({held->positions, held->faces, held->colors, {}, held}, "");
}

}  // namespace

std::vector<uint32_t> in_order(const Mesh& mesh) {
  const std::vector<glm::vec3> positions = in_floats(mesh, nullptr);
  std::vector<uint32_t> out(3 * mesh.faces.size());
  meshopt_spatialSortTriangles(out.data(), mesh.faces.data()->data(), out.size(), &positions.data()->x,
                               positions.size(), sizeof(glm::vec3));
  return out;
}

std::vector<std::vector<uint32_t>> halved(const Mesh& mesh, const HeightField* field) {
  const std::vector<glm::vec3> positions = in_floats(mesh, field);
  std::vector<std::vector<uint32_t>> levels{in_order(mesh)};
  const std::vector<uint32_t> at = first_at_position(mesh.positions);
  // Not of a source that has both sides itself.
  const bool pinches = field == nullptr && without_fins(levels[0], at).size() == levels[0].size();
  while (static_cast<int64_t>(levels.back().size() / 3) >= 2 * kFewTriangles) {
    const std::vector<uint32_t>& from = levels.back();
    const auto simplified = [&](unsigned options) {
      std::vector<uint32_t> to(from.size());
      to.resize(meshopt_simplify(to.data(), from.data(), from.size(), &positions.data()->x, positions.size(),
                                 sizeof(glm::vec3), from.size() / 6 * 3, std::numeric_limits<float>::max(),
                                 options, nullptr));
      if (field != nullptr) return unfolded(std::move(to), *field);
      return pinches ? without_fins(to, at) : to;
    };
    std::vector<uint32_t> to = simplified(0);
    if (to.empty() && field != nullptr) to = simplified(meshopt_SimplifyLockBorder);  // a corner had gone
    if (to.empty() || static_cast<double>(to.size()) > kStuck * static_cast<double>(from.size())) break;
    levels.push_back(std::move(to));
  }
  std::reverse(levels.begin(), levels.end());
  return levels;
}

std::vector<std::shared_ptr<const Mesh>> parts_of(std::shared_ptr<const Mesh> mesh) {
  const std::vector<uint32_t> at = first_at_position(mesh->positions);
  Sets sets(static_cast<int64_t>(at.size()));
  for (const Face& face : mesh->faces) {
    sets.join(at[face[0]], at[face[1]]);
    sets.join(at[face[0]], at[face[2]]);
  }
  std::vector<uint32_t> part(mesh->faces.size()), faces_of(at.size(), 0);
  for (size_t f = 0; f < part.size(); ++f) ++faces_of[part[f] = sets.find(at[mesh->faces[f][0]])];
  std::vector<uint32_t> order(at.size(), ~0u);  // of a component's list; those that are small share one
  std::vector<std::vector<uint32_t>> lists;
  uint32_t small = ~0u;
  for (size_t f = 0; f < part.size(); ++f) {
    const bool is_small = faces_of[part[f]] < 2 * kFewTriangles;
    uint32_t& list = is_small ? small : order[part[f]];
    if (list == ~0u) {
      list = static_cast<uint32_t>(lists.size());
      lists.emplace_back();
    }
    lists[list].push_back(static_cast<uint32_t>(f));
  }
  if (lists.size() == 1) return {std::move(mesh)};
  std::vector<uint32_t> renamed(mesh->positions.size(), ~0u);
  std::vector<std::shared_ptr<const Mesh>> out;
  for (const auto& list : lists) out.push_back(part_of(*mesh, list, renamed));
  return out;
}

std::shared_ptr<const Mesh> mesh_of(const HeightField& field) {
  struct Held {
    std::vector<glm::dvec3> positions;
    std::vector<Face> faces;
  };
  const auto held = std::make_shared<Held>();
  const int64_t cells = field.cols - 1;
  held->positions.resize(static_cast<size_t>(field.rows * field.cols));
  held->faces.resize(static_cast<size_t>(2 * (field.rows - 1) * cells));
  parallel_for(field.rows, 64, [&](int64_t begin, int64_t end) {
    for (int64_t row = begin; row < end; ++row) {
      for (int64_t col = 0; col < field.cols; ++col) {
        held->positions[static_cast<size_t>(row * field.cols + col)] =
            field.position(row, col, field.at(row, col));
      }
      if (row + 1 == field.rows) continue;
      for (int64_t col = 0; col < cells; ++col) {
        const auto nw = static_cast<uint32_t>(row * field.cols + col), ne = nw + 1,
                   sw = nw + static_cast<uint32_t>(field.cols), se = sw + 1;
        Face* const two = &held->faces[static_cast<size_t>(2 * (row * cells + col))];
        const bool down = (row + col) % 2 == 0;  // the diagonal runs from north-west to south-east
        two[0] = down ? Face{nw, sw, se} : Face{nw, sw, ne};
        two[1] = down ? Face{nw, se, ne} : Face{ne, sw, se};
      }
    }
  });
  return make_mesh({held->positions, held->faces, {}, {}, held}, "");
}

}  // namespace lodlab::discrete
