// SPDX-License-Identifier: MIT
// Selection: what a frame refines by, left to the GPU as a record; its twin on the CPU says what comes of it.
#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <mutex>

#include "base/errors.h"
#include "base/parallel.h"
#include "geometry/mesh_surface.h"
#include "method/hand_cut.h"
#include "method/indirect.h"
#include "methods/subdivision/gpu.h"
#include "store/format.h"

namespace lodlab::subdivision {
namespace {

/// The finest pixel error of a search for a number of triangles.
constexpr double kFinestStep = 0x1p-12;

struct Selection : Record {
  Uniforms uniforms;
  Search search;
  std::shared_ptr<const Posed> posed;    ///< null: at rest
  std::shared_ptr<const Loaded> loaded;  ///< null: all is there
};

/// Of cuts by hand: levels of faces; each control edge has the larger of its faces' two.
struct Levels : Record {
  Records records;
};

/// What is said of a pose; empty: nothing.
std::string warning_of(const PosedControl& control) {
  if (control.folded == 0) return "";
  return "the pose folds " + std::to_string(control.folded) + " control face" +
         (control.folded == 1 ? "" : "s") + " over, the first is " + std::to_string(control.first_folded) +
         ": what is drawn there may cross itself";
}

class SubdivisionSession : public Session {
 public:
  SubdivisionSession(const std::shared_ptr<const SubdivisionHierarchy>& hierarchy, const Options& options)
      : SubdivisionSession(
            hierarchy, options,
            make_plan(hierarchy, paging_of(options), Gpu::room(*hierarchy, by_feedback(options)))) {}
  SubdivisionSession(const std::shared_ptr<const SubdivisionHierarchy>& hierarchy, const Options& options,
                     Plan plan)
      : hierarchy_(hierarchy),
        projection_(projection_of(options, false)),
        metric_(options.text("metric") == "length"      ? LODLAB_METRIC_LENGTH
                : options.text("metric") == "curvature" ? LODLAB_METRIC_CURVATURE
                                                        : LODLAB_METRIC_BOUND),
        feedback_(by_feedback(options)),
        groups_(*hierarchy_),
        slots_(plan.slots),
        residency_(hierarchy_->store(), std::move(plan.setup)) {}

  Cut select(const Request& request) override;
  void resolve(Cut& cut) const override;
  std::string digest(const Cut& cut) const override;
  Cut cut(const std::vector<int64_t>& ids, const std::vector<int32_t>& resolutions) const override;
  std::vector<Cut> audit_cuts() const override;
  void prepare(const Cut& cut, render::Work& work) override;
  void draw(const Cut& cut, render::Pass& pass) override;
  int64_t resident_bytes() const override { return gpu_ ? gpu_->bytes() : 0; }
  void settle() override { residency_.settle(); }

 private:
  static bool by_feedback(const Options& options) { return options.text("pipeline") == "geometry"; }
  int64_t slot_bytes() const { return residency_.capacity() / slots_; }
  size_t faces() const { return hierarchy_->records().face.size(); }
  Uniforms uniforms(const Camera& camera, int metric) const {
    return uniforms_of(*hierarchy_, camera, metric);
  }
  Lying lying(const Records& records) const {
    return {hierarchy_->rest().positions, hierarchy_->rest().normals, records};
  }
  Lying lying(const Posed* posed) const {
    if (posed == nullptr) return lying(hierarchy_->records());
    return {posed->control.positions, posed->control.normals, posed->records};
  }
  Cut by_levels(const std::vector<int32_t>& level) const;
  std::shared_ptr<const Loaded> load(const Selection& selection, const Camera& camera);
  Slots bring(const Loaded* loaded, render::Submitted& submitted);
  void admit_wanted(render::Submitted& submitted);
  bool admit(uint32_t group, bool wait, render::Submitted& submitted);

  size_t step_within(const Selection& selection, const Lying& lies) const;
  int64_t count(const Selection& selection, const Lying& lies, const Step& step, int64_t most) const;

  std::shared_ptr<const SubdivisionHierarchy> hierarchy_;
  Projection projection_;
  int metric_;
  bool feedback_;
  Groups groups_;
  int64_t slots_;
  Residency residency_;
  std::unique_ptr<Gpu> gpu_;
};

Cut SubdivisionSession::select(const Request& request) {
  const Camera camera = make_camera(request.view);
  const Projector projector(projection_, camera);
  const auto selection = std::make_shared<Selection>();
  selection->uniforms = uniforms(camera, metric_);
  if (request.pose) selection->posed = posed(*hierarchy_, *request.pose);
  const Budget& budget = request.budget;
  Search& search = selection->search;
  const double finest = budget.pixel_error.value_or(kFinestStep);
  search.steps.push_back(step_of(projector, finest));
  if (budget.triangles) {
    search.most = static_cast<uint32_t>(std::min<int64_t>(*budget.triangles, UINT32_MAX - 1));
    for (size_t i = 1; i < kSteps; ++i)
      search.steps.push_back(step_of(projector, finest * std::exp2(static_cast<double>(i) / 16.0)));
    Step& last = search.steps.back();  // splits nothing, however near the eye
    last.never = std::numeric_limits<float>::max();
    last.gain = 0.0f;
  }
  if (residency_.streams()) selection->loaded = load(*selection, camera);
  return {request, selection, std::nullopt};
}

/// As many of the groups wanted as there are slots count, the most worthy ones, so that in the end what is
/// there does not depend on what came first.
std::shared_ptr<const Loaded> SubdivisionSession::load(const Selection& selection, const Camera& camera) {
  const auto out = std::make_shared<Loaded>();
  out->there.assign(static_cast<size_t>(groups_of(hierarchy_->stored().shape.faces)), 0);
  const std::vector<Residency::Want> wanted = groups_.wanted(lying(selection.posed.get()), selection.uniforms,
                                                             camera, selection.search.steps.front());
  std::vector<Residency::Want> wants;
  for (size_t i = 0; i < wanted.size(); ++i) {
    const uint32_t group = wanted[i].unit;
    const bool fits = i < static_cast<size_t>(slots_);
    if (fits && residency_.offset(group) >= 0) {
      out->there[group] = 1;
      continue;
    }
    out->lacked.push_back(group);
    if (fits) wants.push_back(wanted[i]);
  }
  if (static_cast<size_t>(slots_) == out->there.size()) {  // nothing has to go: nothing changes with the view
    for (uint32_t group = 0; group < out->there.size(); ++group)
      out->there[group] = residency_.offset(group) >= 0 ? 1 : 0;
  }
  residency_.want(std::move(wants));
  return out;
}

/// Triangles of the faces in sight; more than `most` where they are more.
int64_t SubdivisionSession::count(const Selection& selection, const Lying& lies, const Step& step,
                                  int64_t most) const {
  const Refinement refinement(lies, selection.uniforms, step);
  std::atomic<int64_t> out{0};
  parallel_for(static_cast<int64_t>(faces()), 64, [&](int64_t begin, int64_t end) {
    for (auto f = static_cast<size_t>(begin); f < static_cast<size_t>(end) && out <= most; ++f) {
      if (!refinement.visible(f)) continue;
      int64_t here = 0;
      refinement.for_triangles(f, [&](const PatternTriangle&) { ++here; });
      out += here;
    }
  });
  return out;
}

size_t SubdivisionSession::step_within(const Selection& selection, const Lying& lies) const {
  const Search& search = selection.search;
  if (!search.most) return 0;
  const int64_t most = *search.most;
  return first_that_fits(search.steps.size(), kFirstStep,
                         [&](size_t at) { return count(selection, lies, search.steps[at], most) <= most; });
}

void SubdivisionSession::resolve(Cut& cut) const {
  if (cut.claim) return;
  const auto& selection = static_cast<const Selection&>(*cut.record);
  const Uniforms& u = selection.uniforms;
  const Posed* const posed = selection.posed.get();
  const Lying whole = lying(posed);
  std::optional<Records> held;
  if (selection.loaded)
    held = held_back(whole.records, hierarchy_->pattern().levels(), selection.loaded->there);
  const Lying lies{whole.positions, whole.normals, held ? *held : whole.records};
  const Step& step = selection.search.steps[step_within(selection, lies)];
  const Refinement refinement(lies, u, step);
  const Camera camera = make_camera(cut.request.view);
  const Projector projector(projection_, camera);
  const glm::dvec3 eye = camera.eye - hierarchy_->centre();
  const Pattern& pattern = hierarchy_->pattern();
  std::optional<Displaced> moved;
  if (posed != nullptr) moved.emplace(hierarchy_->displaced().at(hierarchy_->rest(), posed->control));
  const Displaced& displaced = moved ? *moved : hierarchy_->displaced();

  Claim claim;
  if (posed != nullptr) claim.warning = warning_of(posed->control);
  claim.promises_bound =
      posed == nullptr && metric_ == LODLAB_METRIC_BOUND && projection_ != Projection::kPaper;
  claim.tau = step.tau;
  claim.nodes.resize(faces());
  std::mutex mutex;
  parallel_for(static_cast<int64_t>(faces()), 64, [&](int64_t begin, int64_t end) {
    std::vector<vec3> points(static_cast<size_t>(pattern.points()));
    double predicted = 0.0;
    int64_t triangles = 0, visible = 0, missing = 0;
    for (int64_t f = begin; f < end; ++f) {
      CutNode& node = claim.nodes[static_cast<size_t>(f)];
      node.node = static_cast<uint32_t>(f);
      node.visible = refinement.visible(static_cast<size_t>(f));
      if (node.visible) displaced.of_face(f, points);
      const double scale = double{lies.records.face[static_cast<size_t>(f)].inner.scale};
      node.missing = held && refinement.lacks(static_cast<size_t>(f), whole.records);
      int least = pattern.levels() - 1;
      refinement.for_triangles(static_cast<size_t>(f), [&](const PatternTriangle& t) {
        int own = pattern.levels() - 1;
        for (const ivec2 way : {t.p1 - t.p0, t.p2 - t.p1, t.p0 - t.p2})
          own = std::min(own, pattern.level(way.x, way.y));
        least = std::min(least, own);
        if (!node.visible) return;
        ++triangles;
        const double bound = scale * hierarchy_->stored().bound(f, own);
        const auto at = [&](ivec2 p) {
          return glm::dvec3(points[static_cast<size_t>(pattern.point(p.x, p.y))]) - eye;
        };
        const Triangle there = {at(t.p0), at(t.p1), at(t.p2)};
        const glm::dvec3 middle = (there[0] + there[1] + there[2]) / 3.0;
        double radius = 0.0;
        for (const glm::dvec3& p : there) radius = std::max(radius, glm::distance(p, middle));
        const auto projected = [&](double distance) {
          return projector.project(bound, {std::max(0.0, distance - bound), 1.0});
        };
        if (projected(glm::length(middle) - radius) <= predicted) return;
        predicted = std::max(predicted, projected(closest_on_triangle(there, glm::dvec3(0.0)).distance));
      });
      node.resolution = static_cast<uint32_t>(least);
      node.error = scale * hierarchy_->stored().bound(f, least);
      visible += node.visible ? 1 : 0;
      missing += node.visible && node.missing ? 1 : 0;
    }
    const std::lock_guard lock(mutex);
    claim.predicted_px = std::max(claim.predicted_px, predicted);
    claim.triangles += triangles;
    claim.visible_nodes += visible;
    claim.missing_nodes += missing;
  });
  if (cut.request.budget.triangles && claim.triangles > *cut.request.budget.triangles) {
    claim.least_triangles = claim.triangles;
    claim.least_nodes = claim.visible_nodes;
  }
  claim.budget_met = claim.within(cut.request.budget);
  cut.claim = std::move(claim);
}

std::string SubdivisionSession::digest(const Cut& cut) const {
  const auto* selection = dynamic_cast<const Selection*>(cut.record.get());
  if (selection == nullptr) return Session::digest(cut);
  std::vector<std::byte> bytes;
  const auto add = [&](std::span<const std::byte> part) {
    bytes.insert(bytes.end(), part.begin(), part.end());
  };
  add(std::as_bytes(std::span(&selection->uniforms, 1)));
  add(std::as_bytes(std::span(selection->search.steps).first(1)));
  const uint32_t most = selection->search.most.value_or(~0u);
  add(std::as_bytes(std::span(&most, 1)));
  if (selection->posed) add(std::as_bytes(std::span(selection->posed->control.positions)));
  if (selection->loaded) add(std::as_bytes(std::span(selection->loaded->lacked)));
  return store::digest_of(bytes);
}

Cut SubdivisionSession::by_levels(const std::vector<int32_t>& level) const {
  const auto record = std::make_shared<Levels>();
  record->records = hierarchy_->records();
  for (LineRecord& edge : record->records.edge) edge.drawn = 0;
  Claim claim;
  for (size_t f = 0; f < faces(); ++f) {
    record->records.face[f].inner.drawn = static_cast<uint32_t>(level[f]);
    for (const uint32_t e : record->records.face[f].edge) {
      uint32_t& drawn = record->records.edge[e].drawn;
      drawn = std::max(drawn, static_cast<uint32_t>(level[f]));
    }
    claim.nodes.push_back({static_cast<uint32_t>(f), static_cast<uint32_t>(level[f]), 1.0f, true, false,
                           hierarchy_->stored().bound(static_cast<int64_t>(f), level[f])});
  }
  Uniforms u = {};
  u.metric = LODLAB_METRIC_LEVEL;
  u.d = hierarchy_->pattern().d;
  const Lying lies = lying(record->records);
  const Refinement refinement(lies, u, {});
  for (size_t f = 0; f < faces(); ++f)
    refinement.for_triangles(f, [&](const PatternTriangle&) { ++claim.triangles; });
  claim.visible_nodes = static_cast<int64_t>(faces());
  Cut out = cut_by_hand(std::move(claim));
  out.record = record;
  return out;
}

Cut SubdivisionSession::cut(const std::vector<int64_t>& ids, const std::vector<int32_t>& resolutions) const {
  check_counts(ids, resolutions);
  const int32_t levels = hierarchy_->pattern().levels();
  std::vector<int32_t> level(faces(), -1);
  for (size_t i = 0; i < ids.size(); ++i) {
    const size_t f = checked_node(ids[i], static_cast<int64_t>(faces()));
    if (level[f] >= 0) throw InvalidInput("cut: node " + std::to_string(f) + " is given twice");
    level[f] = resolutions.empty() ? levels - 1 : resolutions[i];
    if (level[f] < 0 || level[f] >= levels) {
      throw InvalidInput("cut: resolution " + std::to_string(level[f]) + " of node " + std::to_string(f) +
                         ": it is from 0 to " + std::to_string(levels - 1));
    }
  }
  const auto gap = std::find(level.begin(), level.end(), -1);
  if (gap != level.end())
    throw InvalidInput("cut: gap: node " + std::to_string(gap - level.begin()) + " is missing");
  return by_levels(level);
}

/// All faces at each level, and every other one at the finest beside the coarsest.
std::vector<Cut> SubdivisionSession::audit_cuts() const {
  const int32_t levels = hierarchy_->pattern().levels();
  std::vector<Cut> out;
  for (int32_t level = 0; level < levels; ++level)
    out.push_back(by_levels(std::vector<int32_t>(faces(), level)));
  for (const size_t odd : {0u, 1u}) {
    std::vector<int32_t> level(faces(), 0);
    for (size_t f = odd; f < faces(); f += 2) level[f] = levels - 1;
    out.push_back(by_levels(level));
  }
  return out;
}

bool SubdivisionSession::admit(uint32_t group, bool wait, render::Submitted& submitted) {
  std::vector<uint32_t> dropped;
  const auto upload = residency_.admit(group, wait, dropped);
  if (upload) gpu_->put(group, upload->offset / slot_bytes(), *upload->page, submitted);
  return upload.has_value();
}

/// The slots of what a cut draws; what is not there any more comes back.
Slots SubdivisionSession::bring(const Loaded* loaded, render::Submitted& submitted) {
  Slots out(static_cast<size_t>(groups_of(hierarchy_->stored().shape.faces)), kNowhere);
  residency_.next_frame();
  const auto needed = [&](uint32_t group) { return loaded == nullptr || loaded->there[group] != 0; };
  for (uint32_t group = 0; group < out.size(); ++group) {
    if (needed(group)) residency_.touch(group);
  }
  for (uint32_t group = 0; group < out.size(); ++group) {
    if (!needed(group)) continue;
    if (residency_.offset(group) < 0 && !admit(group, true, submitted)) {
      throw Unsupported("subdivision: gpu_cache_mb holds " + std::to_string(slots_) + " of the " +
                        std::to_string(out.size()) + " pages of a cut that draws all");
    }
    out[group] = static_cast<uint32_t>(residency_.offset(group) / slot_bytes());
  }
  return out;
}

/// What arrived meanwhile, for the next frame: not in place of what this one draws.
void SubdivisionSession::admit_wanted(render::Submitted& submitted) {
  const int64_t most = submitted.upload_bytes + kUploadPerFrame;
  for (const Residency::Want& want : residency_.wanted()) {
    if (submitted.upload_bytes >= most) break;
    if (residency_.offset(want.unit) < 0) admit(want.unit, false, submitted);
  }
}

void SubdivisionSession::prepare(const Cut& cut, render::Work& work) {
  if (!gpu_) gpu_ = std::make_unique<Gpu>(*hierarchy_, feedback_, slots_);
  if (const auto* selection = dynamic_cast<const Selection*>(cut.record.get())) {
    const Slots slots = bring(selection->loaded.get(), work.submitted);
    gpu_->refine(selection->uniforms, selection->search, selection->posed, slots, work);
  } else {
    const Uniforms u = uniforms(work.camera(), LODLAB_METRIC_LEVEL);
    const Slots slots = bring(nullptr, work.submitted);
    gpu_->refine(u, static_cast<const Levels&>(*cut.record).records, slots, work);
  }
  if (residency_.streams()) admit_wanted(work.submitted);
}

void SubdivisionSession::draw(const Cut&, render::Pass& pass) {
  gpu_->draw(uniforms(pass.camera(), metric_), pass);
}

}  // namespace

std::unique_ptr<Session> make_session(std::shared_ptr<const SubdivisionHierarchy> hierarchy,
                                      const Options& options) {
  return std::make_unique<SubdivisionSession>(hierarchy, options);
}

}  // namespace lodlab::subdivision
