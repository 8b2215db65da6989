// SPDX-License-Identifier: MIT
// Index ranges composed for a patch's resolutions and clip, in an order that suits the vertex cache
// (ranges.h).
#include "methods/seamless/ranges.h"

#include <algorithm>
#include <set>

namespace lodlab::seamless {
namespace {

/// The order of triangles: strip, row, column.
std::array<int, 3> place(const Triangle& t) {
  const int u = t[0].u + t[1].u + t[2].u, v = t[0].v + t[1].v + t[2].v;
  return {u / (3 * kStrip), v / 3, u};
}

}  // namespace

/// The number in Z-order of the least square with this lattice cell; 0 where patches stay whole.
int Ranges::cell(int u, int v) const {
  if (!cut_up_) return 0;
  int out = 0;
  for (int bit = kSquareLog2, at = 0; 1 << bit < mesh_.segments(); ++bit, at += 2)
    out |= (u >> bit & 1) << at | (v >> bit & 1) << (at + 1);
  return out;
}

Ranges::Range Ranges::range(const Resolutions& k, int clip_x, int clip_y, const Square& square) {
  const int side = mesh_.segments();
  if (square.side == side) return whole(k, clip_x, clip_y).range;
  const Key key{k, clip_x, clip_y, square};
  const auto known = parts_.find(key);
  if (known != parts_.end()) return known->second;
  const std::vector<uint32_t>& cells = whole(k, clip_x, clip_y).cells;
  const int first = cell(square.u, square.v), across = square.side >> kSquareLog2;
  const uint32_t begin = cells[static_cast<size_t>(first)],
                 end = cells[static_cast<size_t>(first + across * across)];
  return parts_[key] = {begin, end - begin, vertices(begin, end - begin)};
}

const Ranges::Whole& Ranges::whole(const Resolutions& k, int clip_x, int clip_y) {
  const Key key{k, clip_x, clip_y, {0, 0, mesh_.segments()}};
  const auto known = wholes_.find(key);
  return known != wholes_.end() ? known->second : wholes_[key] = compose(key);
}

uint32_t Ranges::vertices(uint32_t first_index, uint32_t indices) const {
  std::vector<bool> seen(static_cast<size_t>(slots_.floats()));
  uint32_t count = 0;
  for (uint32_t i = first_index; i < first_index + indices; ++i) {
    count += !seen[indices_[i]];
    seen[indices_[i]] = true;
  }
  return count;
}

Ranges::Whole Ranges::compose(const Key& key) {
  const int side = mesh_.segments();
  const auto on_diagonal = [side](const Vertex& p) { return p.u == p.v || p.u + p.v == side; };
  struct Placed {
    int cell;
    Triangle t;
  };
  std::vector<Placed> all;
  const std::array<int, 12> pieces = mesh_.pieces_of(key.k);
  for (size_t i = 0; i < pieces.size(); ++i) {
    const bool strip = i >= 4;  // the last vertex of a strip's triangle lies on a diagonal, of a tile's never
    for (Triangle t : mesh_.piece(pieces[i])) {
      if (!remains(t, key.clip_x, key.clip_y)) continue;
      const auto last =
          std::find_if(t.begin(), t.end(), [&](const Vertex& p) { return on_diagonal(p) == strip; });
      std::rotate(t.begin(), last + 1, t.end());
      all.push_back({cell(std::min({t[0].u, t[1].u, t[2].u}), std::min({t[0].v, t[1].v, t[2].v})), t});
    }
  }
  std::stable_sort(all.begin(), all.end(), [](const Placed& a, const Placed& b) {
    return a.cell != b.cell ? a.cell < b.cell : place(a.t) < place(b.t);
  });
  const auto first = static_cast<uint32_t>(indices_.size());
  const int across = side >> kSquareLog2, cells = cut_up_ ? across * across : 1;
  Whole out{{first, static_cast<uint32_t>(3 * all.size()), 0}, {}};
  for (const Placed& placed : all) {
    out.cells.resize(static_cast<size_t>(placed.cell) + 1, static_cast<uint32_t>(indices_.size()));
    for (size_t corner = 0; corner < 3; ++corner)
      indices_.push_back(static_cast<uint32_t>(slots_.index(placed.t, corner)));
  }
  out.cells.resize(static_cast<size_t>(cells) + 1, static_cast<uint32_t>(indices_.size()));
  out.range.vertices = vertices(first, out.range.indices);
  return out;
}

int64_t Ranges::most_bytes(const PatchMesh& mesh, const Layout& layout) {
  std::set<std::pair<int, int>> clips;
  for (int l = 0; l < layout.levels; ++l) {
    const Patch first{l, 0, 0}, last{l, layout.down(l) - 1, layout.across(l) - 1};
    for (const int x : {layout.clip_x(first), layout.clip_x(last)}) {
      for (const int y : {layout.clip_y(first), layout.clip_y(last)}) clips.insert({x, y});
    }
  }
  int64_t triangles = 0;
  for (const auto& [x, y] : clips) {
    for (int i = 0; i < packed_count(layout.resolutions); ++i)
      triangles += mesh.triangles(unpack(i, layout.resolutions), x, y);
  }
  return 3 * triangles * static_cast<int64_t>(sizeof(uint32_t));
}

}  // namespace lodlab::seamless
