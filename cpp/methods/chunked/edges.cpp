// SPDX-License-Identifier: MIT
// Curves along chunk edges and their lower envelope (Ulrich 2002, section 11): a skirt must reach below
// every simplification of its edge that any neighbour may draw, and below all their morphs.
#include <algorithm>
#include <cmath>

#include "base/parallel.h"
#include "methods/chunked/mesh.h"

namespace lodlab::chunked {
namespace {

/// One grid line, with coordinates along it.
struct Line {
  const Grid& grid;
  bool vertical;
  int32_t at;

  float k(int32_t i) const { return static_cast<float>(vertical ? grid.k(at, i) : grid.k(i, at)); }
  float error(int32_t i) const { return vertical ? grid.error(at, i) : grid.error(i, at); }
  float k_at(int32_t i, int32_t across) const {
    return static_cast<float>(vertical ? grid.k(at + across, i) : grid.k(i, at + across));
  }
};

/// Height of a level's mesh where a middle line of its squares meets their edges and centres.
float middle_height(const Line& line, float limit, int32_t side, int32_t i) {
  if (line.error(i) > limit) return line.k(i);
  const int32_t half = side / 2;
  if (i % side == 0) return 0.5f * (line.k_at(i, -half) + line.k_at(i, half));
  const int32_t x = (line.vertical ? line.at : i) - half, y = (line.vertical ? i : line.at) - half;
  const int32_t flip = main_diagonal(x, y, side) ? 1 : -1;
  return 0.5f * static_cast<float>(line.grid.k(x, y + half - flip * half) +
                                   line.grid.k(x + side, y + half + flip * half));
}

}  // namespace

void edge_curve(const Grid& grid, const Levels& levels, int level, bool vertical, int32_t at, int32_t from,
                int32_t to, std::vector<float>& out) {
  const Layout& layout = grid.layout();
  const int32_t side = layout.side(level);
  const bool middle = at % side != 0;
  const int32_t step = middle ? side / 2 : side;
  const float limit = levels.limit[static_cast<size_t>(level)];
  const Line line{grid, vertical, at};
  // Past the last leaf no vertex but the forced ones can belong to a triangle that reaches the field.
  const int32_t cells = vertical ? layout.height : layout.width;
  const int32_t kept = (cells + layout.leaf - 1) / layout.leaf * layout.leaf;
  out.resize(static_cast<size_t>(to - from + 1));
  const auto forced = [&](int32_t i) { return middle ? middle_height(line, limit, side, i) : line.k(i); };
  int32_t knot = from;
  float z = forced(from);
  for (int32_t i = from; i < to; ++i) {
    int32_t next = knot + 1;
    while (next % step != 0 &&
           (next > kept ? next % layout.leaf != 0 || line.error(next) <= limit : line.error(next) <= limit)) {
      ++next;
    }
    const float z_next = next % step == 0 ? forced(next) : line.k(next);
    const float slope = (z_next - z) / static_cast<float>(next - knot);
    for (int32_t j = knot; j < next; ++j)
      out[static_cast<size_t>(j - from)] = z + slope * static_cast<float>(j - knot);
    knot = next;
    z = z_next;
    i = next - 1;
  }
  out.back() = z;
}

Envelope::Envelope(const Grid& grid, const Levels& levels) : leaf_(grid.layout().leaf) {
  const Layout& layout = grid.layout();
  for (int vertical = 0; vertical < 2; ++vertical) {
    const int32_t across = vertical ? layout.width : layout.height;
    const int32_t along = vertical ? layout.height : layout.width;
    const int32_t count = (across - 1) / leaf_;
    length_[vertical] = along + 1;
    lines_[vertical].assign(static_cast<size_t>(count) * length_[vertical], 65535);
    parallel_for(count, 1, [&, vertical, along](int64_t begin, int64_t end) {
      std::vector<float> curve;
      for (int64_t line = begin; line < end; ++line) {
        const int32_t at = static_cast<int32_t>(line + 1) * leaf_;
        uint16_t* low = &lines_[vertical][static_cast<size_t>(line) * length_[vertical]];
        int first = 0;
        while (at % layout.side(first) != 0) ++first;
        // The level above the first that has an edge here is the morph target of that first one.
        for (int level = std::max(0, first - 1); level < layout.levels; ++level) {
          const int32_t side = layout.side(level);
          edge_curve(grid, levels, level, vertical, at, 0, (along + side - 1) / side * side, curve);
          for (int32_t i = 0; i <= along; ++i) {
            const float z = std::floor(curve[static_cast<size_t>(i)] - 0.5f);  // targets are rounded
            low[i] = std::min(low[i], static_cast<uint16_t>(std::max(z, 0.0f)));
          }
        }
      }
    });
  }
}

}  // namespace lodlab::chunked
