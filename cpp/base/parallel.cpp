// SPDX-License-Identifier: MIT
#include "base/parallel.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <atomic>
#include <cstdlib>
#include <string>
#include <thread>

#include "base/errors.h"

namespace lodlab {
namespace {

std::atomic<int> g_override{0};

int from_environment() {
  const char* text = std::getenv("LODLAB_THREADS");
  if (text == nullptr || *text == '\0') return 0;
  char* end = nullptr;
  const long value = std::strtol(text, &end, 10);
  if (*end != '\0' || value < 1 || value > 1024) {
    throw InvalidInput(std::string("LODLAB_THREADS: '") + text + "' is not a number from 1 to 1024");
  }
  return static_cast<int>(value);
}

}  // namespace

int thread_count() {
  if (const int forced = g_override.load(); forced > 0) return forced;
  if (const int wanted = from_environment(); wanted > 0) return wanted;
  const unsigned cores = std::thread::hardware_concurrency();
  return cores > 0 ? static_cast<int>(cores) : 1;
}

void set_thread_count(int threads) {
  if (threads < 0 || threads > 1024) {
    throw InvalidInput("set_thread_count: " + std::to_string(threads) + " is not within 0 to 1024");
  }
  g_override = threads;
}

void parallel_for(int64_t count, int64_t grain, const std::function<void(int64_t, int64_t)>& body) {
  if (count <= 0) return;
  const int threads = thread_count();
  if (threads == 1) {
    for (int64_t begin = 0; begin < count; begin += grain) body(begin, std::min(count, begin + grain));
    return;
  }
  tbb::task_arena arena(threads);
  arena.execute([&] {
    tbb::parallel_for(
        tbb::blocked_range<int64_t>(0, count, static_cast<size_t>(grain)),
        [&](const tbb::blocked_range<int64_t>& range) { body(range.begin(), range.end()); },
        tbb::simple_partitioner());
  });
}

}  // namespace lodlab
