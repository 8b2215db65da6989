// SPDX-License-Identifier: MIT
// How far the pieces of patches are from the samples that they cover: the vertical distance at every sample,
// for the tile of an edge and the halves of strips on its side, at each resolution and beside every finer
// diagonal.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "geometry/height_rows.h"
#include "methods/seamless/layout.h"
#include "methods/seamless/mesh.h"
#include "methods/seamless/pyramid.h"

namespace lodlab::seamless {

/// For each patch, edge and resolution the largest distance on the patch's own side of the edge. At its
/// finest a patch is drawn as its children at their coarsest are, cell by cell: there nothing is measured but
/// at the last level.
struct PatchErrors {
  explicit PatchErrors(const Layout& layout)
      : resolutions(layout.resolutions), values(static_cast<size_t>(layout.patches() * 4 * resolutions)) {}

  float& at(int64_t id, Edge e, int k) { return values[static_cast<size_t>((id * 4 + e) * resolutions + k)]; }
  float at(int64_t id, Edge e, int k) const {
    return values[static_cast<size_t>((id * 4 + e) * resolutions + k)];
  }

  int resolutions;
  std::vector<float> values;
};

/// Rows [first, end) of a patch: what is measured at once.
struct Share {
  Patch patch;
  int64_t first, end;
};

/// Holds scratch memory: one a thread.
class Measurer {
 public:
  Measurer(const Layout& layout, const PatchMesh& mesh, const Pyramid& pyramid);
  ~Measurer();

  /// Raises the errors of a patch by what its samples in these rows say, for resolutions [least, end).
  /// Rounded up. Threads may measure rows of one patch at once: what comes of all shares is the same.
  void measure(const HeightRows& rows, const Share& share, int least, int end, PatchErrors& out);

 private:
  struct Scratch;
  std::unique_ptr<Scratch> scratch_;
};

}  // namespace lodlab::seamless
