// SPDX-License-Identifier: MIT
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

Ranges::Range Ranges::range(const Resolutions& k, int clip_x, int clip_y) {
  const Key key{k, clip_x, clip_y};
  const auto known = ranges_.find(key);
  return known != ranges_.end() ? known->second : ranges_[key] = compose(key);
}

Ranges::Range Ranges::compose(const Key& key) {
  const int side = mesh_.segments();
  const auto on_diagonal = [side](const Vertex& p) { return p.u == p.v || p.u + p.v == side; };
  std::vector<Triangle> all;
  const std::array<int, 12> pieces = mesh_.pieces_of(key.k);
  for (size_t i = 0; i < pieces.size(); ++i) {
    const bool strip = i >= 4;  // the last vertex of a strip's triangle lies on a diagonal, of a tile's never
    for (Triangle t : mesh_.piece(pieces[i])) {
      if (!remains(t, key.clip_x, key.clip_y)) continue;
      const auto last =
          std::find_if(t.begin(), t.end(), [&](const Vertex& p) { return on_diagonal(p) == strip; });
      std::rotate(t.begin(), last + 1, t.end());
      all.push_back(t);
    }
  }
  std::stable_sort(all.begin(), all.end(),
                   [](const Triangle& a, const Triangle& b) { return place(a) < place(b); });
  Range out{static_cast<uint32_t>(indices_.size()), static_cast<uint32_t>(3 * all.size()), 0};
  std::vector<bool> seen(static_cast<size_t>(slots_.floats()));
  for (const Triangle& t : all) {
    for (size_t corner = 0; corner < 3; ++corner) {
      const auto index = static_cast<size_t>(slots_.index(t, corner));
      out.vertices += !seen[index];
      seen[index] = true;
      indices_.push_back(static_cast<uint16_t>(index));
    }
  }
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
  return 3 * triangles * static_cast<int64_t>(sizeof(uint16_t));
}

}  // namespace lodlab::seamless
