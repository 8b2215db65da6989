// SPDX-License-Identifier: MIT
// multigrain: what its files give to one another, and the store.
//   arrays: layout (chart_log2, levels, most_log2), nodes (Node), resolutions (Resolution), own and strips
//   (BlockErrors), of a planet also high, and fringe (the heights of its row) where there is one; meta:
//   bounds; pages: heights by tile (tiles.h; method/sample_code.h), the coverage mask, and, with maps, their
//   tiles (method/map_tiles.h) and an array each, colors and normals (finer_log2, side_log2).
#pragma once

#include "base/options.h"
#include "geometry/height_rows.h"
#include "methods/multigrain/hierarchy.h"
#include "methods/multigrain/layout.h"

namespace lodlab::multigrain {

enum PageKind : int { kHeights = 0, kCoverage = 1 };

/// The layout with these parameters over a frame.
Layout make_layout(const FieldFrame& frame, int chart_log2, int levels, int most_log2);

/// By the build options; what they leave open is chosen. InvalidInput names the value and its limit.
Layout choose_layout(const FieldFrame& frame, const Options& options);

/// The nodes of a layout, breadth first over all charts, without bounds; each offers all its resolutions.
std::vector<Node> make_nodes(const Layout& layout);

/// Of a planet's forest.
Occluder make_occluder(const Forest& forest);

/// Triangles of a grid: two a cell, one beside a pole; and of its fringe.
int64_t triangle_count(const Layout& layout, const Node& node, int resolution);

void build(const FieldSource& field, const Options& options, StoreWriter& writer, const Progress& progress);

}  // namespace lodlab::multigrain
