// SPDX-License-Identifier: MIT
// A session on a forest: adaptation (select.cpp, adapt_*.cpp), cuts by hand (cut.cpp), drawing (draw.cpp).
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "method/projector.h"
#include "methods/multigrain/hierarchy.h"

namespace lodlab {
class MapPaging;
}

namespace lodlab::multigrain {

class Paging;

enum class Adapt { kAuto, kTopDown, kDual, kQuad, kLevel, kExact };

class MultigrainSession : public Session {
 public:
  MultigrainSession(std::shared_ptr<const Forest> forest, const Options& options);
  ~MultigrainSession() override;

  Cut select(const Request& request) override;
  double optimum_px(const Request& request) const override;
  Cut cut(const std::vector<int64_t>& nodes, const std::vector<int32_t>& resolutions) const override;
  std::vector<Cut> audit_cuts() const override;
  void draw(const Cut& cut, render::Pass& pass) override;
  void reset() override;
  int64_t resident_bytes() const override;
  void settle() override;

 private:
  void admit_wanted(render::Submitted& submitted);
  void next_round(render::Pass& pass);

  std::shared_ptr<const Forest> forest_;
  Projection projection_;
  Adapt adapt_;
  std::unique_ptr<Paging> paging_;
  std::unique_ptr<MapPaging> maps_;
  struct Adaptation;  // select.cpp: what the next frame starts from, and scratch memory
  std::unique_ptr<Adaptation> adaptation_;
  struct Gpu;                 // draw.cpp: GL objects
  std::shared_ptr<Gpu> gpu_;  // knows how to delete what only draw.cpp knows
};

}  // namespace lodlab::multigrain
