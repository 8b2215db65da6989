// SPDX-License-Identifier: MIT
// What chunks need of memory, and how the GPU's is shared out between geometry and textures.
#pragma once

#include "method/paging_options.h"
#include "method/residency.h"
#include "methods/chunked/hierarchy.h"

namespace lodlab::chunked {

/// stream=false: everything is resident from the first draw on; InvalidInput when that exceeds the GPU
/// budget. stream=true: InvalidInput when the budget cannot hold the roots and one set of children.
Residency make_residency(const std::shared_ptr<const ChunkedHierarchy>& hierarchy,
                         const PagingOptions& caches);

}  // namespace lodlab::chunked
