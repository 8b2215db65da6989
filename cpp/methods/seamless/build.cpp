// SPDX-License-Identifier: MIT
// Build of seamless: the heights of patches as pages, and how far each patch at each resolution is from the
// source. No GL.
//
// Rows go by twice: for the heights of coarse lattices (pyramid.h), then for pages and errors; with
// `finest_error` a pass between the two finds the last level's stride. A field in memory is one band, a
// windowed one goes by in bands that hold every patch with a stride below four samples whole; larger patches
// are measured a share of their rows at a time.
#include <algorithm>
#include <atomic>
#include <bit>
#include <optional>
#include <string>

#include "base/errors.h"
#include "base/parallel.h"
#include "method/map_build.h"
#include "method/maps_option.h"
#include "method/sample_code.h"
#include "methods/seamless/closure.h"
#include "methods/seamless/measure.h"
#include "methods/seamless/pyramid.h"
#include "methods/seamless/seamless.h"
#include "methods/seamless/squares.h"

namespace lodlab::seamless {
namespace {

/// No patch with a stride below four samples is higher: each lies in one band.
constexpr int64_t kBand = 256;

struct Shape {
  int patch_log2, resolutions;
};

/// About sixteen patches of the last level along the longer side, of 16 to 64 segments.
int64_t chosen_patch(const FieldFrame& frame) {
  const auto share = static_cast<uint64_t>((std::max(frame.rows, frame.cols) - 1) / 16);
  return std::clamp<int64_t>(static_cast<int64_t>(std::bit_floor(share)), 16, 64);
}

Shape shape_of(const Options& options, const FieldFrame& frame) {
  const int64_t given = options.integer("patch"), patch = given == 0 ? chosen_patch(frame) : given;
  const auto resolutions = static_cast<int>(options.integer("resolutions"));
  if (!std::has_single_bit(static_cast<uint64_t>(patch))) {
    throw InvalidInput("seamless: option patch = " + std::to_string(patch) + " is not a power of two");
  }
  if (patch < (2 << (resolutions - 1))) {
    throw InvalidInput("seamless: option patch = " + std::to_string(patch) + " is below the limit of " +
                       std::to_string(2 << (resolutions - 1)) +
                       " segments with resolutions = " + std::to_string(resolutions));
  }
  return {std::countr_zero(static_cast<uint64_t>(patch)), resolutions};
}

/// Rows [first, end) whose share of the work is done at once; the row before and two beyond are there.
struct Band {
  int64_t first, end;
};

std::vector<Band> bands_of(const FieldSource& field) {
  const int64_t rows = field.rows, step = field.whole() != nullptr ? rows : kBand;
  std::vector<Band> out;
  for (int64_t first = 0; first < rows - 1; first += step)
    out.push_back({first, first + step < rows - 1 ? first + step : rows});
  return out;
}

HeightRows read(const FieldSource& field, const Band& band, RowBuffer& buffer) {
  return field.read(std::max<int64_t>(band.first - 1, 0), std::min(band.end + 2, field.rows), buffer);
}

/// The patches of levels from `least` on that meet a band, each with its rows there, kBand of them at most.
/// The last row of a patch belongs to it as well as to the next one.
std::vector<Share> shares_of(const Layout& layout, const Band& band, int least) {
  std::vector<Share> shares;
  for (int64_t first = band.first; first < std::min(band.end, layout.last_row()); first += kBand) {
    const int64_t end = std::min(first + kBand, band.end);
    for (int level = layout.levels - 1; level >= least; --level) {
      const int side = layout.side_log2(level);
      for (int64_t y = first >> side; y < layout.down(level) && y << side < end; ++y) {
        for (int64_t x = 0; x < layout.across(level); ++x) {
          const Patch p{level, y, x};
          const int64_t last = layout.sample_row(p, layout.segments());
          shares.push_back({p, std::max(first, layout.row(p)), last <= end ? last + 1 : end});
        }
      }
    }
  }
  return shares;
}

/// Calls work(measurer, share) in parallel.
template <class Work>
void for_shares(const Layout& layout, const PatchMesh& mesh, const Pyramid& pyramid,
                const std::vector<Share>& shares, const Progress& progress, const Work& work) {
  const auto count = static_cast<int64_t>(shares.size());
  Count done(progress, "patches", count);
  parallel_for(count, std::clamp<int64_t>(count / 256, 1, 16), [&](int64_t begin, int64_t end) {
    Measurer measurer(layout, mesh, pyramid);
    for (int64_t i = begin; i < end; ++i) work(measurer, shares[static_cast<size_t>(i)]);
    done(end - begin);
  });
}

Bytes page_of(const Pyramid& pyramid, const HeightRows& rows, const Layout& layout, const Patch& p) {
  std::vector<float> heights(static_cast<size_t>(page_samples(layout, pyramid.averaged())));
  float* out = heights.data();
  const int least = pyramid.averaged() ? 0 : layout.resolutions - 1;
  for (int k = layout.resolutions - 1; k >= least; --k) {
    pyramid.fill(rows, layout, p, k, out);
    const int64_t side = (layout.segments() >> (layout.resolutions - 1 - k)) + 1;
    out += side * side;
  }
  return encode_samples(heights.data(), static_cast<int64_t>(heights.size()));
}

/// Reports work that goes from one share of the whole to another.
Progress part_of(const Progress& progress, size_t part, size_t parts) {
  return [progress, part, parts](const std::string& stage, double share) {
    if (progress) progress(stage, (static_cast<double>(part) + share) / static_cast<double>(parts));
  };
}

/// How many resolutions of a level are measured: the finest is that of the next level's coarsest, or exact.
int measured_of(const Layout& layout, int level) {
  const bool finest = level + 1 == layout.levels && layout.finest_log2 > 0;
  return layout.resolutions - (finest ? 0 : 1);
}

class Builder {
 public:
  Builder(const FieldSource& field, const Options& options, const Progress& progress)
      : field_(field),
        shape_(shape_of(options, field)),
        steps_(bands_of(field)),
        options_(options),
        finest_error_(options.real("finest_error")),
        parts_(steps_.size() * (finest_error_ > 0.0 ? 3 : 2)),
        progress_(progress),
        mesh_(shape_.patch_log2, shape_.resolutions),
        pyramid_(field, options.text("pyramid") == "average") {}

  void run(StoreWriter& writer) {
    for (const Band& band : steps_) {
      pyramid_.take(read(field_, band, buffer_), band.first, band.end);
      next_part()("heights", 1.0);
    }
    pyramid_.finish();
    const Layout layout = layout_with(finest_log2());
    if (const std::string& file = options_.text("attribute"); !file.empty())
      put_colors(file, field_, map_user(layout), writer, progress_);
    std::optional<NormalsWriter> normals;
    if (has_normals(options_)) normals.emplace(field_, map_user(layout), writer);
    PatchErrors errors(layout);
    for (const Band& band : steps_) {
      const HeightRows rows = read(field_, band, buffer_);
      if (normals) normals->take(rows, band.end, progress_);
      for_shares(layout, mesh_, pyramid_, shares_of(layout, band, 0), next_part(),
                 [&](Measurer& measurer, const Share& share) {
                   const int64_t id = layout.id(share.patch);
                   if (share.first == layout.row(share.patch) && !writer.has_page(kHeights, id))
                     writer.put_page(kHeights, id, page_of(pyramid_, rows, layout, share.patch));
                   measurer.measure(rows, share, 0, measured_of(layout, share.patch.level), errors);
                 });
    }
    const Closed closed = close_errors(layout, make_levels(layout, field_), errors);
    writer.put_array("layout", as_bytes(std::vector<int32_t>{layout.patch_log2, layout.resolutions,
                                                             layout.finest_log2, layout.levels}));
    writer.put_array("codes", as_bytes(closed.codes));
    writer.put_array("scales", as_bytes(std::vector<double>{closed.largest_weight, closed.last_error}));
    writer.put_array("typical", as_bytes(closed.typical));
    writer.put_meta("pyramid", pyramid_.averaged() ? "average" : "vertex");
  }

 private:
  Layout layout_with(int finest_log2) const {
    return make_layout(field_, shape_.patch_log2, shape_.resolutions, finest_log2);
  }
  Progress next_part() {
    ++part_;
    return part_of(progress_, part_ - 1, parts_);
  }

  /// The coarsest stride of the last level whose error over the whole field is within `finest_error`; none
  /// coarser than that with which one patch covers the field. Strides that are beyond it are left early.
  int finest_log2() {
    if (!(finest_error_ > 0.0)) return 0;
    int most = 0;
    while (layout_with(most).levels > 1) ++most;
    std::vector<uint8_t> within(static_cast<size_t>(most + 1), 1);
    for (const Band& band : steps_) {
      const HeightRows rows = read(field_, band, buffer_);
      const Progress progress = next_part();
      for (int a = 1; a <= most; ++a) {
        if (within[static_cast<size_t>(a)] == 0) continue;
        const Layout layout = layout_with(a);
        PatchErrors errors(layout);
        std::atomic<bool> beyond = false;
        const Progress part = part_of(progress, static_cast<size_t>(a - 1), static_cast<size_t>(most));
        for_shares(layout, mesh_, pyramid_, shares_of(layout, band, layout.levels - 1), part,
                   [&](Measurer& measurer, const Share& share) {
                     if (beyond) return;
                     measurer.measure(rows, share, layout.resolutions - 1, layout.resolutions, errors);
                     for (const Edge e : {kNorth, kEast, kSouth, kWest}) {
                       if (errors.at(layout.id(share.patch), e, layout.resolutions - 1) > finest_error_)
                         beyond = true;
                     }
                   });
        if (beyond) within[static_cast<size_t>(a)] = 0;
      }
    }
    while (within[static_cast<size_t>(most)] == 0) --most;
    return most;
  }

  const FieldSource& field_;
  RowBuffer buffer_;
  const Shape shape_;
  const std::vector<Band> steps_;
  const Options& options_;
  const double finest_error_;
  const size_t parts_;
  const Progress& progress_;
  const PatchMesh mesh_;
  Pyramid pyramid_;
  size_t part_ = 0;
};

}  // namespace

void build(const FieldSource& field, const Options& options, StoreWriter& writer, const Progress& progress) {
  Builder(field, options, progress).run(writer);
  const Bytes coverage = field.coverage();
  if (!coverage.empty() && !writer.has_page(kCoverage, 0)) writer.put_page(kCoverage, 0, coverage);
}

}  // namespace lodlab::seamless
