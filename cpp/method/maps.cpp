// SPDX-License-Identifier: MIT
#include "method/maps.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace lodlab {
namespace {

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

/// Length from one sample of the square to the next along the axis where that is shorter, where it is
/// longest.
double sample_length(const FieldFrame& frame, const MapSquare& square) {
  if (!frame.planet) return std::min(frame.dx, frame.dy);
  const int64_t last = std::min(square.row + (int64_t{1} << square.size_log2), frame.rows - 1);
  const double north = frame.latitude(square.row), south = frame.latitude(last);
  const double nearest = south < 0.0 && north > 0.0 ? 0.0 : std::min(std::abs(north), std::abs(south));
  const double degrees = std::min(frame.dlat, frame.dlon * cos_sin_degrees(nearest).x);
  return (frame.radius + frame.z_max) * degrees * std::numbers::pi / 180.0;
}

}  // namespace

Maps::Maps(const Store& store, const FieldFrame& frame, int piece_log2) : frame_(frame) {
  const auto add = [&](MapKind kind, const char* name) {
    if (store.has_page(kind, 0)) maps_.push_back({kind, MapTiles::stored(store, name, frame, piece_log2)});
  };
  add(kColors, "colors");
  add(kNormals, "normals");
}

std::optional<Bytes> Maps::decode(int kind, int64_t id, const Bytes& stored) const {
  for (const Map& map : maps_) {
    if (map.kind != kind) continue;
    const std::vector<uint32_t> texels = decode_map_tile(map.tiles.at(id), stored);
    const auto bytes = as_bytes(texels);
    return Bytes(bytes.begin(), bytes.end());
  }
  return std::nullopt;
}

MapPlace Maps::place(const Map& map, int64_t id, int64_t row, int64_t col) {
  const MapTiles::Tile tile = map.tiles.at(id);
  const double texels = std::ldexp(1.0, map.tiles.finer_log2() - tile.level);  // a sample
  const auto pitch = static_cast<double>(map.tiles.pitch());
  const auto place = [&](int64_t sample, int64_t first) {
    return static_cast<float>(((static_cast<double>(sample) + 0.5) * texels - static_cast<double>(first)) /
                              pitch);
  };
  return {place(col, tile.col), place(row, tile.row), static_cast<float>(texels / pitch)};
}

void Maps::patches(const MapSquares& squares, const MapSquare& square, const Camera& camera,
                   double texels_per_pixel, std::vector<MapPatch>& out) const {
  MapPatch patch{static_cast<int32_t>(square.row), static_cast<int32_t>(square.col), square.size_log2};
  if (maps_.empty() || !camera.sees(square.box)) {
    out.push_back(patch);
    return;
  }
  // Samples in the length that a texel may have: a pixel's part.
  const double samples =
      pixel_length(square.box, camera) / (sample_length(frame_, square) * texels_per_pixel);
  bool split = false;
  for (size_t i = 0; i < maps_.size(); ++i) {
    const MapTiles& tiles = maps_[i].tiles;
    const int coarsest = tiles.levels() - 1;
    const double finest = std::ldexp(samples, tiles.finer_log2());  // texels of level 0
    const int wanted =
        finest > 1.0 ? std::min(static_cast<int>(std::min(std::log2(finest), 62.0)), coarsest) : 0;
    const int fits = std::clamp(square.size_log2 + tiles.finer_log2() - tiles.side_log2(), 0, coarsest);
    split |= wanted < fits;
    const int level = std::max(wanted, fits);
    patch.tile[i] = tiles.id(level, square.row, square.col);
    patch.density[i] = std::ldexp(finest, -level);
  }
  const std::vector<MapSquare> parts = split ? squares.parts(square) : std::vector<MapSquare>();
  if (parts.empty()) out.push_back(patch);
  for (const MapSquare& part : parts) patches(squares, part, camera, texels_per_pixel, out);
}

}  // namespace lodlab
