// SPDX-License-Identifier: MIT
// A regular grid of heights: flat (z up, metres) or a planet (radius field over longitude, latitude).
// Sample (row, col) of a flat field lies at x = x0 + col dx, y = y0 - row dy; row 0 is north.
// Of a planet it lies at longitude lon0 + col dlon, latitude lat0 - row dlat (degrees), at
// radius + height along that direction; the axis is z, longitude 0 on +x.
// The surface is known at its samples; voids are already filled, `valid` says which samples were real.
// Between samples the full-resolution surface uses the diagonals of the 4-8 mesh: cell (row, col) is cut
// from (row, col) to (row+1, col+1) when row + col is even, else the other way.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <memory>
#include <string>
#include <vector>

#include "geometry/source.h"

namespace lodlab {

inline constexpr int kPositionBits = 40;  ///< of a planet's positions: FieldFrame::position_step()

/// Where a field lies: everything but its heights. Stored in every store of a height field.
struct FieldFrame {
  int64_t rows = 0, cols = 0;
  double dx = 1.0, dy = 1.0;  ///< sample spacing, metres (flat)
  double x0 = 0.0, y0 = 0.0;  ///< centre of the first sample, metres (flat)
  bool planet = false;
  double radius = 6371000.0;                               ///< metres (planet)
  double lon0 = 0.0, lat0 = 90.0, dlon = 0.0, dlat = 0.0;  ///< degrees (planet)
  bool wraps = false;                                      ///< the planet's columns close round 360 degrees
  double z_min = 0.0, z_max = 0.0;                         ///< over all samples, filled ones included
  double height_step = 0.0;  ///< all valid heights are whole multiples of it; 0: unknown

  /// Degrees of a planet's sample; columns past the end of a planet that wraps come round again.
  double longitude(int64_t col) const;
  double latitude(int64_t row) const;
  /// Unit direction of a planet's sample from the centre; all columns of a pole's row give one direction.
  glm::dvec3 direction(int64_t row, int64_t col) const;
  /// The finest step, source units, that a planet's positions need: the least power of two with which all
  /// samples lie within 2^40 steps of the centre, 8 micrometres on the Earth. A method may keep them on a
  /// lattice of it, and the instrument's slack counts it. Of a flat field 0.
  double position_step() const;
  /// World position of a sample with this height.
  glm::dvec3 position(int64_t row, int64_t col, double height) const;
  /// How far from an eye samples lie, at most: by the box of all heights, of a planet by its radius.
  double reach(const glm::dvec3& eye) const;
};

/// Whole rows of a field: [first_row, end_row). The frame is that of the whole field.
struct HeightRows : FieldFrame {
  HeightRows(const FieldFrame& frame, const float* data, const uint8_t* mask, int64_t first, int64_t end)
      : FieldFrame(frame), heights(data), valid(mask), first_row(first), end_row(end) {}

  const float* row(int64_t r) const { return heights + (r - first_row) * cols; }
  float at(int64_t r, int64_t col) const { return row(r)[col]; }

  const float* heights;  ///< of row first_row, then those after it
  const uint8_t* valid;  ///< likewise, 1 = real sample; null: all real, or not asked for
  int64_t first_row, end_row;
};

/// What rows are read into where they are not in memory. Rows that the last reading gave are not read again.
struct RowBuffer {
  explicit RowBuffer(bool with_masks = false) : masks(with_masks) {}
  const bool masks;  ///< whether validity is wanted too
  std::vector<float> heights;
  std::vector<uint8_t> valid;
  int64_t first = 0, end = 0;
};

struct HeightField;

/// Heights on a grid, in memory or read by rows: whoever needs heights asks for one. What works on bands of
/// rows works on both alike, and equal samples give equal results and hashes whatever the bands.
struct FieldSource : Source, FieldFrame {
  std::string kind() const override { return planet ? "planet" : "heightfield"; }
  std::string frame() const override;
  int64_t samples() const override { return rows * cols; }

  /// The field in memory, or null where only rows are.
  virtual const HeightField* whole() const { return nullptr; }
  /// Rows [first, end), or more; valid until the buffer is used again.
  virtual HeightRows read(int64_t first, int64_t end, RowBuffer& buffer) const = 0;
  /// Rows, about, that a pass over all of them reads at once.
  virtual int64_t rows_at_once() const = 0;
  virtual bool has_voids() const = 0;
  /// The mask of coverage.h.
  virtual std::vector<std::byte> coverage() const = 0;
};

/// The heights of a source; Unsupported, naming the operation, where it has none.
const FieldSource& heights_of(const Source& source, const std::string& operation);
/// The field in memory; Unsupported, naming the operation, where a source has none, or is read by windows.
const HeightField& field_in_memory(const Source& source, const std::string& operation);

struct HeightField final : FieldSource {
  const float* heights = nullptr;     ///< rows x cols, row-major, finite everywhere
  const uint8_t* valid = nullptr;     ///< rows x cols, 1 = real sample; null: all real
  std::shared_ptr<const void> owner;  ///< keeps the arrays alive

  float at(int64_t row, int64_t col) const { return heights[row * cols + col]; }
  bool is_valid(int64_t row, int64_t col) const { return valid == nullptr || valid[row * cols + col] != 0; }
  operator HeightRows() const { return {*this, heights, valid, 0, rows}; }

  /// Hash of frame, heights and valid mask.
  std::string hash() const override;
  const HeightField* whole() const override { return this; }
  HeightRows read(int64_t, int64_t, RowBuffer&) const override { return *this; }
  int64_t rows_at_once() const override { return rows; }
  bool has_voids() const override { return valid != nullptr; }
  std::vector<std::byte> coverage() const override;
};

/// Cosine and sine of an angle in degrees, exact at multiples of 90.
glm::dvec2 cos_sin_degrees(double degrees);

/// Checks the frame and the heights, computes z_min and z_max. Throws InvalidInput naming the value and
/// the limit: at least 2 x 2 and at most 2^31 samples, finite heights, positive spacing, a planet's
/// rows between the poles and its columns at most once round, every sample above the planet's centre.
/// A mask without any void becomes null.
std::shared_ptr<const HeightField> make_height_field(const FieldFrame& frame, const float* heights,
                                                     const uint8_t* valid, std::shared_ptr<const void> owner,
                                                     std::string spec);

/// Fills voids (NaN or valid == 0) in place with a smooth membrane: a multigrid solution of Laplace's
/// equation with the real samples as boundary. A field without any real sample throws InvalidInput.
void fill_voids(float* heights, const uint8_t* valid, int64_t rows, int64_t cols);

/// The frame of a FieldSource from its JSON text, exact for doubles.
FieldFrame frame_from_json(const std::string& text);

}  // namespace lodlab
