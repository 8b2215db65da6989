// SPDX-License-Identifier: MIT
// Choosing a layout. By itself: about four by four charts, so that the roots of even the largest field are
// few and small enough to be drawn at any time.
#include "methods/multigrain/layout.h"

#include <bit>
#include <cmath>
#include <string>

#include "base/errors.h"
#include "geometry/angles.h"
#include "methods/multigrain/multigrain.h"

namespace lodlab::multigrain {
namespace {

constexpr int kLeastChart = 8, kMostChart = 12;  // log2 of cells a side, where the layout chooses

int log2_of(const Options& options, const char* name) {
  const int64_t value = options.integer(name);
  if (!std::has_single_bit(static_cast<uint64_t>(value))) {
    throw InvalidInput("multigrain: option " + std::string(name) + " = " + std::to_string(value) +
                       " is not a power of two");
  }
  return std::countr_zero(static_cast<uint64_t>(value));
}

bool is_pole(const FieldFrame& frame, int64_t row) {
  return frame.planet && std::abs(frame.latitude(row)) == 90.0;
}

/// log2 of the largest block of a planet. Two limits: no stride spans more than 90 degrees; and the great
/// circle through two samples of one row is a row away from theirs at most where a finer neighbour's
/// triangles have their tip after snapping, half a block and half a cell from the middle of their base, or
/// they turn over: of a block of 2 m cells m (m + 1) dlon^2 / 4 radians away at most.
int largest_block(const FieldFrame& frame) {
  const double quarter = 90.0 / std::max(frame.dlon, frame.dlat);
  const double dlat = frame.dlat * kRadiansPerDegree, dlon = frame.dlon * kRadiansPerDegree;
  const double flat = std::sqrt(1.0 + 16.0 * dlat / (dlon * dlon)) - 1.0;
  return static_cast<int>(std::floor(std::log2(std::max(1.0, std::min(quarter, flat)))));
}

}  // namespace

Layout make_layout(const FieldFrame& frame, int chart_log2, int levels, int most_log2) {
  Layout layout;
  layout.rows = frame.rows;
  layout.cols = frame.cols;
  layout.wraps = frame.wraps;
  layout.pole_first = is_pole(frame, 0);
  layout.pole_last = is_pole(frame, frame.rows - 1);
  layout.fringe_first = frame.planet && !layout.pole_first && frame.latitude(0) < 0.0;
  layout.fringe_last = frame.planet && !layout.pole_last && frame.latitude(frame.rows - 1) > 0.0;
  layout.chart_log2 = chart_log2;
  layout.levels = levels;
  layout.most_log2 = most_log2;
  return layout;
}

Layout choose_layout(const FieldFrame& frame, const Options& options) {
  const int most_log2 = log2_of(options, "node_resolution");
  const auto cells =
      static_cast<uint64_t>(std::max(frame.wraps ? frame.cols : frame.cols - 1, frame.rows - 1));
  const int whole = std::max(1, static_cast<int>(std::bit_width(cells - 1)));  // one chart holds all
  const int block = frame.planet ? largest_block(frame) : most_log2;
  // A planet whose strides cannot double has one level.
  const auto given = static_cast<int>(options.integer("levels"));
  const int wanted = block == 0 ? 1 : std::min(given > 0 ? given : frame.planet ? 6 : 5, most_log2 + 1);
  const bool automatic = options.integer("chart") == 0;
  int chart = automatic ? static_cast<int>(std::lround(std::log2(static_cast<double>(cells) / 4.0)))
                        : log2_of(options, "chart");
  if (automatic) {
    chart = std::min(std::clamp(chart, kLeastChart, kMostChart), whole);
    chart = std::min(chart, std::clamp(block, 1, most_log2) + wanted - 1);
  }
  if (chart == 0) throw InvalidInput("multigrain: option chart = 1 is below the limit of 2 cells a side");
  const int levels = std::min(wanted, chart);  // blocks of at least two cells
  const Layout layout = make_layout(frame, chart, levels, most_log2);
  const auto refuse = [&](const std::string& why, int limit) {
    throw InvalidInput("multigrain: option chart = " + std::to_string(options.integer("chart")) + " makes " +
                       why + "; with levels = " + std::to_string(levels) +
                       " the limit is chart = " + std::to_string(int64_t{1} << limit));
  };
  if (layout.block_log2() > most_log2) {
    refuse("nodes of the last level of " + std::to_string(1 << layout.block_log2()) +
               " cells a side, more than node_resolution = " + std::to_string(1 << most_log2),
           most_log2 + levels - 1);
  }
  if (frame.planet && layout.block_log2() > std::max(block, 1)) {
    refuse("strides of " + std::to_string(1 << layout.block_log2()) +
               " samples, which bend too far from this planet's rows",
           std::max(block, 1) + levels - 1);
  }
  return layout;
}

}  // namespace lodlab::multigrain
