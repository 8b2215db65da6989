// SPDX-License-Identifier: MIT
// Build of seamless. Rows go by twice, in bands: first for the heights of coarse lattices (pyramid.h), then
// for the patches' pages. No GL.
#include <algorithm>
#include <bit>
#include <string>

#include "base/errors.h"
#include "base/parallel.h"
#include "method/sample_code.h"
#include "methods/seamless/pyramid.h"
#include "methods/seamless/seamless.h"

namespace lodlab::seamless {
namespace {

/// No patch with a stride below four samples is higher: each lies in one band.
constexpr int64_t kBand = 256;

struct Shape {
  int patch_log2, resolutions;
};

Shape shape_of(const Options& options) {
  const int64_t patch = options.integer("patch");
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

/// Calls work(rows, first, end) band by band; rows up to two beyond `end` are there.
template <class Work>
void for_bands(Bands& bands, const Work& work) {
  const int64_t rows = bands.frame().rows;
  for (int64_t first = 0; first < rows - 1; first += kBand) {
    const int64_t end = first + kBand < rows - 1 ? first + kBand : rows;
    work(bands.rows(first, std::min(first + kBand + 2, rows)), first, end);
  }
}

/// What is done at once: rows [first, end) of a patch.
struct Share {
  Patch patch;
  int64_t first, end;
};

std::vector<Share> shares_of(const Layout& layout, int64_t first, int64_t end) {
  std::vector<Share> shares;
  for (int level = layout.levels - 1; level >= 0; --level) {
    const int side = layout.side_log2(level);
    for (int64_t y = first >> side; y < layout.down(level) && y << side < end; ++y) {
      for (int64_t x = 0; x < layout.across(level); ++x) {
        const Patch p{level, y, x};
        const int64_t last = layout.sample_row(p, layout.segments());
        shares.push_back({p, std::max(first, layout.row(p)), last <= end ? last + 1 : end});
      }
    }
  }
  return shares;
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

}  // namespace

void build(Bands bands, const Options& options, StoreWriter& writer, const Progress& progress) {
  const Shape shape = shape_of(options);
  Pyramid pyramid(bands.frame(), options.text("pyramid") == "average");
  for_bands(bands,
            [&](const HeightRows& rows, int64_t first, int64_t end) { pyramid.take(rows, first, end); });
  pyramid.finish();
  const Layout layout = make_layout(bands.frame(), shape.patch_log2, shape.resolutions, 0);
  for_bands(bands, [&](const HeightRows& rows, int64_t first, int64_t end) {
    const std::vector<Share> shares = shares_of(layout, first, end);
    parallel_for(static_cast<int64_t>(shares.size()), 1, [&](int64_t from, int64_t to) {
      for (int64_t i = from; i < to; ++i) {
        const Share& share = shares[static_cast<size_t>(i)];
        const int64_t id = layout.id(share.patch);
        if (share.first == layout.row(share.patch) && !writer.has_page(kHeights, id))
          writer.put_page(kHeights, id, page_of(pyramid, rows, layout, share.patch));
      }
    });
    if (progress) progress("patches", static_cast<double>(end) / static_cast<double>(layout.rows));
  });
  const Bytes coverage = bands.coverage();
  if (!coverage.empty() && !writer.has_page(kCoverage, 0)) writer.put_page(kCoverage, 0, coverage);
  writer.put_array("layout", as_bytes(std::vector<int32_t>{layout.patch_log2, layout.resolutions,
                                                           layout.finest_log2, layout.levels}));
  writer.put_array("codes",
                   as_bytes(std::vector<uint16_t>(static_cast<size_t>(layout.first_edge(layout.levels)))));
  writer.put_array("scales", as_bytes(std::vector<double>{0.0, 0.0}));
  writer.put_array("typical",
                   as_bytes(std::vector<double>(static_cast<size_t>(layout.levels * layout.resolutions))));
  writer.put_meta("pyramid", options.text("pyramid"));
}

}  // namespace lodlab::seamless
