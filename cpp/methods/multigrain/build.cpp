// SPDX-License-Identifier: MIT
// Build of multigrain: errors by block, the forest over them, and the heights as tiles. No GL.
//
// A field in memory is one band. A windowed one goes by in bands as high as a tile of stride 1: the blocks of
// a band are measured, and tiles of coarser strides gather their rows from band to band until they are whole.
// What is kept is a band, one row of tiles for each stride, and the errors.
#include <algorithm>
#include <optional>

#include "base/errors.h"
#include "base/parallel.h"
#include "method/map_build.h"
#include "method/maps_option.h"
#include "method/sample_code.h"
#include "methods/multigrain/measure.h"
#include "methods/multigrain/multigrain.h"
#include "methods/multigrain/squares.h"
#include "methods/multigrain/tiles.h"

namespace lodlab::multigrain {
namespace {

/// For each block the log2 of the finest stride that is worth keeping: the coarsest one whose error is within
/// `finest_error`, made finer where a neighbour snapped to it would leave that.
std::vector<uint8_t> finest_strides(const Layout& layout, const BlockErrors& errors, double finest_error) {
  const int64_t pitch = layout.blocks_x(), blocks = pitch * layout.blocks_y();
  std::vector<uint8_t> finest(static_cast<size_t>(blocks), 0);
  if (!(finest_error > 0.0)) return finest;
  const int coarsest = layout.block_log2() - 1;  // nodes of the last level have at least two cells a side
  for (int64_t i = 0; i < blocks; ++i) {
    int a = coarsest;
    while (a > 0 && errors.own_error(i, a) > finest_error) --a;
    finest[static_cast<size_t>(i)] = static_cast<uint8_t>(a);
  }
  // Strides only become finer, so this ends; where all are 0 nothing is snapped.
  for (bool changed = true; changed;) {
    changed = false;
    for (int64_t i = 0; i < blocks; ++i) {
      const BlockAt at{static_cast<int>(i % pitch), static_cast<int>(i / pitch)};
      const int a = finest[static_cast<size_t>(i)];
      for (const Edge edge : {kNorth, kEast, kSouth, kWest}) {
        const BlockAt across = layout.across(at, edge);
        if (across.x < 0) continue;
        uint8_t& b = finest[static_cast<size_t>(across.y * pitch + across.x)];
        while (b > a && errors.strip_error(i, edge, a, b) > finest_error) {
          --b;
          changed = true;
        }
      }
    }
  }
  return finest;
}

Box block_box(const HeightRows& field, const Layout& layout, const BlockErrors& errors, int64_t block) {
  const int log2 = layout.block_log2();
  const int64_t row = block / layout.blocks_x() << log2, col = block % layout.blocks_x() << log2;
  const int64_t last_row = row + layout.cells_y(row, log2, 0), last_col = col + layout.cells_x(col, log2, 0);
  Box box;
  if (!field.planet) {
    box.add(field.position(row, col, errors.low[static_cast<size_t>(block)]));
    box.add(field.position(last_row, last_col, errors.high[static_cast<size_t>(block)]));
    return box;
  }
  std::vector<glm::dvec2> lon;
  for (int64_t c = col; c <= last_col; ++c) lon.push_back(cos_sin_degrees(field.longitude(c)));
  for (int64_t r = row; r <= last_row; ++r) {
    const glm::dvec2 lat = cos_sin_degrees(field.latitude(r));
    const bool pole = (layout.pole_first && r == 0) || (layout.pole_last && r == layout.last_row());
    for (int64_t c = col; c <= last_col; ++c) {
      const double radius = field.radius + field.at(r, pole || c == field.cols ? 0 : c);
      const glm::dvec2 at = lon[static_cast<size_t>(c - col)];
      box.add(radius * glm::dvec3(lat.x * at.x, lat.x * at.y, lat.y));
    }
  }
  return box;
}

/// Bounds, errors and finest resolutions of all nodes, from those of their blocks.
struct ForestBuilder {
  const Layout& layout;
  const BlockErrors& errors;
  const std::vector<Box>& boxes;  ///< of blocks
  std::vector<Node> nodes;
  std::vector<Resolution> resolutions;

  void fill(const std::vector<uint8_t>& finest);

 private:
  template <class Visit>
  void for_blocks(const Node& n, const Visit& visit) const {
    const int log2 = layout.block_log2(), size = layout.node_log2(n.level);
    const int64_t y0 = n.row >> log2, x0 = n.col >> log2;
    const int64_t y1 = y0 + layout.cells_y(n.row, size, log2), x1 = x0 + layout.cells_x(n.col, size, log2);
    for (int64_t y = y0; y < y1; ++y) {
      for (int64_t x = x0; x < x1; ++x) visit(y * layout.blocks_x() + x);
    }
  }
};

void ForestBuilder::fill(const std::vector<uint8_t>& finest) {
  nodes = make_nodes(layout);
  for (Node& n : nodes) {
    Box box;
    int stride = layout.block_log2();
    for_blocks(n, [&](int64_t block) {
      box.add(boxes[static_cast<size_t>(block)]);
      stride = std::min<int>(stride, finest[static_cast<size_t>(block)]);
    });
    for (int i = 0; i < 3; ++i) {
      n.lo[i] = box.lo[i];
      n.hi[i] = box.hi[i];
    }
    n.first_resolution = static_cast<uint32_t>(resolutions.size());
    n.most = static_cast<uint8_t>(std::clamp<int>(layout.node_log2(n.level) - stride, n.least, n.most));
    for (int k = n.least; k <= n.most; ++k) {
      float error = 0.0f;
      const int a = layout.stride_log2(n.level, k);
      for_blocks(n, [&](int64_t block) { error = std::max(error, errors.own_error(block, a)); });
      resolutions.push_back({error, static_cast<uint32_t>(triangle_count(layout, n, k))});
    }
  }
}

/// The tiles that any node draws from.
std::vector<int64_t> drawn_tiles(const Layout& layout, const Tiles& tiles, const std::vector<Node>& nodes) {
  std::vector<uint8_t> drawn(static_cast<size_t>(tiles.count()), 0);
  for (const Node& n : nodes) {
    for (int k = n.least; k <= n.most; ++k)
      drawn[static_cast<size_t>(tiles.id(layout.stride_log2(n.level, k), n.row, n.col))] = 1;
  }
  std::vector<int64_t> ids;
  for (int64_t i = 0; i < tiles.count(); ++i) {
    if (drawn[static_cast<size_t>(i)] != 0) ids.push_back(i);
  }
  return ids;
}

/// Tiles on their way to the store: each gathers its rows from the bands that go by.
class TileWriter {
 public:
  TileWriter(const Tiles& tiles, std::vector<int64_t> ids, StoreWriter& writer)
      : tiles_(tiles), ids_(std::move(ids)), heights_(ids_.size()), writer_(writer) {}

  /// Takes what its tiles need of rows [first, end] of the band, whose last one the next band has too.
  void take(const HeightRows& band, int64_t first, int64_t end, const Progress& progress) {
    std::vector<size_t> met;
    for (size_t i = 0; i < ids_.size(); ++i) {
      const Tile tile = tiles_.at(ids_[i]);
      if (tile.row < end && last_row(tile) > first && !writer_.has_page(kHeights, ids_[i])) met.push_back(i);
    }
    Count done(progress, "heights", static_cast<int64_t>(met.size()));
    parallel_for(static_cast<int64_t>(met.size()), 1, [&](int64_t from, int64_t to) {
      for (int64_t i = from; i < to; ++i) take(band, met[static_cast<size_t>(i)]);
      done(to - from);
    });
  }

 private:
  int64_t last_row(const Tile& tile) const { return tiles_.source_row(tile, tile.rows - 1); }

  void take(const HeightRows& band, size_t i) {
    const Tile tile = tiles_.at(ids_[i]);
    std::vector<float>& heights = heights_[i];
    heights.resize(static_cast<size_t>(tile.samples()));
    tiles_.fill(band, tile, heights.data());
    if (last_row(tile) >= band.end_row) return;
    writer_.put_page(kHeights, ids_[i], encode_samples(heights.data(), tile.samples()));
    std::vector<float>().swap(heights);
  }

  const Tiles& tiles_;
  std::vector<int64_t> ids_;
  std::vector<std::vector<float>> heights_;  ///< of those that are under way
  StoreWriter& writer_;
};

/// What one step of a build works on: rows [first, end] with their blocks, and what these need beyond.
struct Step {
  int64_t first, end;  ///< rows; the last one is the first of the next step
  int64_t first_block, end_block;
  int64_t above, below;  ///< rows that are needed, [above, below)
};

std::vector<Step> steps_of(const FieldSource& field, const Layout& layout, int side_log2) {
  const int64_t pitch = layout.blocks_x(), blocks = pitch * layout.blocks_y();
  if (field.whole() != nullptr) return {{0, layout.last_row(), 0, blocks, 0, layout.rows}};
  const int64_t per_step = int64_t{1} << (side_log2 - layout.block_log2());
  std::vector<Step> steps;
  for (int64_t y = 0; y < layout.blocks_y(); y += per_step) {
    const int64_t next = std::min(y + per_step, layout.blocks_y());
    Step step{y << layout.block_log2(),
              std::min(next << layout.block_log2(), layout.last_row()),
              y * pitch,
              next * pitch,
              layout.rows,
              0};
    for (int64_t i = y; i < next; ++i) {
      const Block block(layout, i * pitch);  // none is wider
      const Reach beyond = rows_beyond(field, block);
      step.above = std::min(step.above, block.row - beyond.above);
      step.below = std::max(step.below, block.row + block.height + beyond.below + 1);
    }
    steps.push_back(step);
  }
  return steps;
}

/// Reports work that goes from one share of the whole to another.
Progress part_of(const Progress& progress, double from, double to) {
  return [&progress, from, to](const std::string& stage, double share) {
    if (progress) progress(stage, from + share * (to - from));
  };
}

}  // namespace

void build(const FieldSource& field, const Options& options, StoreWriter& writer, const Progress& progress) {
  const Layout layout = choose_layout(field, options);
  const Bounds bounds = options.text("bounds") == "drawn" ? Bounds::kDrawn : Bounds::kBilinear;
  const double finest_error = options.real("finest_error");
  const std::string& attribute = options.text("attribute");
  if (!attribute.empty()) put_colors(attribute, field, map_user(layout), writer, progress);
  const Tiles tiles(layout);
  std::vector<Step> steps = steps_of(field, layout, tiles.side_log2());
  std::optional<NormalsWriter> normals;
  if (has_normals(options)) {
    normals.emplace(field, map_user(layout), writer);
    for (Step& step : steps) step.above = std::min(step.above, normals->normals().first_needed(step.first));
  }
  const double half = 0.5 / static_cast<double>(steps.size());
  // Where grids are left out, what is drawn is known once everything is measured: rows are read twice.
  const bool at_once = !(finest_error > 0.0);
  TileWriter all(tiles, at_once ? drawn_tiles(layout, tiles, make_nodes(layout)) : std::vector<int64_t>(),
                 writer);
  BlockErrors errors = no_errors(layout);
  std::vector<Box> boxes(errors.low.size());
  std::vector<float> fringe;
  RowBuffer buffer;
  double share = 0.0;
  const auto next_part = [&] {
    share += half;
    return part_of(progress, share - half, share);
  };
  for (const Step& step : steps) {
    const HeightRows rows = field.read(step.above, step.below, buffer);
    measure_errors(rows, layout, bounds, step.first_block, step.end_block, errors, next_part());
    parallel_for(step.end_block - step.first_block, 16, [&](int64_t begin, int64_t end) {
      for (int64_t i = step.first_block + begin; i < step.first_block + end; ++i)
        boxes[static_cast<size_t>(i)] = block_box(rows, layout, errors, i);
    });
    const int64_t border = layout.fringe_row();
    if (border >= step.first && border <= step.end && fringe.empty())
      fringe.assign(rows.row(border), rows.row(border) + layout.cols);
    if (normals) normals->take(rows, step.end < layout.last_row() ? step.end : layout.rows, progress);
    if (at_once) all.take(rows, step.first, step.end, next_part());
  }
  ForestBuilder forest{layout, errors, boxes, {}, {}};
  forest.fill(finest_strides(layout, errors, finest_error));
  if (!at_once) {
    TileWriter drawn(tiles, drawn_tiles(layout, tiles, forest.nodes), writer);
    for (const Step& step : steps)
      drawn.take(field.read(step.first, step.end + 1, buffer), step.first, step.end, next_part());
  }
  const Bytes coverage = field.coverage();
  if (!coverage.empty() && !writer.has_page(kCoverage, 0)) writer.put_page(kCoverage, 0, coverage);
  writer.put_array("layout",
                   as_bytes(std::vector<int32_t>{layout.chart_log2, layout.levels, layout.most_log2}));
  writer.put_array("nodes", as_bytes(forest.nodes));
  writer.put_array("resolutions", as_bytes(forest.resolutions));
  writer.put_array("own", as_bytes(errors.own));
  writer.put_array("strips", as_bytes(errors.strips));
  if (field.planet) writer.put_array("high", as_bytes(errors.high));
  if (!fringe.empty()) writer.put_array("fringe", as_bytes(fringe));
  writer.put_meta("bounds", options.text("bounds"));
}

}  // namespace lodlab::multigrain
