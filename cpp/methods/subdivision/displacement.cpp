// SPDX-License-Identifier: MIT
#include "methods/subdivision/displacement.h"

#include <algorithm>
#include <cmath>

#include "base/parallel.h"
#include "geometry/mesh_repair.h"

namespace lodlab::subdivision {
namespace {

constexpr int64_t kGrain = 256;

WeldedMesh relative(const Mesh& source, const glm::dvec3& centre) {
  const std::vector<uint32_t> first = first_at_position(source.positions);
  WeldedMesh out;
  out.positions.reserve(source.positions.size());
  for (const glm::dvec3& p : source.positions) out.positions.push_back(p - centre);
  out.faces.reserve(source.faces.size());
  for (const Face& f : source.faces) out.faces.push_back({first[f[0]], first[f[1]], first[f[2]]});
  return out;
}

bool faces_along(const WeldedMesh& mesh, uint32_t triangle, const glm::dvec3& normal) {
  const Triangle t = mesh.triangle(triangle);
  return glm::dot(glm::cross(t[1] - t[0], t[2] - t[0]), normal) > 0.0;
}

/// Calls do_pair(sample, sample) for the ends of each step of the pattern.
template <class DoPair>
void for_steps(const Pattern& p, std::span<const int64_t> of, const DoPair& do_pair) {
  for (int j = 0; j < p.n(); ++j) {
    for (int i = 0; i + j < p.n(); ++i) {
      const auto at = [&](int di, int dj) {
        return static_cast<size_t>(of[static_cast<size_t>(p.point(i + di, j + dj))]);
      };
      do_pair(at(0, 0), at(1, 0));
      do_pair(at(0, 0), at(0, 1));
      do_pair(at(1, 0), at(0, 1));
    }
  }
}

class Sampler {
 public:
  Sampler(const SourceSurface& source, const ControlMesh& control, const Samples& samples)
      : source_(source), control_(control), samples_(samples) {
    out_.places = samples.places();
    out_.heights.assign(out_.places.size(), 0.0f);
    out_.near.assign(out_.places.size(), kNoTriangle);
    good_.assign(out_.places.size(), 0);
    measure_faces();
    find_beside();
  }
  void intersect(Count& count);
  void leave_wrong_sheets();
  void repair();
  void interpolate(Count& count);
  Displacement take() { return std::move(out_); }

 private:
  void measure_faces();
  void find_beside();
  /// Whether a source triangle has collapsed onto a corner of the face, or of one that touches it.
  bool is_beside(uint32_t triangle, uint32_t face) const {
    if (control_.onto.empty()) return true;
    const std::vector<uint32_t>& all = beside_[face];
    const auto& corners = source_.mesh.faces[triangle];
    return std::any_of(corners.begin(), corners.end(), [&](uint32_t v) {
      return std::binary_search(all.begin(), all.end(), control_.onto[v]);
    });
  }
  template <class DoFace>
  void for_faces(const DoFace& do_face) const {
    std::vector<int64_t> of(static_cast<size_t>(samples_.pattern().points()));
    for (int64_t f = 0; f < static_cast<int64_t>(control_.faces.size()); ++f) {
      samples_.of_face(f, of);
      do_face(f, std::span<const int64_t>(of));
    }
  }
  void average_neighbours();
  double length(size_t s) const { return glm::length(glm::dvec3(out_.places[s].normal)); }
  double distance(size_t s) const { return length(s) * out_.heights[s]; }
  double apart(size_t a, size_t b) const {
    return glm::distance(glm::dvec3(out_.places[a].position), glm::dvec3(out_.places[b].position));
  }

  const SourceSurface& source_;
  const ControlMesh& control_;
  const Samples& samples_;
  Displacement out_;
  std::vector<uint8_t> good_;
  std::vector<float> reach_;                   ///< half the longest edge of a sample's faces
  std::vector<uint32_t> face_;                 ///< one of a sample's
  std::vector<std::vector<uint32_t>> beside_;  ///< the control vertices of a face and of those that touch it
};

void Sampler::measure_faces() {
  reach_.assign(out_.places.size(), 0.0f);
  face_.assign(out_.places.size(), 0);
  for_faces([&](int64_t f, std::span<const int64_t> of) {
    const Face& v = control_.faces[static_cast<size_t>(f)];
    double longest = 0.0;
    for (size_t k = 0; k < 3; ++k)
      longest =
          std::max(longest, glm::distance(control_.positions[v[k]], control_.positions[v[(k + 1) % 3]]));
    for (const int64_t s : of) {
      float& reach = reach_[static_cast<size_t>(s)];
      reach = std::max(reach, static_cast<float>(0.5 * longest));
      face_[static_cast<size_t>(s)] = static_cast<uint32_t>(f);
    }
  });
}

void Sampler::find_beside() {
  std::vector<std::vector<uint32_t>> round(control_.positions.size());
  for (const Face& face : control_.faces)
    for (const uint32_t v : face) round[v].insert(round[v].end(), face.begin(), face.end());
  for (const Face& face : control_.faces) {
    std::vector<uint32_t>& all = beside_.emplace_back();
    for (const uint32_t v : face) all.insert(all.end(), round[v].begin(), round[v].end());
    std::sort(all.begin(), all.end());
    all.erase(std::unique(all.begin(), all.end()), all.end());
  }
}

void Sampler::intersect(Count& count) {
  parallel_for(static_cast<int64_t>(good_.size()), kGrain, [&](int64_t begin, int64_t end) {
    for (auto s = static_cast<size_t>(begin); s < static_cast<size_t>(end); ++s) {
      const Samples::Place& place = out_.places[s];
      if (length(s) < kShortestNormal) continue;
      const Crossing cut =
          source_.surface.closest_crossing(place.position, place.normal, reach_[s] / length(s),
                                           [&](uint32_t t) { return is_beside(t, face_[s]); });
      if (cut.triangle == kNoTriangle) continue;
      out_.heights[s] = static_cast<float>(cut.along);
      out_.near[s] = cut.triangle;
      good_[s] = 1;
    }
    count(end - begin);
  });
  out_.missed = std::count(good_.begin(), good_.end(), uint8_t{0});
}

void Sampler::leave_wrong_sheets() {
  std::vector<uint8_t> steep(good_.size(), 0);
  for_faces([&](int64_t, std::span<const int64_t> of) {
    for_steps(samples_.pattern(), of, [&](size_t a, size_t b) {
      if (good_[a] == 0 || good_[b] == 0) return;
      if (std::abs(distance(a) - distance(b)) > kSteepest * apart(a, b)) steep[a] = steep[b] = 1;
    });
  });
  parallel_for(static_cast<int64_t>(good_.size()), kGrain, [&](int64_t begin, int64_t end) {
    for (auto s = static_cast<size_t>(begin); s < static_cast<size_t>(end); ++s) {
      if (steep[s] == 0) continue;
      const Samples::Place& place = out_.places[s];
      const Closest closest = source_.surface.closest(place.position, out_.near[s]);
      if (closest.distance < kMuchCloser * std::abs(distance(s)) &&
          faces_along(source_.mesh, closest.triangle, place.normal))
        good_[s] = 0;
    }
  });
  out_.wrong_sheet = std::count(good_.begin(), good_.end(), uint8_t{0}) - out_.missed;
}

void Sampler::repair() {
  if (out_.missed + out_.wrong_sheet == 0) return;
  std::vector<float> step(good_.size(), 0.0f);
  for_faces([&](int64_t, std::span<const int64_t> of) {
    for_steps(samples_.pattern(), of, [&](size_t a, size_t b) {
      const auto length_there = static_cast<float>(apart(a, b));
      step[a] = std::max(step[a], length_there);
      step[b] = std::max(step[b], length_there);
    });
  });
  parallel_for(static_cast<int64_t>(good_.size()), kGrain, [&](int64_t begin, int64_t end) {
    for (auto s = static_cast<size_t>(begin); s < static_cast<size_t>(end); ++s) {
      if (good_[s] != 0) continue;
      const glm::dvec3 position = out_.places[s].position, normal = out_.places[s].normal;
      const Closest closest = source_.surface.closest(position);
      out_.near[s] = closest.triangle;
      out_.heights[s] = 0.0f;
      if (closest.triangle == kNoTriangle || length(s) < kShortestNormal ||
          !faces_along(source_.mesh, closest.triangle, normal))
        continue;
      const glm::dvec3 way = closest.point - position;
      const double along = glm::dot(way, normal) / glm::dot(normal, normal);
      if (std::abs(along) * length(s) > reach_[s] || glm::length(way - along * normal) > step[s]) continue;
      out_.heights[s] = static_cast<float>(along);
      good_[s] = 1;
    }
  });
  average_neighbours();
}

/// In rounds from the good ones on; what no good one can be reached from stays on the control mesh.
void Sampler::average_neighbours() {
  out_.averaged = std::count(good_.begin(), good_.end(), uint8_t{0});
  for (int64_t left = out_.averaged; left > 0;) {
    std::vector<double> sum(good_.size(), 0.0), count(good_.size(), 0.0);
    for_faces([&](int64_t, std::span<const int64_t> of) {
      for_steps(samples_.pattern(), of, [&](size_t a, size_t b) {
        if (good_[a] == good_[b]) return;
        const size_t bad = good_[a] == 0 ? a : b, from = good_[a] == 0 ? b : a;
        sum[bad] += distance(from);
        count[bad] += 1.0;
      });
    });
    const int64_t before = left;
    for (size_t s = 0; s < good_.size(); ++s) {
      if (count[s] == 0.0) continue;
      out_.heights[s] = static_cast<float>(sum[s] / count[s] / std::max(length(s), kShortestNormal));
      good_[s] = 1;
      --left;
    }
    if (left == before) return;
  }
}

void Sampler::interpolate(Count& count) {
  const Pattern& p = samples_.pattern();
  const auto cells = static_cast<size_t>(p.n() * p.n());
  struct Cell {
    glm::dvec3 centre;
    double above;  ///< its source triangles, in the mean, over the plane of its corners' ends, in normals
  };
  std::vector<Cell> cell(cells * control_.faces.size());
  const auto for_cells = [&](std::span<const int64_t> of, const auto& do_cell) {
    for (int j = 0; j < p.n(); ++j) {
      for (int i = 0; i + j < p.n(); ++i) {
        const auto at = [&](int di, int dj) {
          return static_cast<size_t>(of[static_cast<size_t>(p.point(i + di, j + dj))]);
        };
        do_cell(std::array<size_t, 3>{at(0, 0), at(1, 0), at(0, 1)});
        if (i + j + 1 < p.n()) do_cell(std::array<size_t, 3>{at(1, 0), at(1, 1), at(0, 1)});
      }
    }
  };
  parallel_for(static_cast<int64_t>(control_.faces.size()), 4, [&](int64_t begin, int64_t end) {
    std::vector<int64_t> of(static_cast<size_t>(p.points()));
    for (int64_t f = begin; f < end; ++f) {
      samples_.of_face(f, of);
      Cell* next = &cell[cells * static_cast<size_t>(f)];
      for_cells(of, [&](const std::array<size_t, 3>& corners) {
        glm::dvec3 base(0.0), normal(0.0), centre(0.0);
        double height = 0.0, radius = 0.0;
        for (const size_t s : corners) {
          base += glm::dvec3(out_.places[s].position) / 3.0;
          normal += glm::dvec3(out_.places[s].normal) / 3.0;
          centre += out_.end(s, out_.heights[s]) / 3.0;
          height += out_.heights[s] / 3.0;
        }
        for (const size_t s : corners) radius += glm::distance(centre, out_.end(s, out_.heights[s])) / 6.0;
        double sum = 0.0;
        int triangles = 0;
        source_.surface.any_within(centre, radius, [&](uint32_t t) {
          if (!faces_along(source_.mesh, t, normal) || !is_beside(t, static_cast<uint32_t>(f))) return false;
          const glm::dvec3 at = closest_on_triangle(source_.mesh.triangle(t), centre).point;
          sum += glm::dot(at - base, normal) / glm::dot(normal, normal);
          ++triangles;
          return false;
        });
        const bool known = triangles > 0 && glm::length(normal) >= kShortestNormal;
        *next++ = {centre, known ? sum / triangles - height : 0.0};
      });
    }
    count((end - begin) * static_cast<int64_t>(cells));
  });
  std::vector<double> sum(good_.size(), 0.0), weight(good_.size(), 0.0);
  for_faces([&](int64_t f, std::span<const int64_t> of) {
    const Cell* next = &cell[cells * static_cast<size_t>(f)];
    for_cells(of, [&](const std::array<size_t, 3>& corners) {
      for (const size_t s : corners) {
        const double distance = glm::distance(next->centre, out_.end(s, out_.heights[s]));
        const double w = 1.0 / std::max(distance, 1e-12 * (1.0 + reach_[s]));
        sum[s] += w * next->above;
        weight[s] += w;
      }
      ++next;
    });
  });
  for (size_t s = 0; s < good_.size(); ++s) {
    if (weight[s] > 0.0) out_.heights[s] += static_cast<float>(sum[s] / weight[s]);
  }
}

}  // namespace

SourceSurface::SourceSurface(const Mesh& source)
    : centre(source.box.center()), mesh(relative(source, centre)), surface(mesh) {}

Displacement displace(const SourceSurface& source, const ControlMesh& control, const Samples& samples,
                      Sampling sampling, const Progress& progress) {
  const bool interpolated = sampling == Sampling::kInterpolation;
  const int64_t cells = samples.control_faces() * samples.pattern().n() * samples.pattern().n();
  Count count(progress, "sample", samples.count() + (interpolated ? cells : 0));
  Sampler sampler(source, control, samples);
  sampler.intersect(count);
  sampler.leave_wrong_sheets();
  sampler.repair();
  if (interpolated) sampler.interpolate(count);
  return sampler.take();
}

}  // namespace lodlab::subdivision
