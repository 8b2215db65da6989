// SPDX-License-Identifier: MIT
#include "instrument/field_ruler.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>

#include "base/errors.h"
#include "geometry/angles.h"
#include "instrument/crack_edges.h"
#include "instrument/crack_pixels.h"
#include "instrument/fillers.h"
#include "instrument/pixels.h"
#include "instrument/slack.h"

namespace lodlab::instrument {
namespace {

DrawnSurface rasterize(const std::string& drawn_by, const HeightField& field, const SampleGrid& grid,
                       const render::Captured& captured, std::vector<float>* worst) {
  try {
    return DrawnSurface(field, grid, captured, worst);
  } catch (const InvalidInput& error) {
    throw InvalidInput(drawn_by + ": " + error.what());
  }
}

bool has_fillers(const render::Captured& captured) {
  return std::any_of(captured.vertices.begin(), captured.vertices.end(),
                     [](const render::CapturedVertex& v) { return (v.bits & 1u) != 0; });
}

/// On a field in memory.
class LaidOnField final : public Laid {
 public:
  LaidOnField(const FieldRuler& ruler, const HeightField& field, Shown shown)
      : ruler_(ruler), field_(field), shown_(std::move(shown)) {}

  const SampleError& samples() override {
    if (!samples_) samples_ = sample_error(field_, surface());
    return *samples_;
  }
  double px_max() override {
    return sample_error_px(field_, ruler_.grid(), surface(), ruler_.in_view(shown_.camera));
  }
  double jump_px_max() override {
    if (!shown_.before) return kUndefined;
    return surface_jump(field_, ruler_.grid(), before(), surface(), ruler_.in_view(shown_.camera));
  }
  std::vector<NodeError> node_errors() override {
    surface();
    return worst_of_nodes(shown_.now(), worst_of_triangle_);
  }
  std::optional<int64_t> raised_fillers() override {
    return instrument::raised_fillers(field_, ruler_.grid(), surface(), shown_.now());
  }
  Correspondence to_drawn() override {
    return along_up(field_, ruler_.grid(), surface(), shown_.camera.eye, 1.0);
  }
  Correspondence to_drawn_before() override {
    if (!shown_.before) return {};
    return along_up(field_, ruler_.grid(), before(), shown_.camera.eye, 1.0);
  }
  Correspondence to_source() override {
    return along_up(field_, ruler_.grid(), surface(), shown_.camera.eye, -1.0);
  }

 private:
  const DrawnSurface& surface() {
    if (!surface_)
      surface_ = rasterize(shown_.drawn_by, field_, ruler_.grid(), shown_.now(), &worst_of_triangle_);
    return *surface_;
  }
  const DrawnSurface& before() {
    if (!before_) before_ = rasterize(shown_.drawn_by, field_, ruler_.grid(), shown_.before(), nullptr);
    return *before_;
  }

  const FieldRuler& ruler_;
  const HeightField& field_;
  Shown shown_;
  std::optional<DrawnSurface> surface_, before_;
  std::vector<float> worst_of_triangle_;  ///< made with surface_
  std::optional<SampleError> samples_;
};

/// On a field that is read by rows: figures over samples are made together, in one pass over it.
class LaidByRows final : public Laid {
 public:
  LaidByRows(const FieldRuler& ruler, Shown shown) : ruler_(ruler), shown_(std::move(shown)) {}

  const SampleError& samples() override { return found().samples; }
  double px_max() override { return found().px_max; }
  double jump_px_max() override { return found().jump_px_max; }
  std::vector<NodeError> node_errors() override {
    return worst_of_nodes(shown_.now(), found().worst_of_triangle);
  }
  std::optional<int64_t> raised_fillers() override {
    if (has_fillers(shown_.now())) refuse();
    return 0;
  }
  Correspondence to_drawn() override { refuse(); }
  Correspondence to_drawn_before() override { refuse(); }
  Correspondence to_source() override { refuse(); }

 private:
  struct Found {
    SampleError samples;
    double px_max = kUndefined, jump_px_max = kUndefined;
    std::vector<float> worst_of_triangle;
  };
  [[noreturn]] void refuse() const {
    field_in_memory(ruler_.source(), "measure: this");
    throw InvalidInput("measure: a source is read by rows, and in memory");
  }
  const Found& found() {
    if (!found_) found_ = find();
    return *found_;
  }
  Found find() const {
    Found out;
    double max = 0.0, squares = 0.0;
    const render::Captured& captured = shown_.now();
    std::optional<render::Captured> earlier;
    if (shown_.before) earlier = shown_.before();
    out.worst_of_triangle.assign(captured.vertices.size() / 3, -1.0f);
    std::vector<float> worst;
    const InView in_view = ruler_.in_view(shown_.camera);
    ruler_.for_parts([&](const HeightField& part, const SampleGrid& grid) {
      const DrawnSurface drawn = rasterize(shown_.drawn_by, part, grid, captured, &worst);
      for (size_t i = 0; i < worst.size(); ++i)
        out.worst_of_triangle[i] = std::max(out.worst_of_triangle[i], worst[i]);
      const SampleError found = sample_error(part, drawn);
      max = std::fmax(max, found.max);
      if (found.samples > 0) squares += found.rms * found.rms * static_cast<double>(found.samples);
      out.samples.holes += found.holes;
      out.samples.samples += found.samples;
      out.px_max = std::fmax(out.px_max, sample_error_px(part, grid, drawn, in_view));
      if (!earlier) return;
      const DrawnSurface from = rasterize(shown_.drawn_by, part, grid, *earlier, nullptr);
      out.jump_px_max = std::fmax(out.jump_px_max, surface_jump(part, grid, from, drawn, in_view));
    });
    out.samples.max = max;
    out.samples.rms = std::sqrt(squares / static_cast<double>(out.samples.samples));
    return out;
  }

  const FieldRuler& ruler_;
  Shown shown_;
  std::optional<Found> found_;
};

std::shared_ptr<const FieldSource> not_null(std::shared_ptr<const FieldSource> source) {
  if (source == nullptr) throw InvalidInput("instrument: no source to measure against");
  return source;
}

}  // namespace

FieldRuler::FieldRuler(std::shared_ptr<const FieldSource> source)
    : source_(not_null(std::move(source))), grid_(*source_) {}

std::unique_ptr<Laid> FieldRuler::lay(Shown shown) const {
  if (const HeightField* field = source_->whole())
    return std::make_unique<LaidOnField>(*this, *field, std::move(shown));
  return std::make_unique<LaidByRows>(*this, std::move(shown));
}

void FieldRuler::for_parts(const std::function<void(const HeightField&, const SampleGrid&)>& visit) const {
  const FieldSource& whole = *source_;
  RowBuffer buffer(true);
  HeightField part;
  for (int64_t row = 0, step = whole.rows_at_once(); row < whole.rows; row += step) {
    const HeightRows rows = whole.read(row, std::min(row + step, whole.rows), buffer);
    static_cast<FieldFrame&>(part) = whole;
    part.rows = rows.end_row - rows.first_row;
    part.y0 = whole.y0 - static_cast<double>(row) * whole.dy;
    part.lat0 = whole.planet ? whole.latitude(row) : whole.lat0;
    part.heights = rows.heights;
    part.valid = rows.valid;
    visit(part, SampleGrid(part));
  }
}

int64_t crack_edges(const SampleGrid& grid, const render::Captured& captured) {
  const glm::dvec3& eye = captured.eye;
  return crack_edges(captured, [&](const UnmatchedEdge& edge) {
    if ((grid.borders(edge.low, eye) & grid.borders(edge.high, eye)) != 0) return true;
    return edge.balanced &&
           (grid.columns_fall_together(edge.low, eye) || grid.columns_fall_together(edge.high, eye));
  });
}

int64_t FieldRuler::crack_edges(const render::Captured& captured, const NodeBound&) const {
  return instrument::crack_edges(grid_, captured);
}

Orientation FieldRuler::orientation(const render::Captured& captured, const NodeBound&) const {
  return instrument::orientation(grid_, captured);
}

bool FieldRuler::stands_free(const render::Captured& captured, const Camera& camera) const {
  return instrument::stands_free(captured, camera, up_at(grid_, glm::dvec3(0.0), camera.eye));
}

/// At height 0, where heights lose nothing; of a planet its centre, or the middle of a patch.
glm::dvec3 FieldRuler::middle() const {
  const glm::dvec3 middle = source_->position(source_->rows / 2, source_->cols / 2, 0.0);
  return source_->planet && source_->reach(glm::dvec3(0.0)) < source_->reach(middle) ? glm::dvec3(0.0)
                                                                                     : middle;
}

double FieldRuler::slack(const glm::dvec3& eye) const { return world_slack(source_->reach(eye)); }

void FieldRuler::check_near(const glm::dvec3& eye) const {
  const FieldFrame& f = grid_.frame();
  double step = f.dlat * kRadiansPerDegree * f.radius, reach = glm::length(eye) + f.radius;
  double off = this->slack(eye);
  if (!f.planet) {
    const glm::dvec3 first = f.position(0, 0, 0.0), last = f.position(f.rows - 1, f.cols - 1, 0.0);
    const glm::dvec3 far = glm::max(glm::abs(first - eye), glm::abs(last - eye));
    const glm::dvec2 slack = grid_slack(f, far, eye);
    const bool east = slack.x * f.dy > slack.y * f.dx;
    step = east ? f.dx : f.dy;
    reach = east ? far.x : far.y;
    off = east ? slack.x : slack.y;
  }
  if (off <= 0.5 * step) return;
  char text[256];
  std::snprintf(
      text, sizeof text,
      "measure: the eye is %.4g m from samples %.4g m apart; 32-bit positions relative to it, up to "
      "%.4g m off, no longer part them (limit: half the spacing)",
      reach, step, off);
  throw InvalidInput(text);
}

double interpolated_deviation(const FieldFrame& frame, const DrawnSurface& surface, const glm::dvec2& place) {
  const int64_t last_row = frame.rows - 2, last_col = frame.wraps ? frame.cols - 1 : frame.cols - 2;
  const auto cell = [](double at, int64_t last) {
    return static_cast<int64_t>(std::clamp(std::floor(at), 0.0, static_cast<double>(last)));
  };
  const int64_t row = cell(place.y, last_row), col = cell(place.x, last_col);
  const double u = std::clamp(place.x - static_cast<double>(col), 0.0, 1.0);
  const double v = std::clamp(place.y - static_cast<double>(row), 0.0, 1.0);
  const int64_t next = (col + 1) % frame.cols;
  const auto at = [&](int64_t r, int64_t c) {
    return static_cast<double>(surface.deviation(r * frame.cols + c));
  };
  if ((row + col) % 2 == 0) {  // cut from (row, col) to (row + 1, col + 1)
    const double start = at(row, col), end = at(row + 1, next);
    if (u >= v) return start + (u - v) * (at(row, next) - start) + v * (end - start);
    return start + (v - u) * (at(row + 1, col) - start) + u * (end - start);
  }
  const double east = at(row, next), south = at(row + 1, col);
  if (u + v <= 1.0) return at(row, col) * (1.0 - u - v) + u * east + v * south;
  return at(row + 1, next) * (u + v - 1.0) + (1.0 - v) * east + (1.0 - u) * south;
}

Correspondence along_up(const FieldFrame& frame, const SampleGrid& grid, const DrawnSurface& surface,
                        const glm::dvec3& eye, double times) {
  return
      [&frame, &grid, &surface, eye, times](std::span<const glm::dvec3> points, std::span<glm::dvec3> out) {
        for (size_t i = 0; i < points.size(); ++i) {
          const double deviation = interpolated_deviation(frame, surface, grid.coordinates(points[i], eye));
          out[i] = points[i] + times * deviation * up_at(grid, points[i], eye);
        }
      };
}

}  // namespace lodlab::instrument
