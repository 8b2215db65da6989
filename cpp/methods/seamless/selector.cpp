// SPDX-License-Identifier: MIT
// One view's way down the hierarchy: frustum, edges, what a pixel error and hard budgets ask for
// (selector.h).
#include "methods/seamless/selector.h"

#include <cmath>

namespace lodlab::seamless {

Selector::Selector(const Hierarchy& hierarchy, const PatchMesh& mesh, const Metric& metric,
                   const Projector& projector, const Camera* camera, Scratch& scratch)
    : hierarchy_(hierarchy),
      layout_(hierarchy.layout),
      levels_(hierarchy.level.data()),
      mesh_(mesh),
      metric_(metric),
      projector_(projector),
      tables_{metric.roughness ? hierarchy.codes().data() : nullptr,
              hierarchy.book().table(),
              hierarchy.book().mask(),
              metric.base(),
              {hierarchy.frame, projector.eye, metric.nearest}},
      all_planes_(camera != nullptr ? 0x1f : 0),
      here_(scratch.here),
      parted_(scratch.parted) {
  if (camera == nullptr) return;
  const FieldFrame& f = hierarchy.frame;
  for (size_t i = 0; i < planes_.size(); ++i) {
    glm::dvec3 n = camera->planes[i];
    const double offset =
        n.x * (f.x0 - projector.eye.x) + n.y * (f.y0 - projector.eye.y) - (i == 4 ? camera->near_plane : 0.0);
    const double low = n.z * (f.z_min - projector.eye.z), high = n.z * (f.z_max - projector.eye.z);
    planes_[i] = {n.x * f.dx, -n.y * f.dy, offset + std::min(low, high), offset + std::max(low, high)};
  }
}

/// Of planes that cut what the patch is a part of. Outside one of them, nothing of it is drawn.
uint8_t Selector::planes_of(const Patch& p, uint8_t planes) const {
  const double x0 = static_cast<double>(layout_.col(p)), y0 = static_cast<double>(layout_.row(p));
  const double x1 = static_cast<double>(layout_.end_col(p));
  const double y1 = static_cast<double>(layout_.end_row(p));
  uint8_t cut = 0;
  for (size_t i = 0; i < planes_.size(); ++i) {
    if ((planes >> i & 1) == 0) continue;
    const Plane& plane = planes_[i];
    const double ax = plane.x * x0, bx = plane.x * x1, ay = plane.y * y0, by = plane.y * y1;
    if (std::max(ax, bx) + std::max(ay, by) + plane.far_z < 0.0) return kOutside;
    if (std::min(ax, bx) + std::min(ay, by) + plane.near_z < 0.0) cut |= static_cast<uint8_t>(1u << i);
  }
  return cut;
}

std::array<double, 4> Selector::edge_errors(const Patch& p, const Resolutions& k) const {
  if (metric_.roughness) return hierarchy_.bounds(p, k);
  const double* of_level = &hierarchy_.typical[static_cast<size_t>(p.level * layout_.resolutions)];
  return {of_level[k[0]], of_level[k[1]], of_level[k[2]], of_level[k[3]]};
}

double Selector::error(const Patch& p, const Resolutions& k) const {
  if (metric_.roughness) return hierarchy_.bound(p, k);
  const double* of_level = &hierarchy_.typical[static_cast<size_t>(p.level * layout_.resolutions)];
  return std::max(std::max(of_level[k[0]], of_level[k[1]]), std::max(of_level[k[2]], of_level[k[3]]));
}

/// Most patches are far from being the worst: those are told by their distance.
double Selector::pixels(const Patch& p, double error, double most) {
  if (most != most_pixels_) {
    most_pixels_ = most;
    safe_ = projector_.safe_distance(most);
  }
  const Bounds b = bounds(p);
  if (beyond(b, error * safe_)) return most;
  return std::max(most, projector_.project(error, projector_.place(b.lo, b.hi)));
}

void Selector::push_children(const Step& step, int64_t y) {
  const Patch& p = step.patch;
  const Level& level = hierarchy_.level[static_cast<size_t>(p.level) + 1];
  if (y >= level.down) return;
  const int branch = layout_.branch_log2();
  const int64_t end = std::min((p.x + 1) << branch, level.across);
  for (int64_t x = p.x << branch; x < end; ++x) {
    const Patch child{p.level + 1, y, x};
    here_.push_back({child, planes_cutting(child, step.planes)});
  }
}

void Selector::push_children() {
  const int64_t branch = int64_t{1} << layout_.branch_log2();
  for (size_t first = 0, end; first < parted_.size(); first = end) {
    const int64_t y = parted_[first].patch.y;
    end = first;
    while (end < parted_.size() && parted_[end].patch.y == y) ++end;
    for (int64_t row = y * branch; row < (y + 1) * branch; ++row) {
      for (size_t i = first; i < end; ++i) push_children(parted_[i], row);
    }
  }
}

void Selector::block(const Patch& p, const Precision& precision) {
  const Level& level = level_of(p);
  const Reach far = tables_.reach(level, tables_.weights(level, p), precision.rho);
  const double most = *std::max_element(far.begin(), far.end()) * (1.0 + 1e-9);
  blocks_.push_back({(static_cast<double>(p.x) + 0.5) * level.width,
                     (static_cast<double>(p.y) + 0.5) * level.height,
                     most + 0.5 * std::hypot(level.width, level.height)});
}

bool Selector::blocked(const Patch& p, const Precision& precision) const {
  if ((blocks_.empty() && !wanted_) || p.level + 1 == layout_.levels) return false;
  const Precision wanted = wanted_.value_or(precision);
  const Level& level = level_of(p);
  return tables_.edges(level, p, tables_.weights(level, p), wanted).split();
}

/// An edge's nearest distance becomes at least what every block has at the edge's farther end: like
/// distances, this is the same from both sides, no less for a part of an edge, and differs by no more than l
/// between a patch's edges.
std::array<double, 4> Selector::pushed_away(const Patch& p) const {
  std::array<double, 4> squares = tables_.distances.of(level_of(p), p);
  const Level& level = level_of(p);
  const double west = static_cast<double>(p.x) * level.width,
               east = static_cast<double>(p.x + 1) * level.width;
  const double north = static_cast<double>(p.y) * level.height;
  const double south = static_cast<double>(p.y + 1) * level.height;
  for (const Block& b : blocks_) {
    const auto from = [&](double x, double y) {
      return std::sqrt((x - b.east) * (x - b.east) + (y - b.south) * (y - b.south));
    };
    const double nw = from(west, north), ne = from(east, north), se = from(east, south),
                 sw = from(west, south);
    const std::array<double, 4> farther{std::max(nw, ne), std::max(ne, se), std::max(se, sw),
                                        std::max(sw, nw)};
    for (size_t i = 0; i < 4; ++i) {
      const double least = std::max(b.distance - farther[i], 0.0);
      squares[i] = std::max(squares[i], least * least);
    }
  }
  return squares;
}

double Selector::coarsest() const { return metric_.roughness ? -8.0 * hierarchy_.level.front().length : 0.0; }

double Selector::coarser(double fineness) const {
  const double span = hierarchy_.level.front().length, least = coarsest();
  if (fineness * gain() > 1e-3) return 0.5 * fineness;
  return std::max(least, std::min(2.0 * fineness, -1e-6 * span));
}

double Selector::needed(const Patch& p, double weight, double distance, double threshold) const {
  const double length = level_of(p).length;
  constexpr double kBeyond = 1.0 + 1e-9;  // the least precision lies at equality; a hair above it
  const double away = metric_.base() * length / (threshold * kBeyond) - distance;
  if (away > 0.0) return -away;
  if (!(weight > 0.0)) return std::numeric_limits<double>::infinity();
  constexpr double kAbove = 1e-100;  // at no distance the paper's metric asks for any fineness above 0
  return std::max(kAbove, (threshold * kBeyond * distance / length - metric_.base()) / weight * kBeyond);
}

std::optional<double> Selector::asks(const Patch& p, const std::array<double, 4>& weight, const Edges& edges,
                                     double tau, double safe) const {
  const int top = layout_.resolutions - 1;
  Resolutions k;
  for (size_t i = 0; i < 4; ++i) k[i] = edges.resolution(i, layout_.resolutions);
  const double worst = error(p, k);
  const Bounds b = bounds(p);
  if (beyond(b, worst * safe)) return std::nullopt;
  const double allowed = projector_.inverse(tau, projector_.place(b.lo, b.hi));
  if (worst <= allowed) return std::nullopt;
  std::array<double, 4> distance = tables_.distances.of(level_of(p), p);
  for (double& d : distance) d = std::sqrt(d);
  double split = std::numeric_limits<double>::infinity();
  if (p.level + 1 < layout_.levels) {
    for (size_t i = 0; i < 4; ++i) split = std::min(split, needed(p, weight[i], distance[i], 1.0));
  }
  std::optional<double> most;
  const std::array<double, 4> errors = edge_errors(p, k);
  for (size_t i = 0; i < 4; ++i) {
    if (errors[i] <= allowed) continue;
    double way = split;
    if (k[i] < top) way = std::min(way, needed(p, weight[i], distance[i], std::ldexp(1.0, k[i] - top)));
    if (std::isinf(way)) continue;
    most = std::max(most.value_or(way), way);
  }
  return most;
}

/// Finer precision never undoes what held: bounds nest, and boxes of children lie inside their parents'. So
/// one way down, raising the precision by what each patch asks for, ends at the least one for all.
double Selector::fineness_for(double tau) {
  double fineness = coarsest();
  const double safe = projector_.safe_distance(tau);
  const Patch root{0, 0, 0};
  here_.assign(1, {root, planes_cutting(root, all_planes_)});
  while (!here_.empty()) {
    parted_.clear();
    for (const Step& step : here_) {
      if (step.planes == kOutside) continue;
      ++traversed;
      if (parts_for(step.patch, tau, safe, fineness)) parted_.push_back(step);
    }
    here_.clear();
    push_children();
  }
  return fineness;
}

/// Raises the fineness to what a visible patch asks for; true when it then splits.
bool Selector::parts_for(const Patch& p, double tau, double safe, double& fineness) const {
  const Level& level = level_of(p);
  const std::array<double, 4> weight = tables_.weights(level, p);
  for (;;) {
    const Edges seen = edges(tables_, level, p, weight, Precision::of(fineness));
    if (p.level + 1 < layout_.levels && seen.split()) return true;
    const std::optional<double> more = asks(p, weight, seen, tau, safe);
    if (!more || *more <= fineness) return false;
    fineness = *more;
  }
}

LeastCut::Cost Selector::count(double fineness, const Limits& limits) {
  LeastCut::Cost cost;
  traverse(Precision::of(fineness), Scope::kVisible, [&](const Active& a) {
    ++cost.nodes;
    cost.triangles += mesh_.triangles(a.k, layout_.clip_x(a.patch), layout_.clip_y(a.patch));
    return limits.keep(cost);
  });
  return cost;
}

/// On a logarithmic scale from the coarsest cut to `most`, until 99 % of a budget are spent. Where children
/// of a patch on the frustum's border are culled, finer may be fewer: then it is a cut that keeps the
/// budgets, if not the finest.
Selector::Cheapest Selector::within(const Limits& limits, double most) {
  LeastCut::Cost drawn;
  const auto fits = [&](double fineness) {
    drawn = count(fineness, limits);
    return limits.keep(drawn);
  };
  if (fits(most)) return {most, true, drawn};
  const double span = hierarchy_.level.front().length;
  const auto scale = [&](double f) { return f < 0.0 ? -std::log1p(-f / span) : std::log1p(f * gain()); };
  const auto fineness = [&](double s) { return s < 0.0 ? -span * std::expm1(-s) : std::expm1(s) / gain(); };
  double low = scale(coarsest()), high = scale(most);
  std::optional<Cheapest> found;
  for (int i = 0; i < 40; ++i) {
    const double middle = 0.5 * (low + high);
    if (!fits(fineness(middle))) {
      high = middle;
      continue;
    }
    low = middle;
    found = {fineness(middle), true, drawn};
    if (drawn.triangles >= limits.triangles - limits.triangles / 100 || drawn.nodes == limits.nodes) break;
  }
  if (found) return *found;
  const bool kept = fits(coarsest());
  return {coarsest(), kept, drawn};
}

}  // namespace lodlab::seamless
