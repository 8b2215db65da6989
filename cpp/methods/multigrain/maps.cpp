// SPDX-License-Identifier: MIT
#include "methods/multigrain/maps.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace lodlab::multigrain {
namespace {

Box box_of(const Node& n) { return {{n.lo[0], n.lo[1], n.lo[2]}, {n.hi[0], n.hi[1], n.hi[2]}}; }

/// Length of a pixel at the nearest point of the box that the camera may see: a lower bound, source units.
double pixel_length(const Box& box, const Camera& camera) {
  double depth = std::numeric_limits<double>::infinity();
  for (int corner = 0; corner < 8; ++corner) {
    const glm::dvec3 at{(corner & 1 ? box.hi : box.lo).x, (corner & 2 ? box.hi : box.lo).y,
                        (corner & 4 ? box.hi : box.lo).z};
    depth = std::min(depth, camera.depth(at - camera.eye));
  }
  return std::max(depth, distance(box, camera.eye) / camera.s) / camera.K;
}

/// Length from one sample of the node to the next along the axis where that is shorter, where it is longest.
double sample_length(const FieldFrame& frame, const Layout& layout, const Node& n) {
  if (!frame.planet) return std::min(frame.dx, frame.dy);
  const int64_t last = std::min(n.row + (int64_t{1} << layout.node_log2(n.level)), layout.last_row());
  const double north = frame.latitude(n.row), south = frame.latitude(last);
  const double nearest = south < 0.0 && north > 0.0 ? 0.0 : std::min(std::abs(north), std::abs(south));
  const double degrees = std::min(frame.dlat, frame.dlon * cos_sin_degrees(nearest).x);
  return (frame.radius + frame.z_max) * degrees * std::numbers::pi / 180.0;
}

}  // namespace

Maps::Maps(const Forest& forest) : forest_(forest) {
  const auto add = [&](PageKind kind, const char* name) {
    if (forest.store->has_page(kind, 0))
      maps_.push_back({kind, MapTiles::stored(*forest.store, name, forest.layout)});
  };
  add(kColors, "colors");
  add(kNormals, "normals");
}

MapPlace Maps::place(const Map& map, int64_t id, int64_t row, int64_t col) const {
  const MapTiles::Tile tile = map.tiles.at(id);
  const double texels = std::ldexp(1.0, map.tiles.finer_log2() - tile.level);  // a sample
  const auto pitch = static_cast<double>(map.tiles.pitch());
  const auto place = [&](int64_t sample, int64_t first) {
    return static_cast<float>(((static_cast<double>(sample) + 0.5) * texels - static_cast<double>(first)) /
                              pitch);
  };
  return {place(col, tile.col), place(row, tile.row), static_cast<float>(texels / pitch)};
}

void Maps::patches(uint32_t id, int stride_log2, const Camera& camera, double texels_per_pixel,
                   std::vector<Patch>& out) const {
  const Node& node = forest_.node[id];
  const int size = forest_.layout.node_log2(node.level);
  const Box box = box_of(node);
  Patch patch{node.row, node.col, size};
  if (maps_.empty() || !camera.sees(box)) {
    out.push_back(patch);
    return;
  }
  // Samples in the length that a texel may have: a pixel's part.
  const double samples =
      pixel_length(box, camera) / (sample_length(forest_.frame, forest_.layout, node) * texels_per_pixel);
  bool split = false;
  for (size_t i = 0; i < maps_.size(); ++i) {
    const MapTiles& tiles = maps_[i].tiles;
    const int coarsest = tiles.levels() - 1;
    const double finest = std::ldexp(samples, tiles.finer_log2());  // texels of level 0
    const int wanted =
        finest > 1.0 ? std::min(static_cast<int>(std::min(std::log2(finest), 62.0)), coarsest) : 0;
    const int fits = std::clamp(size + tiles.finer_log2() - tiles.side_log2(), 0, coarsest);
    split |= wanted < fits;
    const int level = std::max(wanted, fits);
    patch.tile[i] = tiles.id(level, node.row, node.col);
    patch.density[i] = std::ldexp(finest, -level);
  }
  // A patch has at least two cells a side, as nodes have.
  if (!split || node.children == 0 || size - 1 <= stride_log2) {
    out.push_back(patch);
    return;
  }
  for (uint32_t child = node.first_child; child < node.first_child + node.children; ++child)
    patches(child, stride_log2, camera, texels_per_pixel, out);
}

}  // namespace lodlab::multigrain
