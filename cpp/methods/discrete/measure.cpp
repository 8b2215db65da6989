// SPDX-License-Identifier: MIT
// How far levels are from the source: measured, and rounded up by what the measuring leaves open.
#include <algorithm>
#include <atomic>
#include <cmath>

#include "base/parallel.h"
#include "geometry/mesh_distance.h"
#include "geometry/mesh_repair.h"
#include "geometry/mesh_walk.h"
#include "geometry/scan_triangle.h"
#include "methods/discrete/discrete.h"

namespace lodlab::discrete {
namespace {

constexpr int64_t kMostPieces = int64_t{1} << 28;

/// A coordinate of this many cells that is nearer to a sample than this is at it: what doubles leave of it.
constexpr double kCellStep = 0x1p-40;

/// Vertices at equal positions as one: `first` of each.
WeldedMesh relative_to(const glm::dvec3& centre, const Mesh& mesh, std::span<const uint32_t> first,
                       std::span<const uint32_t> indices) {
  WeldedMesh out;
  out.positions.resize(mesh.positions.size());
  for (size_t i = 0; i < out.positions.size(); ++i) out.positions[i] = mesh.positions[i] - centre;
  out.faces.resize(indices.size() / 3);
  for (size_t i = 0; i < indices.size(); ++i) out.faces[i / 3][i % 3] = first[indices[i]];
  return out;
}

}  // namespace

struct MeshMeasure::Target {
  WeldedMesh mesh;
  WeldedMesh border;  ///< as segments
  MeshSurface surface;
  std::vector<uint32_t> across;
  explicit Target(WeldedMesh of)
      : mesh(std::move(of)), border(unmatched_edges(mesh)), surface(mesh), across(across_sides(mesh)) {}
};

MeshMeasure::MeshMeasure(std::shared_ptr<const Mesh> part, std::span<const uint32_t> faces)
    : part_(std::move(part)),
      first_(first_at_position(part_->positions)),
      target_(std::make_unique<Target>(relative_to(part_->box.center(), *part_, first_, faces))) {}

MeshMeasure::~MeshMeasure() = default;

double MeshMeasure::bound(const Mesh& of, std::span<const uint32_t> first,
                          std::span<const uint32_t> indices) const {
  const Target level(relative_to(part_->box.center(), of, first, indices));
  Box box = part_->box;
  box.add(of.box);
  const double extent = glm::distance(box.lo, box.hi);
  double largest = walked_distance(target_->mesh, level.surface, level.across, extent, kMostPieces);
  largest = walked_distance(level.mesh, target_->surface, target_->across, extent, kMostPieces, largest);
  if (!level.border.faces.empty() && !target_->border.faces.empty()) {
    const MeshSurface border(target_->border);
    largest = largest_distance(level.border, closest_to_vertices(level.border, border), border, extent,
                               kMostPieces, largest);
  }
  return std::max(largest * (1.0 + kMaxTolerance), largest + kLeastShare * extent);
}

FieldBound field_bound(const HeightField& field, const Mesh& of, std::span<const uint32_t> indices) {
  std::vector<uint8_t> covered(static_cast<size_t>(field.rows * field.cols), 0);
  std::atomic<double> worst{0.0};
  const auto corner = [&](uint32_t vertex) {
    const glm::dvec3& p = of.positions[vertex];
    GridCorner out{(p.x - field.x0) / field.dx, (field.y0 - p.y) / field.dy, p.z, 0.0};
    const double far = 1.0 + (std::abs(field.x0) + std::abs(p.x)) / field.dx +
                       (std::abs(field.y0) + std::abs(p.y)) / field.dy;
    for (double* const at : {&out.col, &out.row}) {
      const double whole = std::nearbyint(*at);
      if (std::abs(*at - whole) <= kCellStep * far) {
        *at = whole;
      } else {
        out.slack = kCellStep * far;
      }
    }
    return out;
  };
  parallel_for(static_cast<int64_t>(indices.size() / 3), 256, [&](int64_t begin, int64_t end) {
    double most = 0.0;
    for (int64_t t = begin; t < end; ++t) {
      const uint32_t* const v = &indices[static_cast<size_t>(3 * t)];
      const GridCorner corners[3] = {corner(v[0]), corner(v[1]), corner(v[2])};
      scan_triangle(
          corners, field.rows, field.cols, [&](int64_t row, int64_t col, const double* z, int count) {
            for (int i = 0; i < count; ++i) {
              const int64_t sample = row * field.cols + col + i;
              std::atomic_ref(covered[static_cast<size_t>(sample)]).store(1, std::memory_order_relaxed);
              if (!field.is_valid(row, col + i)) continue;
              most = std::max(most, std::abs(z[i] - double{field.heights[sample]}));
            }
          });
    }
    double seen = worst.load();
    while (seen < most && !worst.compare_exchange_weak(seen, most)) {
    }
  });
  FieldBound out;
  out.error = worst;
  for (int64_t i = 0; i < field.rows * field.cols; ++i) {
    if (covered[static_cast<size_t>(i)] != 0 || !field.is_valid(i / field.cols, i % field.cols)) continue;
    if (out.uncovered++ == 0) out.first_uncovered = i;
  }
  return out;
}

}  // namespace lodlab::discrete
