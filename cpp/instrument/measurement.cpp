// SPDX-License-Identifier: MIT
#include "instrument/measurement.h"

#include <algorithm>
#include <cmath>

#include "base/errors.h"
#include "instrument/crack_edges.h"
#include "instrument/fillers.h"
#include "instrument/picture_difference.h"
#include "instrument/ssim.h"

namespace lodlab::instrument {
namespace {

void check_view(const Reference& reference, const Camera& camera) {
  const Camera& r = reference.camera;
  if (r.width != camera.width || r.height != camera.height) {
    throw InvalidInput("measure: the reference is " + std::to_string(r.width) + " x " +
                       std::to_string(r.height) + " pixels; the view is " + std::to_string(camera.width) +
                       " x " + std::to_string(camera.height));
  }
  if (r.eye == camera.eye && r.forward == camera.forward && r.right == camera.right && r.K == camera.K &&
      r.near_plane == camera.near_plane) {
    return;
  }
  throw InvalidInput("measure: the reference is of another view");
}

/// A value that is made on first use.
template <class T, class Make>
const T& kept(std::optional<T>& slot, const Make& make) {
  if (!slot) slot.emplace(make());
  return *slot;
}

bool has_fillers(const render::Captured& captured) {
  return std::any_of(captured.vertices.begin(), captured.vertices.end(),
                     [](const render::CapturedVertex& v) { return (v.bits & 1u) != 0; });
}

}  // namespace

Measurement::Measurement(std::shared_ptr<const Instrument> instrument,
                         std::shared_ptr<const render::FieldResources> resources, Subject subject)
    : instrument_(std::move(instrument)), resources_(std::move(resources)), subject_(std::move(subject)) {
  instrument_->check_near(subject_.camera.eye);
  if (!subject_.pictures) subject_.reference = nullptr;
  if (subject_.reference != nullptr) check_view(*subject_.reference, subject_.camera);
}

// What several figures need ---------------------------------------------------------------------------------

const render::Captured& Measurement::whole() {
  return kept(whole_, [&] { return render::capture(subject_.camera, subject_.draw, true); });
}

const HeightField& Measurement::field() const {
  return field_in_memory(instrument_->source(), "measure: this");
}

DrawnSurface Measurement::rasterize(const HeightField& field, const SampleGrid& grid,
                                    const render::Captured& captured, std::vector<float>* worst) const {
  try {
    return DrawnSurface(field, grid, captured, worst);
  } catch (const InvalidInput& error) {
    throw InvalidInput(subject_.drawn_by + ": " + error.what());
  }
}

const DrawnSurface& Measurement::surface() {
  return kept(surface_, [&] { return rasterize(field(), grid(), whole(), &worst_of_triangle_); });
}

const DrawnSurface* Measurement::before() {
  if (!subject_.draw_before) return nullptr;
  return &kept(before_, [&] {
    return rasterize(field(), grid(), render::capture(subject_.camera, subject_.draw_before, true), nullptr);
  });
}

const render::Picture& Measurement::drawn() {
  return kept(drawn_,
              [&] { return render::draw_picture(subject_.camera, render::Show::kShade, subject_.draw); });
}

double Measurement::optimum_gap() {
  if (!subject_.optimum_px) return kUndefined;
  const double optimum = subject_.optimum_px();
  return subject_.predicted_px == optimum ? 0.0 : subject_.predicted_px / optimum - 1.0;
}

// Figures over samples --------------------------------------------------------------------------------------

const Measurement::ByRows& Measurement::by_rows() {
  return kept(by_rows_, [&] {
    ByRows out;
    double max = 0.0, squares = 0.0;
    const render::Captured& captured = whole();
    std::optional<render::Captured> earlier;
    if (subject_.draw_before) earlier = render::capture(subject_.camera, subject_.draw_before, true);
    worst_of_triangle_.assign(captured.vertices.size() / 3, -1.0f);
    std::vector<float> worst;
    const InView in_view = instrument_->in_view(subject_.camera);
    instrument_->for_parts([&](const HeightField& part, const SampleGrid& part_grid) {
      const DrawnSurface drawn = rasterize(part, part_grid, captured, &worst);
      for (size_t i = 0; i < worst.size(); ++i)
        worst_of_triangle_[i] = std::max(worst_of_triangle_[i], worst[i]);
      const SampleError found = sample_error(part, drawn);
      max = std::fmax(max, found.max);
      if (found.samples > 0) squares += found.rms * found.rms * static_cast<double>(found.samples);
      out.samples.holes += found.holes;
      out.samples.samples += found.samples;
      out.px_max = std::fmax(out.px_max, sample_error_px(part, part_grid, drawn, in_view));
      if (!earlier) return;
      const DrawnSurface from = rasterize(part, part_grid, *earlier, nullptr);
      out.pop_px_max = std::fmax(out.pop_px_max, surface_jump(part, part_grid, from, drawn, in_view));
    });
    out.samples.max = max;
    out.samples.rms = std::sqrt(squares / static_cast<double>(out.samples.samples));
    return out;
  });
}

const SampleError& Measurement::samples() {
  if (!in_memory()) return by_rows().samples;
  return kept(samples_, [&] { return sample_error(field(), surface()); });
}

double Measurement::measured_px_max() {
  if (!in_memory()) return by_rows().px_max;
  return kept(px_max_, [&] {
    return sample_error_px(field(), grid(), surface(), instrument_->in_view(subject_.camera));
  });
}

double Measurement::pop_px_max() {
  if (!in_memory()) return by_rows().pop_px_max;
  const DrawnSurface* from = before();
  return from == nullptr
             ? kUndefined
             : surface_jump(field(), grid(), *from, surface(), instrument_->in_view(subject_.camera));
}

std::vector<NodeError> Measurement::node_errors() {
  if (in_memory()) {
    surface();
  } else {
    by_rows();
  }
  return worst_of_nodes(whole(), worst_of_triangle_);
}

// Figures of the triangles themselves -----------------------------------------------------------------------

int64_t Measurement::crack_edges() { return lodlab::instrument::crack_edges(grid(), whole()); }

const Orientation& Measurement::orientation() {
  return kept(orientation_, [&] { return lodlab::instrument::orientation(grid(), whole()); });
}

int64_t Measurement::raised_filler_triangles() {
  if (!in_memory() && !has_fillers(whole())) return 0;
  return raised_fillers(field(), grid(), surface(), whole());
}

// Figures over pixels ---------------------------------------------------------------------------------------

const PixelError& Measurement::pixels() {
  return kept(pixels_, [&] {
    if (subject_.reference == nullptr) return PixelError{};
    return pixel_error(field(), grid(), surface(), subject_.reference->shade, subject_.camera);
  });
}

double Measurement::pop_area() {
  if (subject_.reference == nullptr) return kUndefined;
  const DrawnSurface* from = before();
  if (from == nullptr) return kUndefined;
  return jumping_share(field(), grid(), *from, surface(), subject_.reference->shade, subject_.camera);
}

std::vector<float> Measurement::error_px() {
  return error_picture(field(), grid(), surface(), drawn(), subject_.camera);
}

/// Two empty pictures are no agreement.
bool Measurement::compares() {
  if (subject_.reference == nullptr) return false;
  const auto shows = [](const render::Picture& picture) {
    return std::any_of(picture.depth.begin(), picture.depth.end(), [](float d) { return std::isfinite(d); });
  };
  return shows(subject_.reference->shade) || shows(drawn());
}

double Measurement::psnr_db() {
  return compares() ? lodlab::instrument::psnr_db(drawn(), subject_.reference->shade) : kUndefined;
}

double Measurement::ssim() {
  return compares() ? lodlab::instrument::ssim(drawn(), subject_.reference->shade) : kUndefined;
}

double Measurement::flip() {
  return compares() ? lodlab::instrument::flip(seen(drawn()), subject_.reference->seen()) : kUndefined;
}

double Measurement::drawn_triangles() {
  return subject_.pictures ? static_cast<double>(drawn().triangles) : kUndefined;
}

/// The capture that everything above is measured on, drawn again from a plain buffer: inside the frustum it
/// must be what was drawn with culling.
double Measurement::capture_mismatch_pixels() {
  if (!subject_.pictures) return kUndefined;
  const render::Picture again = render::replay(whole(), subject_.camera, *resources_, render::Show::kShade);
  return static_cast<double>(depth_mismatch_pixels(drawn(), again));
}

const CrackPixels& Measurement::cracks() {
  return kept(cracks_, [&]() -> CrackPixels {
    if (subject_.reference == nullptr) return {};
    const Camera camera = with_margin(subject_.camera);
    const render::Picture& wanted = subject_.reference->classes;
    double error_px =
        std::fmax(pixels().finite_max, pixel_error(field(), grid(), surface(), wanted, camera).finite_max);
    const auto classes = [&](const Camera& from) {
      return render::draw_picture(from, render::Show::kClass, subject_.draw, false);
    };
    render::Picture picture = classes(camera);
    const auto found = [&] {
      return lodlab::instrument::crack_pixels(picture, wanted, subject_.camera.width, subject_.camera.height,
                                              error_px);
    };
    CrackPixels out = found();
    for (int i = 0; i < 4 && out.pixels > 0; ++i) {
      const double right = i % 2 == 0 ? kNudge : -kNudge, down = i / 2 == 0 ? kNudge : -kNudge;
      take_back_slivers(picture, classes(nudged(camera, right, down)));
      out = found();
    }
    if (out.pixels > 0) {  // what moved into sight may hide what did not
      error_px = std::fmax(error_px, finite_max(this->error_px()));
      out = found();
    }
    const glm::dvec3 up = up_at(grid(), glm::dvec3(0.0), subject_.camera.eye);
    if (out.pixels > 0 && !stands_free(whole(), camera, up)) out.pixels = kUndefined;
    return out;
  });
}

}  // namespace lodlab::instrument
