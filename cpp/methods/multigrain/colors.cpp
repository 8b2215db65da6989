// SPDX-License-Identifier: MIT
// The pyramid of colours: its build, its pages, and the level that a view needs. No GL.
#include "methods/multigrain/colors.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <mutex>
#include <numbers>

#include "base/errors.h"
#include "base/parallel.h"
#include "imageio/image.h"
#include "method/sample_code.h"
#include "methods/multigrain/multigrain.h"

namespace lodlab::multigrain {
namespace {

uint32_t mean(uint32_t a, uint32_t b, uint32_t c, uint32_t d) {
  uint32_t out = 0;
  for (int shift = 0; shift < 32; shift += 8) {
    const auto channel = [shift](uint32_t texel) { return texel >> shift & 255u; };
    out |= (channel(a) + channel(b) + channel(c) + channel(d) + 2) / 4 << shift;
  }
  return out;
}

/// One level: `cols` x `rows` texels from column `first_col` on; beyond them the last ones again.
struct Level {
  int64_t first_col, cols, rows;
  std::vector<uint32_t> texels;

  uint32_t at(int64_t row, int64_t col) const {
    row = std::clamp<int64_t>(row, 0, rows - 1);
    col = std::clamp<int64_t>(col - first_col, 0, cols - 1);
    return texels[static_cast<size_t>(row * cols + col)];
  }
};

/// ceil(count * 2^log2)
int64_t scaled(int64_t count, int log2) {
  return log2 >= 0 ? count << log2 : (count + (int64_t{1} << -log2) - 1) >> -log2;
}

/// An empty level. Where columns wrap, it goes on round the planet on both sides, as far as coarser levels
/// look.
Level make_level(const FieldFrame& frame, const ColorTiles& tiles, int level) {
  const int log2 = tiles.finer_log2() - level;
  const int64_t more = frame.wraps ? int64_t{2} * ColorTiles::kBorder << (tiles.levels() - 1 - level) : 0;
  Level out{-more, scaled(frame.cols, log2) + 2 * more, scaled(frame.rows, log2), {}};
  out.texels.resize(static_cast<size_t>(out.cols * out.rows));
  return out;
}

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

Level finest(const ImageU8& image, const FieldFrame& frame, const ColorTiles& tiles) {
  Level out = make_level(frame, tiles, 0);
  const double step_x =
      std::ldexp(static_cast<double>(image.width) / static_cast<double>(frame.cols), -tiles.finer_log2());
  const double step_y =
      std::ldexp(static_cast<double>(image.height) / static_cast<double>(frame.rows), -tiles.finer_log2());
  parallel_for(out.rows, 16, [&](int64_t begin, int64_t end) {
    for (int64_t j = begin; j < end; ++j) {
      const double y = (static_cast<double>(j) + 0.5) * step_y - 0.5;
      for (int64_t i = 0; i < out.cols; ++i) {
        const double x = (static_cast<double>(i + out.first_col) + 0.5) * step_x - 0.5;
        out.texels[static_cast<size_t>(j * out.cols + i)] = sample(image, x, y, frame.wraps);
      }
    }
  });
  return out;
}

Level coarser(const Level& finer, const FieldFrame& frame, const ColorTiles& tiles, int level) {
  Level out = make_level(frame, tiles, level);
  parallel_for(out.rows, 16, [&](int64_t begin, int64_t end) {
    for (int64_t j = begin; j < end; ++j) {
      for (int64_t i = 0; i < out.cols; ++i) {
        const int64_t x = 2 * (i + out.first_col), y = 2 * j;
        out.texels[static_cast<size_t>(j * out.cols + i)] =
            mean(finer.at(y, x), finer.at(y, x + 1), finer.at(y + 1, x), finer.at(y + 1, x + 1));
      }
    }
  });
  return out;
}

ColorTiles choose_tiles(const std::string& file, const ImageU8& image, const FieldFrame& frame,
                        const Layout& layout) {
  const double finer = std::max(static_cast<double>(image.width) / static_cast<double>(frame.cols),
                                static_cast<double>(image.height) / static_cast<double>(frame.rows));
  const int finer_log2 = static_cast<int>(std::ceil(std::log2(finer)));
  const int block = layout.block_log2() + finer_log2;
  if (block > ColorTiles::kMostLog2) {
    throw InvalidInput("multigrain: attribute " + file + ": a node of the last level has 2^" +
                       std::to_string(block) + " texels a side, more than " +
                       std::to_string(1 << ColorTiles::kMostLog2) + "; take more levels or smaller charts");
  }
  return {layout, finer_log2, std::max(block, ColorTiles::kLeastLog2)};
}

}  // namespace

ColorTiles::ColorTiles(const Layout& layout, int finer_log2, int side_log2)
    : layout_(layout), finer_log2_(finer_log2), side_log2_(side_log2), first_{0} {
  for (int level = 0;; ++level) {
    const int64_t here = across(level) * down(level);
    first_.push_back(first_.back() + here);
    if (here == 1) return;
  }
}

ColorTiles::Tile ColorTiles::at(int64_t id) const {
  const auto next = std::upper_bound(first_.begin(), first_.end(), id);
  const int level = static_cast<int>(next - first_.begin()) - 1;
  const int64_t place = id - *(next - 1);
  const int64_t row = (place / across(level) << side_log2_) - kBorder,
                col = (place % across(level) << side_log2_) - kBorder;
  // As far as the last sample's texel and a border behind it, in whole texels of the coarsest mip level.
  const auto length = [&](int64_t first, int64_t last) {
    const int64_t needed = scaled(last + 1, finer_log2_ - level) + kBorder - first;
    return std::min(pitch(), (needed + kBorder - 1) / kBorder * kBorder);
  };
  return {level, row, col, length(row, layout_.last_row()), length(col, layout_.last_col())};
}

std::vector<uint32_t> half_colors(const std::vector<uint32_t>& texels, int64_t cols, int64_t rows) {
  std::vector<uint32_t> out(texels.size() / 4);
  auto to = out.begin();
  for (int64_t j = 0; j < rows; j += 2) {
    const uint32_t *above = texels.data() + j * cols, *below = above + cols;
    for (int64_t i = 0; i < cols; i += 2) *to++ = mean(above[i], above[i + 1], below[i], below[i + 1]);
  }
  return out;
}

void put_colors(const std::string& file, const FieldFrame& frame, const Layout& layout, StoreWriter& writer,
                const Progress& progress) {
  const ImageU8 image = read_rgba8(file);
  const ColorTiles tiles = choose_tiles(file, image, frame, layout);
  std::atomic<int64_t> done = 0;
  std::mutex mutex;
  Level level = finest(image, frame, tiles);
  int64_t id = 0;
  for (int l = 0; l < tiles.levels(); ++l) {
    if (l > 0) level = coarser(level, frame, tiles, l);
    int64_t end_id = id;
    while (end_id < tiles.count() && tiles.at(end_id).level == l) ++end_id;
    parallel_for(end_id - id, 1, [&](int64_t begin, int64_t end) {
      for (int64_t i = id + begin; i < id + end; ++i) {
        if (writer.has_page(kColors, i)) continue;
        const ColorTiles::Tile tile = tiles.at(i);
        std::vector<uint32_t> texels;
        texels.reserve(static_cast<size_t>(tile.rows * tile.cols));
        for (int64_t y = 0; y < tile.rows; ++y) {
          for (int64_t x = 0; x < tile.cols; ++x) texels.push_back(level.at(tile.row + y, tile.col + x));
        }
        writer.put_page(kColors, i, encode_samples(texels.data(), static_cast<int64_t>(texels.size())));
      }
      const int64_t so_far = done += end - begin;
      const std::lock_guard lock(mutex);
      if (progress) progress("colours", static_cast<double>(so_far) / static_cast<double>(tiles.count()));
    });
    id = end_id;
  }
  writer.put_array("colors", as_bytes(std::vector<int32_t>{tiles.finer_log2(), tiles.side_log2()}));
}

namespace {

ColorTiles stored_tiles(const Forest& forest) {
  const std::vector<int32_t> shape = forest.store->array_of<int32_t>("colors");
  const bool known = shape.size() == 2 && shape[1] >= ColorTiles::kLeastLog2 &&
                     shape[1] <= ColorTiles::kMostLog2 && forest.layout.block_log2() + shape[0] <= shape[1] &&
                     shape[0] > -32;
  if (!known) throw StoreError("multigrain: " + forest.store->path() + " does not say how its colours lie");
  return {forest.layout, shape[0], shape[1]};
}

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

bool Colors::in(const Store& store) { return store.has_page(kColors, 0); }

Colors::Colors(const Forest& forest) : forest_(forest), tiles_(stored_tiles(forest)) {}

std::vector<uint32_t> Colors::tile(int64_t id) const {
  const ColorTiles::Tile tile = tiles_.at(id);
  std::vector<uint32_t> texels(static_cast<size_t>(tile.rows * tile.cols));
  decode_samples(forest_.store->page(kColors, id), texels.data(), static_cast<int64_t>(texels.size()));
  return texels;
}

int Colors::wanted_level(const Node& node, const Box& box, const Camera& camera,
                         double texels_per_pixel) const {
  const double texel = std::ldexp(sample_length(forest_.frame, forest_.layout, node), -tiles_.finer_log2());
  const double coarser = pixel_length(box, camera) / (texel * texels_per_pixel);
  if (!(coarser > 1.0)) return 0;
  return std::min(static_cast<int>(std::min(std::log2(coarser), 62.0)), tiles_.levels() - 1);
}

Patch Colors::patch(const Node& node, int level) const {
  const int64_t id = tiles_.id(level, node.row, node.col);
  const ColorTiles::Tile tile = tiles_.at(id);
  const double texels = std::ldexp(1.0, tiles_.finer_log2() - level);  // a sample
  const auto pitch = static_cast<double>(tiles_.pitch());
  const auto place = [&](int32_t sample, int64_t first) {
    return static_cast<float>(((sample + 0.5) * texels - static_cast<double>(first)) / pitch);
  };
  return {node.row,
          node.col,
          forest_.layout.node_log2(node.level),
          id,
          place(node.col, tile.col),
          place(node.row, tile.row),
          static_cast<float>(texels / pitch)};
}

void Colors::patches(uint32_t id, int stride_log2, const Camera& camera, double texels_per_pixel,
                     std::vector<Patch>& out) const {
  const Node& node = forest_.node[id];
  const int size = forest_.layout.node_log2(node.level);
  const Box box = box_of(node);
  if (!camera.sees(box)) {
    out.push_back({node.row, node.col, size, -1});
    return;
  }
  const int wanted = wanted_level(node, box, camera, texels_per_pixel);
  const int fits = std::clamp(size + tiles_.finer_log2() - tiles_.side_log2(), 0, tiles_.levels() - 1);
  // A patch has at least two cells a side, as nodes have.
  if (wanted >= fits || node.children == 0 || size - 1 <= stride_log2) {
    out.push_back(patch(node, std::max(wanted, fits)));
    return;
  }
  for (uint32_t child = node.first_child; child < node.first_child + node.children; ++child)
    patches(child, stride_log2, camera, texels_per_pixel, out);
}

}  // namespace lodlab::multigrain
