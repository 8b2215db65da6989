// SPDX-License-Identifier: MIT
// Reference pictures: the source at full resolution, which cuts are compared with.
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>

#include "geometry/view.h"
#include "instrument/flip.h"
#include "instrument/ruler.h"
#include "render/frame.h"

namespace lodlab::instrument {

/// Sources above this many samples get no reference picture and no picture columns.
inline constexpr int64_t kMostPictureSamples = 32'000'000;

/// What the source at full resolution looks like in one view.
struct Reference {
  Camera camera;
  render::Picture shade;    ///< with depth
  render::Picture classes;  ///< Show::kClass, wider by a margin with depth, less voids: see crack_pixels.h
  std::shared_ptr<const void> pose{};  ///< what deformed the source; null: at rest

  /// What FLIP sees of `shade`; made by the first cut that is compared, for all others too.
  const Seen& seen() const;
  /// Bytes that all of it takes.
  int64_t bytes() const;

 private:
  mutable std::once_flag once_;
  mutable Seen seen_;
};

/// Draws the reference of a view; null above kMostPictureSamples.
std::shared_ptr<Reference> draw_reference(const Ruler& ruler, const Camera& camera,
                                          const render::DrawCall& draw_full);

}  // namespace lodlab::instrument
