// SPDX-License-Identifier: MIT
// What chunks need of memory, and how the GPU's is shared out between geometry and textures.
#pragma once

#include "method/paging_options.h"
#include "method/residency.h"
#include "methods/chunked/hierarchy.h"

namespace lodlab::chunked {

/// How the caches are shared out.
struct Plan {
  Residency::Setup setup;
  int64_t most_pieces;  ///< chunks that one multi-draw has room for
};

/// GPU memory of a chunk in a multi-draw, beside its mesh and its texture.
constexpr int64_t kInstanceBytes = 24, kCommandBytes = 20;

/// stream=false: everything is resident from the first draw on; InvalidInput when that exceeds the GPU
/// budget. stream=true: InvalidInput when that cannot hold the roots and one set of children. Either: when
/// main memory cannot hold the largest chunk.
Plan make_plan(const std::shared_ptr<const ChunkedHierarchy>& hierarchy, const PagingOptions& caches);

}  // namespace lodlab::chunked
