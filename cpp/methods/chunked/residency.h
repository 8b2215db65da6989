// SPDX-License-Identifier: MIT
// What chunks need of memory, and how the GPU's is shared out between geometry and textures.
#pragma once

#include "method/residency.h"
#include "methods/chunked/hierarchy.h"

namespace lodlab::chunked {

struct Caches {
  bool stream;
  int64_t cpu_bytes, gpu_bytes;
  std::chrono::milliseconds fetch_delay;
};

/// stream=false: everything is resident from the first draw on; InvalidInput when that exceeds the GPU
/// budget. stream=true: InvalidInput when the budget cannot hold the roots and one set of children.
Residency make_residency(const std::shared_ptr<const ChunkedHierarchy>& hierarchy, const Caches& caches);

}  // namespace lodlab::chunked
