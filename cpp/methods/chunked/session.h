// SPDX-License-Identifier: MIT
// A session on a chunk tree: selection (select.cpp), residency and drawing (draw.cpp).
//
// Streaming keeps one invariant: a resident node's parent is resident. A node is refined only when all its
// children are; so a parent stands in until then, and no frame waits.
#pragma once

#include <memory>
#include <vector>

#include "method/least_cut.h"
#include "method/projector.h"
#include "methods/chunked/hierarchy.h"
#include "methods/chunked/residency.h"

namespace lodlab::chunked {

enum class Morph { kBudget, kFormula4, kNone };

class ChunkedSession : public Session {
 public:
  ChunkedSession(std::shared_ptr<const ChunkedHierarchy> hierarchy, const Options& options);
  ~ChunkedSession() override;

  Cut select(const Request& request) override;
  Cut cut(const std::vector<int64_t>& nodes, const std::vector<int32_t>& resolutions) const override;
  std::vector<Cut> audit_cuts() const override;
  void draw(const Cut& cut, render::Pass& pass) override;
  int64_t resident_bytes() const override;
  void settle() override;

 private:
  ChunkedSession(std::shared_ptr<const ChunkedHierarchy> hierarchy, const Options& options, Plan plan);
  struct Candidate {
    double rho;
    uint32_t node;
  };
  void select_top_down(const Camera& camera, const Projector& projector, double tau, Claim& claim);
  void select_by_priority(const Camera& camera, const Projector& projector, const LeastCut::Limits& limits,
                          double target, Claim& claim);
  void find_least(const Camera& camera, const LeastCut::Limits& limits, Claim& claim);
  void want_least(const std::vector<uint32_t>& split);
  void finish(const Projector& projector, const Budget& budget, Claim& claim) const;
  void request_children(const Claim& claim, const Projector& projector);
  /// The bound of a node drawn with this morph weight: between its own and its parent's, and what floats
  /// round.
  double drawn_error(const Node& node, float morph) const {
    const double mixed = node.error + (1.0 - static_cast<double>(morph)) * (node.parent_error - node.error);
    return morph > 0.0f && morph < 1.0f ? mixed + hierarchy_->quantizer.rounding() : mixed;
  }
  int64_t submitted_triangles(const Node& node) const {
    return (skirts_ ? node.indices : node.surface_indices) / 3;
  }
  bool refinable(uint32_t node);
  bool add(const CutNode& picked, render::Pass& pass);
  void admit_wanted(render::Submitted& submitted);

  std::shared_ptr<const ChunkedHierarchy> hierarchy_;
  Projection projection_;
  Morph morph_;
  bool skirts_;
  Residency residency_;
  int64_t most_pieces_;
  std::vector<uint32_t> queue_;
  std::vector<Candidate> heap_;
  std::vector<CutNode> picked_;
  std::vector<uint32_t> split_;  // by the cheapest cut, where the roots are over a hard budget
  std::vector<uint32_t> held_;   // that it would split if all were there, where a budget waits for that
  std::vector<Residency::Want> wants_;  // of a frame

  struct Gpu;  // GL objects: draw.cpp
  std::unique_ptr<Gpu> gpu_;
};

}  // namespace lodlab::chunked
