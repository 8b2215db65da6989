// SPDX-License-Identifier: MIT
// Cuts by hand, and the cuts that an audit draws.
#include <algorithm>
#include <limits>

#include "base/errors.h"
#include "method/hand_cut.h"
#include "methods/multigrain/session.h"

namespace lodlab::multigrain {
namespace {

/// Whether the nodes that are chosen (not 0) cover the source exactly once; InvalidInput says where they do
/// not. Ids rise with the level: a node is covered when an ancestor is chosen.
void check_covers(const Forest& forest, const std::vector<uint8_t>& chosen) {
  std::vector<uint8_t> covered(chosen.size(), 0);
  for (size_t i = 0; i < chosen.size(); ++i) {
    const Node& node = forest.node[i];
    const auto parent = static_cast<size_t>(node.parent);
    covered[i] = node.parent >= 0 && (covered[parent] != 0 || chosen[parent] != 0);
    if (chosen[i] != 0 && covered[i] != 0) {
      throw InvalidInput("cut: node " + std::to_string(i) + " overlaps an ancestor that is also given");
    }
    if (chosen[i] == 0 && covered[i] == 0 && node.children == 0) {
      throw InvalidInput("cut: gap: nothing given covers leaf node " + std::to_string(i) + " at row " +
                         std::to_string(node.row) + ", column " + std::to_string(node.col));
    }
  }
}

}  // namespace

Cut MultigrainSession::cut(const std::vector<int64_t>& ids, const std::vector<int32_t>& resolutions) const {
  const Forest& forest = *forest_;
  check_counts(ids, resolutions);
  std::vector<uint8_t> chosen(forest.node.size(), 0);  // its resolution, which is never 0
  for (size_t i = 0; i < ids.size(); ++i) {
    const size_t id = checked_node(ids[i], static_cast<int64_t>(chosen.size()));
    if (chosen[id] != 0) throw InvalidInput("cut: node " + std::to_string(id) + " is given twice");
    const Node& node = forest.node[id];
    const int32_t k = resolutions.empty() ? node.most : resolutions[i];
    if (k < node.least || k > node.most) {
      throw InvalidInput("cut: resolution " + std::to_string(k) + " of node " + std::to_string(id) +
                         " is not within " + std::to_string(node.least) + " to " + std::to_string(node.most));
    }
    chosen[id] = static_cast<uint8_t>(k);
  }
  check_covers(forest, chosen);
  Claim claim;
  claim.promises_bound = forest.store->meta("bounds") != "bilinear";
  StrideMap map(static_cast<size_t>(forest.layout.blocks_x() * forest.layout.blocks_y()));
  for (size_t i = 0; i < chosen.size(); ++i) {
    if (chosen[i] != 0) forest.mark(forest.node[i], chosen[i], map);
  }
  for (size_t i = 0; i < chosen.size(); ++i) {
    if (chosen[i] == 0) continue;
    const Node& node = forest.node[i];
    claim.nodes.push_back(
        {static_cast<uint32_t>(i), chosen[i], 1.0f, true, false, forest.drawn_error(node, chosen[i], map)});
    claim.triangles += forest.at(node, chosen[i]).triangles;
    ++claim.visible_nodes;
  }
  return cut_by_hand(std::move(claim));
}

/// Every level at every resolution; each node at each resolution among larger strides: those of the last
/// level among each other, all of them among the largest one that there is. Always both ways round, as on a
/// chessboard: all four neighbours of a square are of the other kind, but where an odd number goes round a
/// planet.
std::vector<Cut> MultigrainSession::audit_cuts() const {
  const Forest& forest = *forest_;
  const Layout& layout = forest.layout;
  std::vector<Cut> out;
  struct Kind {
    int level, resolution;
  };
  // Squares are the coarser level's nodes, all of the same size.
  const auto add = [&](const Kind(&kinds)[2]) {
    const int log2 = layout.node_log2(std::min(kinds[0].level, kinds[1].level));
    std::vector<int64_t> ids;
    std::vector<int32_t> resolutions;
    for (size_t i = 0; i < forest.node.size(); ++i) {
      const Node& node = forest.node[i];
      const Kind& kind = kinds[((node.row >> log2) + (node.col >> log2)) % 2];
      if (node.level != kind.level) continue;
      ids.push_back(static_cast<int64_t>(i));
      resolutions.push_back(
          std::min<int32_t>(kind.resolution, node.most));  // finest_error may have cut it short
    }
    out.push_back(cut(ids, resolutions));
  };
  const auto add_both = [&](const Kind& a, const Kind& b) {
    add({a, b});
    add({b, a});
  };
  for (int level = 0; level < layout.levels; ++level) {
    const int least = layout.least_resolution(level);
    for (int k = least; k <= layout.most_resolution(level); ++k) {
      add({{level, k}, {level, k}});
      if (level + 1 < layout.levels) {
        if (k > least) add_both({level, k}, {level, least});  // there the largest stride
        continue;
      }
      for (int coarser = least; coarser < k; ++coarser) add_both({level, k}, {level, coarser});
      if (level > 0) add_both({level, k}, {level - 1, layout.least_resolution(level - 1)});
    }
  }
  return out;
}

}  // namespace lodlab::multigrain
