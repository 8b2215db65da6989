// SPDX-License-Identifier: MIT
// The pieces of patches: whatever the resolutions of the four edges, and wherever the field ends in a patch,
// they cover it exactly once, counter-clockwise, and its edges have the segments of their resolutions.
#include <doctest/doctest.h>

#include <map>
#include <random>

#include "methods/seamless/mesh.h"

using namespace lodlab::seamless;

namespace {

struct At {
  int x, y;
  auto operator<=>(const At&) const = default;
};

/// Lattice lines `step` units apart, the last of those that are there (clip) on the border.
struct Border {
  int step, x, y;

  At operator()(const Vertex& v) const { return {std::min(v.u * step, x), std::min(v.v * step, y)}; }
};

/// Twice the area, positive for a triangle that is counter-clockwise seen from above; y points south.
int64_t area_of(At a, At b, At c) {
  return int64_t{c.x - a.x} * (b.y - a.y) - int64_t{b.x - a.x} * (c.y - a.y);
}

struct Summary {
  int64_t area = 0, triangles = 0, turned = 0, open = 0;
  /// Of the four sides: the places of their segments' ends.
  std::array<std::map<int, int>, 4> sides;
};

Summary summarize(const PatchMesh& mesh, const Resolutions& k, const Border& at) {
  Summary out;
  std::map<std::pair<At, At>, int> edges;
  for (const int piece : mesh.pieces_of(k)) {
    for (const Triangle& t : mesh.piece(piece)) {
      const At p[3] = {at(t[0]), at(t[1]), at(t[2])};
      const int64_t area = area_of(p[0], p[1], p[2]);
      out.turned += area < 0;
      if (area == 0) continue;
      ++out.triangles;
      out.area += area;
      for (size_t i = 0; i < 3; ++i) ++edges[{p[i], p[(i + 1) % 3]}];
    }
  }
  for (const auto& [edge, count] : edges) {
    const auto [a, b] = edge;
    const auto add = [&](Edge e, int from, int to) {
      out.open += count != 1;
      ++out.sides[e][from];
      ++out.sides[e][to];
    };
    if (a.y == 0 && b.y == 0) {
      add(kNorth, a.x, b.x);
    } else if (a.y == at.y && b.y == at.y) {
      add(kSouth, a.x, b.x);
    } else if (a.x == 0 && b.x == 0) {
      add(kWest, a.y, b.y);
    } else if (a.x == at.x && b.x == at.x) {
      add(kEast, a.y, b.y);
    } else {
      const auto other = edges.find({b, a});
      out.open += count != 1 || other == edges.end() || other->second != 1;
    }
  }
  return out;
}

/// Ends of the segments of an edge: every one but the first and the last ends two.
std::map<int, int> segments(int length, int step, int border) {
  std::map<int, int> ends;
  for (int i = 0; i < length; i += step) {
    const int from = std::min(i, border), to = std::min(i + step, border);
    if (from == to) continue;
    ++ends[from];
    ++ends[to];
  }
  return ends;
}

void check(const PatchMesh& mesh, const Resolutions& k, const Border& border) {
  const Summary s = summarize(mesh, k, border);
  CAPTURE(mesh.segments());
  CAPTURE(pack(k, mesh.resolutions()));
  CAPTURE(border.x);
  CAPTURE(border.y);
  REQUIRE(s.turned == 0);
  REQUIRE(s.area == 2 * int64_t{border.x} * border.y);
  REQUIRE(s.open == 0);
  const auto clip = [&](int place) { return (place + border.step - 1) / border.step; };
  REQUIRE(s.triangles == mesh.triangles(k, clip(border.x), clip(border.y)));
  const int length = mesh.segments() * border.step;
  // An edge that lies past the border is not the patch's: what meets the border is.
  for (const Edge e : {kNorth, kEast, kSouth, kWest}) {
    const bool level = e == kNorth || e == kSouth;
    const bool there = level ? e == kNorth || border.y == length : e == kWest || border.x == length;
    if (!there) continue;
    const int step = border.step << (mesh.resolutions() - 1 - k[e]);
    REQUIRE(s.sides[e] == segments(length, step, level ? border.x : border.y));
  }
}

}  // namespace

TEST_CASE("pieces cover a patch once, with the segments of its edges") {
  for (const int resolutions : {2, 3}) {
    for (int log2 = resolutions; log2 <= 7; ++log2) {
      const PatchMesh mesh(log2, resolutions);
      for (int i = 0; i < packed_count(resolutions); ++i) {
        const Resolutions k = unpack(i, resolutions);
        REQUIRE(pack(k, resolutions) == i);
        check(mesh, k, {1, mesh.segments(), mesh.segments()});
      }
    }
  }
}

TEST_CASE("clamped anywhere, nothing turns over and what is there is covered once") {
  std::mt19937 random(3);
  for (const int resolutions : {2, 3}) {
    for (int log2 = resolutions; log2 <= 6; ++log2) {
      const PatchMesh mesh(log2, resolutions);
      const int step = 4, length = mesh.segments() * step;
      const auto place = [&] { return 1 + static_cast<int>(random() % static_cast<unsigned>(length)); };
      for (int round = 0; round < (log2 <= 4 ? 600 : 60); ++round) {
        const Resolutions k = unpack(static_cast<int>(random()) & 0xff, resolutions);
        const Border border{step, round % 5 == 0 ? length : place(), round % 7 == 0 ? length : place()};
        check(mesh, unpack(pack(k, resolutions) % packed_count(resolutions), resolutions), border);
      }
    }
  }
}

TEST_CASE("small patches, everywhere they may be clamped") {
  for (const int resolutions : {2, 3}) {
    const PatchMesh mesh(resolutions == 2 ? 2 : 3, resolutions);
    const int step = 2, length = mesh.segments() * step;
    for (int i = 0; i < packed_count(resolutions); ++i) {
      for (int y = 1; y <= length; ++y) {
        for (int x = 1; x <= length; ++x) check(mesh, unpack(i, resolutions), {step, x, y});
      }
    }
  }
}
