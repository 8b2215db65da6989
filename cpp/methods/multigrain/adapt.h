// SPDX-License-Identifier: MIT
// Adaptation (Niski, Purnomo, Cohen 2007, section 7.1): the cut of a forest, a resolution for each of its
// nodes, and the moves that change it. One file for each algorithm; METHOD.md proves that they end.
//
// The cut that the next frame starts from is the queues' own. What is drawn differs from it by the moves of
// adapt_drawn.cpp, which are taken back once the cut is handed out: so a still camera starts each frame
// alike.
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <vector>

#include "method/least_cut.h"
#include "method/projector.h"
#include "methods/multigrain/heap.h"
#include "methods/multigrain/hierarchy.h"
#include "methods/multigrain/paging.h"
#include "methods/multigrain/session.h"

namespace lodlab::multigrain {

class Adapter {
 public:
  /// The forest outlives it, and so does what says which of its heights are there; null: all of them.
  Adapter(const Forest& forest, Projection projection, Paging* paging = nullptr);

  /// Fills the nodes and figures of a claim; the caller says what it promises. Throws Unsupported for an
  /// algorithm that does not serve the budget.
  void select(Adapt adapt, const Camera& camera, const Budget& budget, Claim& claim);
  /// The next frame starts from the coarsest cut.
  void reset() {
    forget();
    last_level_ = Level{};
  }

 private:
  struct Spot {
    Projector::Place place;  ///< of this frame, when visible
    double rho = 0.0;        ///< projected own error at k, pixels; 0 when culled
    double theta = 0.0;      ///< trade(): pixels that the node and what it is split into may have
    double saved_theta = 0.0;
    int64_t saved = 0;  ///< by a split under `saved_theta` at `saved_k`, in frame `saved_in`
    uint32_t seen = 0;  ///< the frame of `place` and `visible`
    uint32_t saved_in = 0;
    uint32_t split_in = 0;    ///< the trade that split it
    uint32_t missing_in = 0;  ///< the frame in which it stands in for what is not there
    uint32_t kept_in = 0;     ///< the frame in which keep_parents() was here
    int8_t k = -1;            ///< resolution; -1: not on the cut
    int8_t most = 0;          ///< the finest one whose heights are there, in frame `seen`
    int8_t stride = 0;        ///< log2, at k
    int8_t saved_k = 0;
    int8_t merge_k = 0;  ///< resolution that a merge would give it
    int8_t more = 0;     ///< visible nodes that a split adds
    int8_t fewer = 0;    ///< visible nodes that a merge takes away
    uint8_t children_on = 0;
    bool visible = false, inside = false;  ///< its box seen, seen as a whole
    bool listed = false, owns = false;
  };
  struct Move {  ///< as it was before
    uint32_t node;
    int8_t k;  ///< -1: the node was not on the cut, its children were
    bool split;
    int8_t children[4];
  };
  struct Frame {
    const Camera* camera = nullptr;
    double target = 0.0;  ///< pixels at which refining stops
    int64_t triangles = std::numeric_limits<int64_t>::max(), nodes = std::numeric_limits<int64_t>::max();
    bool fits = true;  ///< a cut keeps them, and so does start_coarsest()'s
  };
  /// How far a cut is from what is wanted; the smaller the better, compared in this order.
  struct Score {
    double worst;  ///< largest projected error that more triangles or nodes could lower; 0: all within target
    int64_t triangles, active;
    auto operator<=>(const Score&) const = default;
  };

  // The cut and its moves: adapt.cpp
  void forget();
  void begin();
  void start_coarsest();
  bool coarsest_fits();
  const Node& node(uint32_t id) const { return forest_.node[id]; }
  Spot& look(uint32_t id);
  int stride(uint32_t id) const { return spot_[id].stride; }
  int most(uint32_t id) { return look(id).most; }
  /// Whether a node is drawn coarser than it could be if all heights were there.
  bool starved(uint32_t id) const { return spot_[id].k == spot_[id].most && spot_[id].k < node(id).most; }
  void set_resolution(uint32_t id, int k);
  double project(uint32_t id, int k) const;
  double allowed(uint32_t id, double pixels) const;
  int first_within(uint32_t id, double pixels);
  int64_t triangles(uint32_t id, int k) const { return forest_.at(node(id), k).triangles; }
  uint32_t fewest(uint32_t id, int k) const {
    return fewest_[node(id).first_resolution + static_cast<size_t>(k - node(id).least)];
  }
  void count_fewest();
  void put(uint32_t id, int k);
  void take(uint32_t id);
  void resolve(uint32_t id, int k);
  template <class Choose>
  void split(uint32_t id, Choose&& choose);
  void merge(uint32_t id, int k);
  void undo(size_t moves);
  void list_cut();
  Score score() const;

  // Splits against merges: adapt_dual.cpp
  void trade();
  bool pressed(uint32_t id, int k, double rho) const;
  void weigh_split(uint32_t id);
  int64_t fewest_below(uint32_t id, int k, double pixels);
  std::optional<Key> split_key(uint32_t id);
  std::optional<Key> merge_key(uint32_t id);
  void offer(uint32_t id);
  void trade_split(uint32_t id);
  void trade_merge(uint32_t id);
  bool exchange(uint32_t id);

  void select_topdown();
  void select_dual();

  // Resolutions against resolutions: adapt_quad.cpp
  void select_quad();
  void bring_up_resolution_queues();
  void queue_resolution(uint32_t id);
  void step(uint32_t id, int k);
  bool balance();
  bool swap_for(uint32_t id);
  void spend();

  // One level of error for all: adapt_level.cpp
  struct Level {          ///< of a frame, under this view and these budgets
    double level = 0.0;   ///< pixels; 0: none
    double down = 0.0;    ///< by how much to try a lower one next
    bool finest = false;  ///< all nodes show every sample
    glm::dvec3 eye{0.0}, forward{0.0};
    double K = 0.0;
    int64_t triangles = 0, nodes = 0;
    int64_t heights = 0;  ///< tiles that had come by then
    bool same_view(const Level& o) const {
      return eye == o.eye && forward == o.forward && K == o.K && triangles == o.triangles && nodes == o.nodes;
    }
  };
  double attempt(double level);
  double attempt_quad(double wanted);
  double drawn_worst() const;
  double own_worst() const;
  double first_level(double wanted);
  void select_level();

  // The optimum: adapt_exact.cpp
  void select_exact();

  // What is drawn: adapt_drawn.cpp
  void stitch_it();
  void draw_it();
  void own_blocks(uint32_t id);
  template <class Visit>
  void beside_coarser(uint32_t id, Visit&& visit) const;
  double drawn_error(uint32_t id) const;
  void stitch(double pixels);
  bool finer(uint32_t id, int wanted_stride);
  void write(const Budget& budget, Claim& claim);

  // What is there, and what is wanted: adapt_paging.cpp
  int finest_wanted(uint32_t id, double pixels) const;
  double worth(uint32_t id, int k);
  void keep_parents(uint32_t id);
  void page();

  const Forest& forest_;
  Projection projection_;
  Paging* paging_;
  Projector projector_;
  Horizon horizon_{0.0, glm::dvec3(0.0)};
  Frame frame_;
  uint32_t frames_ = 0, trades_ = 0;
  std::vector<Spot> spot_;
  std::vector<uint32_t> fewest_;         ///< beside Forest::resolution
  std::vector<uint32_t> cut_, scratch_;  ///< ids on the cut (and stale ones): sorted, then those added since
  size_t sorted_ = 0;
  std::vector<uint32_t> least_;  ///< nodes that the coarsest cut splits: where the roots break a budget
  LeastCut::Cost least_cost_;    ///< of it, then
  int64_t triangles_ = 0, nodes_ = 0, active_ = 0;  ///< of visible nodes; visible; on the cut
  int64_t steps_ = 0;
  std::vector<Move> moves_;
  size_t stitched_from_ = 0;  ///< moves from here on are taken back before the next frame
  Level last_level_;
  std::vector<uint32_t>
      changed_;  ///< while the resolution queues are up: nodes that they are to look at again
  bool queues_up_ = false;

  Heap split_, merge_, refine_, coarsen_;
  bool local_ = false;  ///< trade(): every node's own error is its threshold, not the target
  bool merges_ = true;  ///< trade(): false for top-down
  double level_ = 0.0;  ///< trade(): errors from which nodes that cannot be refined are split
  uint32_t blocked_ = kNone;
  std::vector<uint32_t> aside_, used_;  ///< exchange(), swap_for(): entries put aside, moves to make
  std::vector<Key> aside_keys_;

  std::vector<uint32_t> owner_;  ///< of each block: the node drawn there
  std::vector<uint32_t> drawn_, work_;
  struct Held {  ///< an edge of a node that waits for a neighbour's heights
    uint32_t node, neighbour;
    double rho;
  };
  std::vector<Held> held_;

  static constexpr uint32_t kNone = 0xffffffffu;
};

struct MultigrainSession::Adaptation : Adapter {
  using Adapter::Adapter;
};

/// Children take the resolutions that `choose` gives them.
template <class Choose>
void Adapter::split(uint32_t id, Choose&& choose) {
  const Node& n = node(id);
  moves_.push_back({id, spot_[id].k, true, {}});
  take(id);
  for (uint32_t c = n.first_child; c < n.first_child + n.children; ++c) put(c, choose(c));
}

}  // namespace lodlab::multigrain
