// SPDX-License-Identifier: MIT
// The maps of an opened store, colours and normals, and which of their tiles (map_tiles.h) a view needs: each
// has a resolution of its own wherever anything is drawn, whatever its triangles. A method says of what
// squares of samples that consists; one with more texels than a tile is cut into four. No GL.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "geometry/view.h"
#include "method/map_tiles.h"
#include "method/method.h"

namespace lodlab {

constexpr size_t kMostMaps = 2;

struct Map {
  MapKind kind;
  MapTiles tiles;
};

/// Samples that are drawn together; `size_log2` is that of the square's side.
struct MapSquare {
  int64_t row, col;  ///< its first sample
  int size_log2;
  Box box;             ///< what is drawn there lies inside
  uint32_t node = 0;   ///< that it is, or is a part of
  int least_log2 = 0;  ///< log2 of the stride that it is drawn with: what it can be cut into
};

/// How a method draws the nodes of its cuts.
class MapSquares {
 public:
  virtual ~MapSquares() = default;
  virtual MapSquare whole(const CutNode& picked) const = 0;
  /// Those with half its side that cover it, each with triangles of its own; none: it cannot be cut.
  virtual std::vector<MapSquare> parts(const MapSquare& square) const = 0;
};

/// A square that is drawn from one tile of each map.
struct MapPatch {
  int32_t row, col;  ///< its first sample
  int size_log2;
  std::array<int64_t, kMostMaps> tile{-1, -1};  ///< by map; -1: out of sight
  /// Texels of the tile's level in the length of a pixel where the patch is nearest, as texels_per_pixel has
  /// it.
  std::array<double, kMostMaps> density{};
};

/// Where a patch lies in a tile, as shaders have it: its first sample; from one sample to the next.
struct MapPlace {
  float u, v, scale;
};

class Maps {
 public:
  Maps(const Store& store, const FieldFrame& frame, int piece_log2);

  /// Colours, then normals, as far as the store has them.
  const std::vector<Map>& all() const { return maps_; }

  /// Decodes a page that is a tile of a map: its texels and those of its mip levels.
  std::optional<Bytes> decode(int kind, int64_t id, const Bytes& stored) const;

  /// The patches of a square: as many as it takes for each to have `texels_per_pixel` texels a pixel of every
  /// map where it is nearest, or all that there are. One patch, without tiles, for what is out of sight, and
  /// where there are no maps.
  void patches(const MapSquares& squares, const MapSquare& square, const Camera& camera,
               double texels_per_pixel, std::vector<MapPatch>& out) const;
  /// `tile` covers the sample.
  static MapPlace place(const Map& map, int64_t tile, int64_t row, int64_t col);

 private:
  FieldFrame frame_;
  std::vector<Map> maps_;
};

}  // namespace lodlab
