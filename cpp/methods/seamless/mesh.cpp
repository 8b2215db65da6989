// SPDX-License-Identifier: MIT
// Tiles and strips made once for an edge, and turned to the other three (mesh.h).
#include "methods/seamless/mesh.h"

#include <algorithm>

namespace lodlab::seamless {
namespace {

/// A lattice point by its place along an edge and its distance from it, the edge walked with the patch to the
/// left: the south edge eastwards, and so on round.
Vertex turn(Edge e, int along, int inward, int side, int resolution) {
  int u = along, v = side - inward;  // south
  if (e == kEast) {
    u = side - inward;
    v = side - along;
  } else if (e == kNorth) {
    u = side - along;
    v = inward;
  } else if (e == kWest) {
    u = inward;
    v = along;
  }
  return {static_cast<int16_t>(u), static_cast<int16_t>(v), static_cast<int16_t>(resolution)};
}

/// Whole lattice cells between the diagonals, in steps of the tile's resolution. Their own diagonals
/// alternate as in the 4-8 mesh, which is the same seen from any edge.
std::vector<Triangle> make_tile(Edge e, int k, int side, int step) {
  const int n = side / step;
  const auto at = [&](int i, int j) { return turn(e, i * step, j * step, side, k); };
  std::vector<Triangle> out;
  for (int j = 0; j < n / 2 - 1; ++j) {
    for (int i = j + 1; i < n - j - 1; ++i) {
      if ((i + j) % 2 == 0) {
        out.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
        out.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
      } else {
        out.push_back({at(i, j), at(i + 1, j), at(i, j + 1)});
        out.push_back({at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)});
      }
    }
  }
  return out;
}

/// The halves of the lattice cells on the diagonal from the edge's start to the centre: the corner of each,
/// on the edge's side, sees the diagonal's segments across it. At the edge's end it is the mirror image.
std::vector<Triangle> make_half(Edge e, Side at_side, int k, int diagonal, int side, int step, int fine) {
  const bool mirror = at_side == Side::kEnd;
  const int n = side / step, ratio = step / fine;
  const auto at = [&](int along, int inward, int resolution) {
    return turn(e, mirror ? side - along : along, inward, side, resolution);
  };
  const auto on_diagonal = [&](int i) { return at(i * fine, i * fine, diagonal); };
  std::vector<Triangle> out;
  for (int t = 0; t < n / 2; ++t) {
    const Vertex corner = at((t + 1) * step, t * step, k);
    for (int i = t * ratio; i < (t + 1) * ratio; ++i) {
      const Vertex a = on_diagonal(i), b = on_diagonal(i + 1);
      out.push_back(mirror ? Triangle{a, b, corner} : Triangle{a, corner, b});
    }
  }
  return out;
}

}  // namespace

Resolutions unpack(int packed, int resolutions) {
  Resolutions k;
  for (int& one : k) {
    one = packed % resolutions;
    packed /= resolutions;
  }
  return k;
}

int packed_count(int resolutions) { return resolutions * resolutions * resolutions * resolutions; }

PatchMesh::PatchMesh(int patch_log2, int resolutions) : patch_log2_(patch_log2), resolutions_(resolutions) {
  const int side = segments();
  const auto step = [&](int k) { return 1 << (resolutions - 1 - k); };
  tiles_.resize(static_cast<size_t>(4 * resolutions));
  halves_.resize(static_cast<size_t>(8 * resolutions * resolutions));
  for (const Edge e : {kNorth, kEast, kSouth, kWest}) {
    for (int k = 0; k < resolutions; ++k) {
      tiles_[static_cast<size_t>(tile_piece(e, k))] = make_tile(e, k, side, step(k));
      for (const Side at_side : {Side::kStart, Side::kEnd}) {
        for (int diagonal = k; diagonal < resolutions; ++diagonal)
          halves_[half_index(e, at_side, k, diagonal)] =
              make_half(e, at_side, k, diagonal, side, step(k), step(diagonal));
      }
    }
  }
  counts_.assign(static_cast<size_t>(pieces()) * static_cast<size_t>((side + 1) * (side + 1)), -1);
  for (int packed = 0; packed < packed_count(resolutions); ++packed) {
    whole_.push_back(0);
    for (const int i : pieces_of(unpack(packed, resolutions)))
      whole_.back() += static_cast<int64_t>(piece(i).size());
  }
}

std::array<int, 12> PatchMesh::pieces_of(const Resolutions& k) const {
  std::array<int, 12> out;
  size_t i = 0;
  for (const Edge e : {kNorth, kEast, kSouth, kWest}) out[i++] = tile_piece(e, k[static_cast<size_t>(e)]);
  for (const Edge e : {kNorth, kEast, kSouth, kWest}) {
    const Edge beside = next(e);
    const int here = k[static_cast<size_t>(e)], there = k[static_cast<size_t>(beside)];
    out[i++] = half_piece(e, Side::kEnd, here, std::max(here, there));
    out[i++] = half_piece(beside, Side::kStart, there, std::max(here, there));
  }
  return out;
}

int PatchMesh::count(int piece_index, int clip_x, int clip_y) const {
  const int side = segments();
  int32_t& known = counts_[static_cast<size_t>(piece_index) * static_cast<size_t>((side + 1) * (side + 1)) +
                           static_cast<size_t>(clip_y * (side + 1) + clip_x)];
  if (known < 0) {
    const std::vector<Triangle>& all = piece(piece_index);
    known = static_cast<int32_t>(
        std::count_if(all.begin(), all.end(), [&](const Triangle& t) { return remains(t, clip_x, clip_y); }));
  }
  return known;
}

int64_t PatchMesh::clipped_triangles(const Resolutions& k, int clip_x, int clip_y) const {
  int64_t sum = 0;
  for (const int i : pieces_of(k)) sum += count(i, clip_x, clip_y);
  return sum;
}

}  // namespace lodlab::seamless
