// SPDX-License-Identifier: MIT
#include "geometry/normals.h"

#include <cmath>

#include "base/parallel.h"
#include "geometry/angles.h"

namespace lodlab {

Normals::Normals(const FieldFrame& frame) : frame_(frame) {
  if (!frame.planet) return;
  for (int64_t col = 0; col < frame.cols; ++col) lon_.push_back(cos_sin_degrees(frame.longitude(col)));
}

glm::dvec2 Normals::slope(const HeightRows& rows, int64_t row, int64_t col) const {
  int64_t west = col - 1, east = col + 1, columns = 2;
  if (frame_.wraps) {
    west = (west + frame_.cols) % frame_.cols;
    east %= frame_.cols;
  } else {
    west = std::max<int64_t>(west, 0);
    east = std::min(east, frame_.cols - 1);
    columns = east - west;
  }
  const int64_t north = std::max<int64_t>(row - 1, 0), south = std::min(row + 1, frame_.rows - 1);
  const auto at = [&](int64_t r, int64_t c) { return static_cast<double>(rows.at(r, c)); };
  return {(at(row, east) - at(row, west)) / static_cast<double>(columns),
          (at(north, col) - at(south, col)) / static_cast<double>(south - north)};
}

/// All of a pole's row is its column 0. The slope (x, y) that fits best h(lon) - h = distance (x cos + y
/// sin).
glm::dvec3 Normals::pole(const HeightRows& rows, int64_t row) const {
  const double up = frame_.latitude(row) > 0.0 ? 1.0 : -1.0;
  const int64_t beside = row == 0 ? 1 : row - 1;
  const double height = rows.at(row, 0), radius = frame_.radius + height;
  const double distance = radius * frame_.dlat * kRadiansPerDegree;
  double cc = 0.0, cs = 0.0, ss = 0.0;
  glm::dvec2 sum{0.0};
  for (int64_t col = 0; col < frame_.cols; ++col) {
    const glm::dvec2 at = lon_[static_cast<size_t>(col)];
    cc += at.x * at.x;
    cs += at.x * at.y;
    ss += at.y * at.y;
    sum += (rows.at(beside, col) - height) / distance * at;
  }
  const double determinant = cc * ss - cs * cs;
  // Columns along one line know the slope along it alone: level across it.
  const glm::dvec2 slope = determinant > 1e-9 * (cc + ss) * (cc + ss)
                               ? glm::dvec2(ss * sum.x - cs * sum.y, cc * sum.y - cs * sum.x) / determinant
                               : sum / (cc + ss);
  return glm::normalize(glm::dvec3(-slope.x, -slope.y, up));
}

std::vector<glm::dvec3> Normals::row(const HeightRows& rows, int64_t row) const {
  std::vector<glm::dvec3> out;
  out.reserve(static_cast<size_t>(frame_.cols));
  if (!frame_.planet) {
    for (int64_t col = 0; col < frame_.cols; ++col) {
      const glm::dvec2 z = slope(rows, row, col);
      out.push_back(glm::normalize(glm::dvec3(-z.x / frame_.dx, -z.y / frame_.dy, 1.0)));
    }
    return out;
  }
  const glm::dvec2 lat = cos_sin_degrees(frame_.latitude(row));
  if (lat.x == 0.0) {
    out.assign(static_cast<size_t>(frame_.cols), pole(rows, row));
    return out;
  }
  const double per_col = 1.0 / (frame_.dlon * kRadiansPerDegree * lat.x),
               per_row = 1.0 / (frame_.dlat * kRadiansPerDegree);
  for (int64_t col = 0; col < frame_.cols; ++col) {
    const glm::dvec2 lon = lon_[static_cast<size_t>(col)];
    const double radius = frame_.radius + rows.at(row, col);
    const glm::dvec2 z = slope(rows, row, col) / radius;
    const glm::dvec3 up{lat.x * lon.x, lat.x * lon.y, lat.y}, east{-lon.y, lon.x, 0.0},
        north{-lat.y * lon.x, -lat.y * lon.y, lat.x};
    out.push_back(glm::normalize(up - z.x * per_col * east - z.y * per_row * north));
  }
  return out;
}

uint32_t Normals::texel(const glm::dvec3& normal) {
  uint32_t out = 255u << 24;
  for (int c = 0; c < 3; ++c) out |= static_cast<uint32_t>(std::lround(normal[c] * 127.0) + 127) << 8 * c;
  return out;
}

glm::dvec3 Normals::normal(uint32_t texel) {
  glm::dvec3 out;
  for (int c = 0; c < 3; ++c) out[c] = (static_cast<double>(texel >> 8 * c & 255u) - 127.0) / 127.0;
  return out;
}

std::vector<uint32_t> normal_texels(const Normals& normals, const HeightRows& rows, int64_t first,
                                    int64_t end) {
  std::vector<uint32_t> out(static_cast<size_t>((end - first) * rows.cols));
  parallel_for(end - first, 8, [&](int64_t begin, int64_t stop) {
    for (int64_t i = begin; i < stop; ++i) {
      uint32_t* to = out.data() + i * rows.cols;
      for (const glm::dvec3& normal : normals.row(rows, first + i)) *to++ = Normals::texel(normal);
    }
  });
  return out;
}

}  // namespace lodlab
