// SPDX-License-Identifier: MIT
// subdivision: a control mesh whose faces are bisected each frame and displaced along its normals. METHOD.md
// says more.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "method/method.h"
#include "methods/subdivision/binding.h"
#include "methods/subdivision/bits.h"
#include "methods/subdivision/control_mesh.h"
#include "methods/subdivision/pattern.h"
#include "subdivision/refine.h"

namespace lodlab::subdivision {

/// The largest pattern that triangles of a frame are kept for: 2^5 + 1.
inline constexpr int kMostDoublings = 5;

/// Pages of a store: the control mesh, bounds, and heights, one page a group (pages.h).
enum PageKind : int { kVertices, kTriangles, kCodes, kHeights };

/// What a store holds of a source.
struct Stored {
  /// Row of the array "shape".
  struct Shape {
    double centre[3];     ///< of the source's box: what positions are relative to
    double lo[3], hi[3];  ///< of the source and of all that is drawn
    int64_t vertices, faces;
    int32_t degree, bits;
    uint32_t low_code;       ///< bits of the float that code 0 of bounds stands for
    int32_t reached_target;  ///< 0: no valid collapse remained
  };
  Shape shape;
  ControlMesh control;
  std::vector<float> heights;  ///< of all samples, as they decode
  /// levels() + 1 a face: codes of its bounds, the coarsest level first, then of its sampling error.
  std::vector<uint8_t> codes;

  double bound(int64_t face, int level) const;
  size_t codes_a_face() const { return static_cast<size_t>(Pattern::of_degree(shape.degree).levels()) + 1; }
};

/// A code that stands for no less than `bound`, above `low_code` (refine.h).
uint8_t code_above(uint32_t low_code, double bound);
/// The `low_code` with which the largest of all bounds has a code.
uint32_t low_code_for(double largest);

/// Faces as they are stored: with corners turned as the index codec turns them.
std::vector<Face> as_coded(const std::vector<Face>& faces, int64_t vertices);
void put(StoreWriter& writer, const Stored& stored, const PackedHeights& packed);
/// StoreError where pages are missing or are no such things.
Stored get(const Store& store);

/// Where each point of the pattern of a face lies: floats relative to the centre, at rest.
class Displaced {
 public:
  Displaced(const Samples& samples, const std::vector<float>& heights);
  /// Where a pose has the control mesh.
  Displaced at(const RestControl& rest, const PosedControl& posed) const;
  const Samples& samples() const { return samples_; }
  /// Of the points of a face, in the pattern's order.
  void of_face(int64_t face, std::span<vec3> out) const;
  const std::vector<float>& heights() const { return *heights_; }

 private:
  void place(const std::vector<Samples::Place>& places);

  const Samples& samples_;
  const std::vector<float>* heights_;
  std::vector<vec3> positions_;
};

/// What decides of faces and control edges under one pose of the control mesh.
struct Records {
  std::vector<FaceRecord> face;
  std::vector<LineRecord> edge;
};

/// A control mesh as a pose deforms it.
struct Posed {
  PosedControl control;
  Records records;
};

void build(const Source& source, const Options& options, StoreWriter& writer, const Progress& progress);

class SubdivisionHierarchy : public Hierarchy, public std::enable_shared_from_this<SubdivisionHierarchy> {
 public:
  explicit SubdivisionHierarchy(std::shared_ptr<const Store> store);

  std::vector<NodeInfo> nodes() const override;
  double quantum() const override { return 0.0; }
  int64_t vertices() const override { return samples_.count(); }
  std::string told() const override { return told_; }
  std::vector<glm::dvec3> control() const override { return rest_pose(*rest_); }
  std::shared_ptr<const Carrier> carrier(std::shared_ptr<const Mesh> source) const override {
    return std::make_shared<Binding>(rest_, std::move(source));
  }
  std::unique_ptr<Session> session(const Options& draw_options) const override;

  const std::shared_ptr<const Store>& store() const { return store_; }
  const Stored& stored() const { return stored_; }
  const Pattern& pattern() const { return samples_.pattern(); }
  const Samples& samples() const { return samples_; }
  const Displaced& displaced() const { return displaced_; }
  const Records& records() const { return records_; }
  const RestControl& rest() const { return *rest_; }
  glm::dvec3 centre() const {
    return {stored_.shape.centre[0], stored_.shape.centre[1], stored_.shape.centre[2]};
  }
  Box box() const;
  /// Faces on each control edge: two, or one on a border.
  std::span<const uint32_t> sides(int64_t edge) const { return samples_.edges().of(edge); }

 private:
  std::shared_ptr<const Store> store_;
  Stored stored_;
  Samples samples_;
  Displaced displaced_;
  Records records_;
  std::shared_ptr<const RestControl> rest_;
  std::string told_;
};

/// Of the control mesh where it was built.
Records records_at_rest(const Stored& stored, const Displaced& displaced);
/// Null where the pose is that at rest, else as it deforms the control mesh: bounds are scaled by the largest
/// stretch of each face's prism, which is no promise.
std::shared_ptr<const Posed> posed(const SubdivisionHierarchy& hierarchy, const Pose& pose);

std::unique_ptr<Session> make_session(std::shared_ptr<const SubdivisionHierarchy> hierarchy,
                                      const Options& options);

}  // namespace lodlab::subdivision
