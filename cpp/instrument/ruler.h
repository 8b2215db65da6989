// SPDX-License-Identifier: MIT
// The ruler: what a source is measured with. It is made once for a source, takes the triangles that a cut
// drew, and answers how they lie on it. Measurement (measurement.h) knows sources by this alone, so that
// every column is written once; each kind of source has one: field_ruler.h.
//
// Points are relative to the eye of the capture, in source units. Virtual calls stand per figure or per row
// of pixels, never per sample.
#pragma once

#include <cstdint>
#include <functional>
#include <glm/glm.hpp>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "geometry/source.h"
#include "geometry/view.h"
#include "instrument/orientation.h"
#include "instrument/sample_error.h"
#include "render/frame.h"

namespace lodlab::instrument {

/// What is laid on the source: a cut as it is drawn for a view, captured when it is first asked for.
struct Shown {
  const Camera& camera;
  std::function<const render::Captured&()> now;
  std::function<render::Captured()> before;  ///< the cut of the frame before; may be empty
  std::string drawn_by;                      ///< for messages
  /// How far a node's surface may be from the source.
  NodeBound bound = [](uint32_t) { return 0.0; };
};

/// Where the points of a row correspond to, on another surface; NaN where they correspond to nothing.
using Correspondence = std::function<void(std::span<const glm::dvec3> points, std::span<glm::dvec3> out)>;

/// A cut that lies on its source. Figures are computed when first asked for; nan: undefined.
class Laid {
 public:
  virtual ~Laid() = default;

  /// Without projection: the whole cut.
  virtual const SampleError& samples() = 0;
  /// Both directions by themselves; nan where the source knows one only.
  virtual TwoSided two_sided() { return {}; }
  /// The largest screen distance, pixels, from a sample in view to its correspondent; inf at a hole.
  virtual double px_max() = 0;
  /// The largest screen distance, pixels, by which samples in view jump from the cut before to this one.
  virtual double jump_px_max() = 0;
  virtual std::vector<NodeError> node_errors() = 0;
  virtual std::optional<int64_t> raised_fillers() = 0;

  /// From points of the source to the drawn surface.
  virtual Correspondence to_drawn() = 0;
  /// The same to that of the cut before; empty where there is none.
  virtual Correspondence to_drawn_before() = 0;
  /// From points of the drawn surface to the source.
  virtual Correspondence to_source() = 0;
};

class Ruler {
 public:
  virtual ~Ruler() = default;

  virtual const Source& source() const = 0;
  /// What is shown must outlive what is laid. Figures throw InvalidInput for a drawn vertex that is not
  /// finite, naming method and node.
  virtual std::unique_ptr<Laid> lay(Shown shown) const = 0;

  /// Whether a sample may have no correspondent: what is missing shows as a hole there.
  virtual bool has_holes() const = 0;
  /// Directed edges without exactly one opposite, those on the source's own border left out, which `bound`
  /// moves.
  virtual int64_t crack_edges(const render::Captured& captured, const NodeBound& bound) const = 0;
  virtual Orientation orientation(const render::Captured& captured, const NodeBound& bound) const = 0;
  /// Whether the drawn surface leaves the eye free, so that its inside is seen through cracks alone.
  virtual bool stands_free(const render::Captured& captured, const Camera& camera) const = 0;
  /// Whether pictures of classes show voids as filled.
  virtual bool has_voids() const = 0;

  /// The eye of what is laid without a view: near all samples.
  virtual glm::dvec3 middle() const = 0;
  /// world_slack() at the sample of the source farthest from the eye.
  virtual double slack(const glm::dvec3& eye) const = 0;
  /// Refuses (InvalidInput) an eye so far away that neighbouring samples fall together: nothing can be told
  /// apart there.
  virtual void check_near(const glm::dvec3& eye) const = 0;
};

}  // namespace lodlab::instrument
