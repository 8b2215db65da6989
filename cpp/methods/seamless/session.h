// SPDX-License-Identifier: MIT
// A session on a hierarchy of patches: selection (select.cpp), cuts by hand (cut.cpp), drawing (draw.cpp).
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "method/projector.h"
#include "methods/seamless/hierarchy.h"
#include "methods/seamless/selector.h"

namespace lodlab {
class MapPaging;
}

namespace lodlab::seamless {

class Paging;

class SeamlessSession : public Session {
 public:
  SeamlessSession(std::shared_ptr<const Hierarchy> hierarchy, const Options& options);
  ~SeamlessSession() override;

  Cut select(const Request& request) override;
  Cut cut(const std::vector<int64_t>& nodes, const std::vector<int32_t>& resolutions) const override;
  std::vector<Cut> audit_cuts() const override;
  std::optional<Cut> random_cut(uint64_t seed) const override;
  void draw(const Cut& cut, render::Pass& pass) override;
  std::vector<std::string> warnings() const override;
  int64_t resident_bytes() const override;
  void settle() override;

 private:
  struct Gpu;  // draw.cpp: GL objects

  bool promises_bound() const {
    return metric_.roughness && projection_ != Projection::kPaper && !hierarchy_->averaged();
  }
  /// A precision, and whether it keeps the hard budgets.
  Selector::Cheapest asked_for(Selector& selector, const Budget& budget,
                               const Selector::Limits& limits) const;
  double stand_in(Selector& selector, const Selector::Limits& limits, const Selector::Cheapest& asked);
  double stand_in_within(Selector& selector, const Selector::Limits& limits, double asked);
  void ask_for(Selector& selector, double asked, const glm::dvec3& eye);
  void add(const Patch& p, const Resolutions& k, Claim& claim) const;
  void admit_wanted(render::Submitted& submitted);
  void collect(Selector& selector, const Precision& precision, Claim& claim) const;

  std::shared_ptr<const Hierarchy> hierarchy_;
  Projection projection_;
  Metric metric_;
  PatchMesh mesh_;
  bool parts_;  ///< colours by level tell strips from tiles
  std::unique_ptr<Paging> paging_;
  std::unique_ptr<MapPaging> maps_;
  Selector::Scratch scratch_;
  std::vector<int64_t> parents_;  // scratch of a frame
  std::shared_ptr<Gpu> gpu_;      // knows how to delete what only draw.cpp knows
};

}  // namespace lodlab::seamless
