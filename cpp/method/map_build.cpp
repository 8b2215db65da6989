// SPDX-License-Identifier: MIT
#include "method/map_build.h"

#include <algorithm>
#include <cmath>

#include "base/parallel.h"
#include "imageio/image.h"
#include "method/sample_code.h"

namespace lodlab {
namespace {

constexpr int64_t kRowsAtOnce = 64;

/// Bilinear in the raster, whose pixels are centred at whole numbers.
uint32_t sample(const ImageU8& image, double x, double y, bool wraps) {
  y = std::clamp(y, 0.0, image.height - 1.0);
  if (!wraps) x = std::clamp(x, 0.0, image.width - 1.0);
  const double left = std::floor(x), top = std::floor(y);
  const double fx = x - left, fy = y - top;
  const auto column = [&](double at) {
    const auto i = static_cast<int64_t>(at);
    return wraps ? (i % image.width + image.width) % image.width : std::min<int64_t>(i, image.width - 1);
  };
  const int64_t x0 = column(left), x1 = column(left + 1), y0 = static_cast<int64_t>(top),
                y1 = std::min<int64_t>(y0 + 1, image.height - 1);
  uint32_t out = 0;
  for (int c = 0; c < 4; ++c) {
    const auto at = [&](int64_t j, int64_t i) {
      return static_cast<double>(image.samples[static_cast<size_t>((j * image.width + i) * 4 + c)]);
    };
    const double value =
        (1 - fy) * ((1 - fx) * at(y0, x0) + fx * at(y0, x1)) + fy * ((1 - fx) * at(y1, x0) + fx * at(y1, x1));
    out |= static_cast<uint32_t>(std::lround(value)) << 8 * c;
  }
  return out;
}

/// log2 of texels a sample: no fewer than the raster has.
int finer_log2(const ImageU8& image, const FieldFrame& frame) {
  const double finer = std::max(static_cast<double>(image.width) / static_cast<double>(frame.cols),
                                static_cast<double>(image.height) / static_cast<double>(frame.rows));
  return static_cast<int>(std::ceil(std::log2(finer)));
}

void put_shape(StoreWriter& writer, const char* name, const MapTiles& tiles) {
  writer.put_array(name, as_bytes(std::vector<int32_t>{tiles.finer_log2(), tiles.side_log2()}));
}

}  // namespace

MapWriter::MapWriter(MapKind kind, const FieldFrame& frame, const MapTiles& tiles, StoreWriter& writer)
    : kind_(kind), tiles_(tiles), writer_(writer) {
  for (int level = 0; level < tiles.levels(); ++level) {
    const int log2 = tiles.finer_log2() - level;
    const int64_t more = frame.wraps ? int64_t{2} * MapTiles::kBorder << (tiles.levels() - 1 - level) : 0;
    levels_.push_back({-more,
                       MapTiles::scaled(frame.cols, log2) + 2 * more,
                       MapTiles::scaled(frame.rows, log2),
                       0,
                       0,
                       0,
                       0,
                       {}});
  }
}

void MapWriter::take(size_t level, const std::vector<uint32_t>& texels) {
  Level& it = levels_[level];
  it.texels.insert(it.texels.end(), texels.begin(), texels.end());
  it.end += static_cast<int64_t>(texels.size()) / it.cols;
  const bool last = level + 1 == levels_.size();
  const std::vector<uint32_t> coarser = last ? std::vector<uint32_t>() : halve(level);
  const int index = static_cast<int>(level);
  const auto first_row = [&] { return (it.written << tiles_.side_log2()) - MapTiles::kBorder; };
  while (it.written < tiles_.down(index)) {
    const int64_t rows = tiles_.at(tiles_.id(index, it.written << tiles_.span_log2(index), 0)).rows;
    if (std::min(first_row() + rows, it.rows) > it.end) break;
    write_row(level);
    ++it.written;
  }
  int64_t needed = last ? it.end : std::min(it.end, 2 * it.halved);
  if (it.written < tiles_.down(index)) needed = std::min(needed, std::max<int64_t>(first_row(), 0));
  // Beyond the last row it is the last row again.
  needed = std::min(needed, it.rows - 1);
  if (needed > it.begin) {
    it.texels.erase(it.texels.begin(), it.texels.begin() + (needed - it.begin) * it.cols);
    it.begin = needed;
  }
  if (!coarser.empty()) take(level + 1, coarser);
}

/// The rows of the next level that can be made now.
std::vector<uint32_t> MapWriter::halve(size_t level) {
  Level& from = levels_[level];
  const Level& to = levels_[level + 1];
  // A level may have rows beyond the last pair: those that its ceiling rounds up to.
  int64_t end = from.halved;
  while (end < to.rows && std::min(2 * end + 1, from.rows - 1) < from.end) ++end;
  std::vector<uint32_t> out(static_cast<size_t>((end - from.halved) * to.cols));
  parallel_for(end - from.halved, 4, [&](int64_t begin, int64_t stop) {
    for (int64_t j = begin; j < stop; ++j) {
      const uint32_t *above = from.row(2 * (from.halved + j)), *below = from.row(2 * (from.halved + j) + 1);
      for (int64_t i = 0; i < to.cols; ++i) {
        const int64_t a = from.place(2 * (i + to.first_col)), b = from.place(2 * (i + to.first_col) + 1);
        out[static_cast<size_t>(j * to.cols + i)] = mean_texel(above[a], above[b], below[a], below[b]);
      }
    }
  });
  from.halved = end;
  return out;
}

void MapWriter::write_row(size_t level) {
  const Level& from = levels_[level];
  const int index = static_cast<int>(level);
  const int64_t first = tiles_.id(index, from.written << tiles_.span_log2(index), 0);
  parallel_for(tiles_.across(index), 1, [&](int64_t begin, int64_t end) {
    for (int64_t id = first + begin; id < first + end; ++id) {
      if (writer_.has_page(kind_, id)) continue;
      const MapTiles::Tile tile = tiles_.at(id);
      std::vector<uint32_t> texels;
      texels.reserve(static_cast<size_t>(tile.rows * tile.cols));
      for (int64_t y = 0; y < tile.rows; ++y) {
        const uint32_t* row = from.row(tile.row + y);
        for (int64_t x = 0; x < tile.cols; ++x) texels.push_back(row[from.place(tile.col + x)]);
      }
      writer_.put_page(kind_, id, encode_samples(texels.data(), static_cast<int64_t>(texels.size())));
    }
  });
}

void put_colors(const std::string& file, const FieldFrame& frame, const MapUser& user, StoreWriter& writer,
                const Progress& progress) {
  const ImageU8 image = read_rgba8(file);
  const int finer = finer_log2(image, frame);
  const MapTiles tiles = MapTiles::choose(frame, user, finer, "attribute " + file);
  MapWriter map(kColors, frame, tiles, writer);
  const double step_x =
      std::ldexp(static_cast<double>(image.width) / static_cast<double>(frame.cols), -finer);
  const double step_y =
      std::ldexp(static_cast<double>(image.height) / static_cast<double>(frame.rows), -finer);
  while (map.taken() < map.rows()) {
    const int64_t first = map.taken(), rows = std::min(kRowsAtOnce, map.rows() - first);
    std::vector<uint32_t> texels(static_cast<size_t>(rows * map.cols()));
    parallel_for(rows, 4, [&](int64_t begin, int64_t end) {
      for (int64_t j = begin; j < end; ++j) {
        const double y = (static_cast<double>(first + j) + 0.5) * step_y - 0.5;
        for (int64_t i = 0; i < map.cols(); ++i) {
          const double x = (static_cast<double>(i + map.first_col()) + 0.5) * step_x - 0.5;
          texels[static_cast<size_t>(j * map.cols() + i)] = sample(image, x, y, frame.wraps);
        }
      }
    });
    map.take(texels);
    if (progress) progress("colours", static_cast<double>(map.taken()) / static_cast<double>(map.rows()));
  }
  put_shape(writer, "colors", tiles);
}

NormalsWriter::NormalsWriter(const FieldFrame& frame, const MapUser& user, StoreWriter& writer)
    : normals_(frame), map_(kNormals, frame, MapTiles::choose(frame, user, 0, "normals"), writer) {
  put_shape(writer, "normals", MapTiles::choose(frame, user, 0, "normals"));
}

void NormalsWriter::take(const HeightRows& rows, int64_t end, const Progress& progress) {
  while (map_.taken() < end) {
    const int64_t first = map_.taken(), count = std::min(kRowsAtOnce, end - first);
    std::vector<uint32_t> texels = normal_texels(normals_, rows, first, first + count);
    if (map_.cols() != rows.cols) {  // on round the planet
      std::vector<uint32_t> round(static_cast<size_t>(count * map_.cols()));
      for (int64_t j = 0; j < count; ++j) {
        for (int64_t i = 0; i < map_.cols(); ++i) {
          const int64_t col = ((i + map_.first_col()) % rows.cols + rows.cols) % rows.cols;
          round[static_cast<size_t>(j * map_.cols() + i)] = texels[static_cast<size_t>(j * rows.cols + col)];
        }
      }
      texels.swap(round);
    }
    map_.take(texels);
    if (progress) progress("normals", static_cast<double>(map_.taken()) / static_cast<double>(map_.rows()));
  }
}

}  // namespace lodlab
