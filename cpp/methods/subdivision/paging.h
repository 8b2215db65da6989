// SPDX-License-Identifier: MIT
// Which groups of control faces a frame wants on the GPU, and what becomes of the lines of those that are not
// there: they are never split, nor is a control edge of such a face. METHOD.md says more.
#pragma once

#include <cstdint>
#include <vector>

#include "method/paging_options.h"
#include "method/residency.h"
#include "methods/subdivision/pages.h"
#include "methods/subdivision/refine.h"

namespace lodlab::subdivision {

/// What of a selection depends on paging.
struct Loaded {
  std::vector<uint8_t> there;    ///< a flag for each group: its faces may be refined
  std::vector<uint32_t> lacked;  ///< groups that are wanted and not there
};

/// Records that let no line of a face be split whose group is not there, nor its control edges; nor do its
/// neighbours swap diagonals, which takes that all above them is split (METHOD.md).
Records held_back(Records records, int levels, const std::vector<uint8_t>& there);

/// Says what groups are worth.
class Groups {
 public:
  explicit Groups(const SubdivisionHierarchy& hierarchy);

  /// Those in sight, or beside one in sight, in which a line may want a split, most worthy first: by how many
  /// times nearer the eye is than that takes.
  std::vector<Residency::Want> wanted(const Lying& lying, const Uniforms& uniforms, const Camera& camera,
                                      const Step& step) const;

 private:
  const SubdivisionHierarchy& hierarchy_;
  std::vector<std::vector<uint32_t>> beside_;  ///< groups that share a control edge
};

/// What a session takes of the GPU: parts that are always there, and a slot a group.
struct Room {
  int64_t fixed, slot;
};
struct Plan {
  Residency::Setup setup;
  int64_t slots;
};
/// InvalidInput where the memory allowed is too little.
Plan make_plan(std::shared_ptr<const SubdivisionHierarchy> hierarchy, const PagingOptions& caches,
               const Room& room);

}  // namespace lodlab::subdivision
