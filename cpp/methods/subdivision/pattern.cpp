// SPDX-License-Identifier: MIT
#include "methods/subdivision/pattern.h"

#include <bit>
#include <string>

#include "base/errors.h"
#include "base/parallel.h"
#include "subdivision/displace.h"

namespace lodlab::subdivision {
namespace {

constexpr int kMostDoublings = 10;
constexpr int64_t kGrain = 64;

}  // namespace

Pattern Pattern::of_degree(int64_t degree) {
  for (int d = 1; d <= kMostDoublings; ++d) {
    if (degree == (int64_t{1} << d) + 1) return {d};
  }
  throw InvalidInput("subdivision: degree " + std::to_string(degree) + "; it must be 2^d + 1, d from 1 to " +
                     std::to_string(kMostDoublings));
}

int Pattern::level(int di, int dj) const {
  const int64_t squared = int64_t{di} * di + int64_t{di} * dj + int64_t{dj} * dj;
  int out = 0;
  while (out < 2 * d) {
    const int next = out + 1;
    const int64_t size = int64_t{1} << (d - next / 2);
    if (4 * squared > (next % 2 == 0 ? 4 : 3) * size * size) break;
    out = next;
  }
  return out;
}

Samples::Samples(const ControlMesh& control, Pattern pattern)
    : control_(control),
      pattern_(pattern),
      vertices_(static_cast<int64_t>(control.positions.size())),
      faces_(static_cast<int64_t>(control.faces.size())),
      edges_(mesh_edges(control.faces, vertices_)),
      edge_of_side_(3 * control.faces.size()) {
  first_inside_ = vertices_ + edges_.count() * (pattern_.n() - 1);
  for (int64_t e = 0; e < edges_.count(); ++e) {
    for (const uint32_t side : edges_.of(e)) edge_of_side_[side] = static_cast<uint32_t>(e);
  }
}

std::pair<uint32_t, uint32_t> Samples::ends(int64_t edge) const {
  const uint32_t side = edges_.of(edge)[0];
  return std::minmax({vertex_of(control_.faces, side), vertex_of(control_.faces, side_end(side))});
}

int64_t Samples::of(int64_t face, int i, int j) const {
  const int n = pattern_.n(), k = n - i - j;
  const Face& f = control_.faces[static_cast<size_t>(face)];
  if (k == n) return f[0];
  if (i == n) return f[1];
  if (j == n) return f[2];
  const auto on_side = [&](int side, int along) {
    const bool up = f[static_cast<size_t>(side)] < f[static_cast<size_t>((side + 1) % 3)];
    return vertices_ + edge(face, side) * (n - 1) + (up ? along : n - along) - 1;
  };
  if (j == 0) return on_side(0, i);
  if (k == 0) return on_side(1, j);
  if (i == 0) return on_side(2, k);
  const int before = (j - 1) * (n - 1) - (j - 1) * j / 2;  // the rows below hold n - 2, n - 3, ...
  return first_inside_ + face * pattern_.inside() + before + i - 1;
}

void Samples::of_face(int64_t face, std::span<int64_t> out) const {
  const int n = pattern_.n();
  size_t at = 0;
  for (int j = 0; j <= n; ++j) {
    for (int i = 0; i + j <= n; ++i) out[at++] = of(face, i, j);
  }
}

std::vector<Samples::Place> Samples::places(const ControlMesh& control) const {
  const int n = pattern_.n();
  const float step = 1.0f / static_cast<float>(n);  // a power of two: weights are exact
  std::vector<Place> out(static_cast<size_t>(count()));
  const auto place = [&](uint32_t a, uint32_t b, uint32_t c, int i, int j) -> Place {
    const glm::vec3 weights =
        step * glm::vec3(static_cast<float>(n - i - j), static_cast<float>(i), static_cast<float>(j));
    const auto at = [&](const std::vector<glm::dvec3>& of) {
      return interpolated(glm::vec3(of[a]), glm::vec3(of[b]), glm::vec3(of[c]), weights);
    };
    return {at(control.positions), at(control.normals)};
  };
  for (uint32_t v = 0; v < control.positions.size(); ++v) out[v] = place(v, v, v, 0, 0);
  parallel_for(edges_.count(), kGrain, [&](int64_t begin, int64_t end) {
    for (int64_t e = begin; e < end; ++e) {
      const auto [a, b] = ends(e);
      for (int s = 1; s < n; ++s)
        out[static_cast<size_t>(vertices_ + e * (n - 1) + s - 1)] = place(a, b, a, s, 0);
    }
  });
  parallel_for(faces_, kGrain, [&](int64_t begin, int64_t end) {
    for (int64_t f = begin; f < end; ++f) {
      const auto& [a, b, c] = control.faces[static_cast<size_t>(f)];
      auto at = static_cast<size_t>(first_inside_ + f * pattern_.inside());
      for (int j = 1; j < n; ++j) {
        for (int i = 1; i + j < n; ++i) out[at++] = place(a, b, c, i, j);
      }
    }
  });
  return out;
}

}  // namespace lodlab::subdivision
