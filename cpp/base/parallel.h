// SPDX-License-Identifier: MIT
// Parallel loops over index ranges, on as many threads as LODLAB_THREADS says (default: all cores).
// Results never depend on the number of threads: bodies write to disjoint places or reduce in index order.
#pragma once

#include <cstdint>
#include <functional>

namespace lodlab {

/// Worker threads used by parallel_for: LODLAB_THREADS, else the number of cores, at least 1.
int thread_count();

/// Overrides LODLAB_THREADS for this process; 0 goes back to it.
void set_thread_count(int threads);

/// Calls body(begin, end) for disjoint ranges that cover [0, count), each about `grain` long.
/// The first exception thrown by a body is rethrown here once all have stopped.
void parallel_for(int64_t count, int64_t grain, const std::function<void(int64_t, int64_t)>& body);

}  // namespace lodlab
