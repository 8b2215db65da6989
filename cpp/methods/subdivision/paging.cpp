// SPDX-License-Identifier: MIT
#include "methods/subdivision/paging.h"

#include <algorithm>
#include <cmath>

#include "base/errors.h"
#include "base/parallel.h"

namespace lodlab::subdivision {
namespace {

/// What floats of lines' decisions round, and more.
constexpr double kSlack = 1.001;

constexpr double kMostWorth = 1e30;

size_t group_of(uint32_t face) { return face / static_cast<size_t>(kGroupFaces); }

double largest_bound(uint32_t low_code, const LineRecord& record) {
  uint32_t code = 0;
  for (int level = 0; level < LODLAB_LEVELS; ++level) code = std::max(code, code_of(record, level));
  return double{bound_of_code(low_code, code)} * double{record.scale};
}

/// Of the faces of a group: where they lie, flat and displaced; and the largest of what their lines know.
struct Extent {
  Box box;
  double error = 0.0, longest = 0.0;
  double bound = 0.0, ball = 0.0, slope = 0.0;

  void add(uint32_t low_code, const LineRecord& line) {
    bound = std::max(bound, largest_bound(low_code, line));
    ball = std::max(ball, double{line.spread} + double{line.swell});
    slope = std::max(slope, double{line.slope});
  }
  void add(const Lying& lying, uint32_t low_code, const FaceRecord& face) {
    error = std::max(error, double{face.error});
    add(low_code, face.inner);
    for (size_t k = 0; k < 3; ++k) {
      add(low_code, lying.records.edge[face.edge[k]]);
      const glm::dvec3 at = lying.positions[face.corner[k]], normal = lying.normals[face.corner[k]];
      longest = std::max(longest, glm::distance(at, glm::dvec3(lying.positions[face.corner[(k + 1) % 3]])));
      box.add(at);
      for (const float height : {face.low, face.high}) box.add(at + double{height} * normal);
    }
  }
  /// No line whose middle is farther from the eye wants a split (limit_of).
  double reach(const Uniforms& uniforms, const Step& step) const {
    if (uniforms.metric == LODLAB_METRIC_LENGTH) return kSlack * std::sqrt(double{step.gain}) * longest;
    if (uniforms.metric == LODLAB_METRIC_CURVATURE)
      return kSlack * std::sqrt(double{step.gain}) * slope * longest;
    return bound > double{step.never} ? kSlack * (double{step.kappa} * bound + ball) : 0.0;
  }
};

}  // namespace

Records held_back(Records records, int levels, const std::vector<uint8_t>& there) {
  for (uint32_t f = 0; f < records.face.size(); ++f) {
    if (there[group_of(f)] != 0) continue;
    records.face[f].inner.drawn = 0;
    for (const uint32_t e : records.face[f].edge) records.edge[e].drawn = 0;
  }
  const auto swaps = static_cast<uint32_t>(levels - 2);
  for (FaceRecord& face : records.face) {
    for (const uint32_t e : face.edge) {
      if (records.edge[e].drawn == 0) face.inner.drawn = std::min(face.inner.drawn, swaps);
    }
  }
  return records;
}

Groups::Groups(const SubdivisionHierarchy& hierarchy)
    : hierarchy_(hierarchy), beside_(static_cast<size_t>(groups_of(hierarchy.stored().shape.faces))) {
  for (int64_t e = 0; e < hierarchy.samples().edges().count(); ++e) {
    const auto sides = hierarchy.sides(e);
    for (const uint32_t a : sides) {
      for (const uint32_t b : sides) {
        const size_t from = group_of(a / 3), to = group_of(b / 3);
        if (from != to) beside_[from].push_back(static_cast<uint32_t>(to));
      }
    }
  }
  for (std::vector<uint32_t>& all : beside_) {
    std::sort(all.begin(), all.end());
    all.erase(std::unique(all.begin(), all.end()), all.end());
  }
}

std::vector<Residency::Want> Groups::wanted(const Lying& lying, const Uniforms& uniforms,
                                            const Camera& camera, const Step& step) const {
  const glm::dvec3 eye = camera.eye - hierarchy_.centre();
  const std::vector<FaceRecord>& faces = lying.records.face;
  std::vector<double> worth(beside_.size());
  std::vector<uint8_t> seen(beside_.size());
  parallel_for(static_cast<int64_t>(beside_.size()), 16, [&](int64_t begin, int64_t end) {
    for (auto g = static_cast<size_t>(begin); g < static_cast<size_t>(end); ++g) {
      const size_t first = g * kGroupFaces;
      Extent extent;
      for (size_t f = first; f < std::min(first + kGroupFaces, faces.size()); ++f)
        extent.add(lying, uniforms.low_code, faces[f]);
      worth[g] =
          std::min(extent.reach(uniforms, step) / std::max(distance(extent.box, eye), 1e-300), kMostWorth);
      // As face_seen widens them.
      const double margin = extent.error + 1e-4 * reach(extent.box, eye);
      const glm::dvec3 wider(margin), centre = hierarchy_.centre();
      seen[g] = camera.sees({extent.box.lo - wider + centre, extent.box.hi + wider + centre}) ? 1 : 0;
    }
  });
  std::vector<Residency::Want> out;
  for (size_t g = 0; g < beside_.size(); ++g) {
    if (!(worth[g] > 1.0)) continue;
    const bool near = seen[g] != 0 || std::any_of(beside_[g].begin(), beside_[g].end(),
                                                  [&](uint32_t other) { return seen[other] != 0; });
    if (near) out.push_back({static_cast<uint32_t>(g), worth[g]});
  }
  std::stable_sort(out.begin(), out.end(),
                   [](const auto& a, const auto& b) { return a.priority > b.priority; });
  return out;
}

Plan make_plan(std::shared_ptr<const SubdivisionHierarchy> hierarchy, const PagingOptions& caches,
               const Room& room) {
  const int64_t groups = groups_of(hierarchy->stored().shape.faces);
  const int64_t least = room.fixed + room.slot * (caches.stream ? 1 : groups);
  if (least > caches.gpu_bytes) {
    throw InvalidInput(
        std::string("subdivision: ") +
        (caches.stream ? "the control mesh and one page of displacement need" : "stream=false needs") +
        " gpu_cache_mb of at least " + std::to_string((least + (1 << 20) - 1) >> 20) + ", not " +
        std::to_string(caches.gpu_bytes >> 20));
  }
  Plan plan;
  plan.slots = std::min(groups, (caches.gpu_bytes - room.fixed) / room.slot);
  const int64_t bytes = kGroupFaces * hierarchy->pattern().points() * static_cast<int64_t>(sizeof(float));
  for (int64_t group = 0; group < groups; ++group) plan.setup.units.push_back({group, bytes});
  plan.setup.kind = kHeights;
  plan.setup.capacity = plan.slots * bytes;
  plan.setup.stream = caches.stream;
  plan.setup.cpu_bytes = caches.cpu_bytes;
  plan.setup.fetch_delay = caches.fetch_delay;
  plan.setup.decode = [hierarchy](int, int64_t group, const Bytes& page) {
    const Stored& stored = hierarchy->stored();
    return decode_page(hierarchy->samples(), stored.shape.bits, group, page, stored.heights);
  };
  return plan;
}

}  // namespace lodlab::subdivision
