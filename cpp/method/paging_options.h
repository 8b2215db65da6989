// SPDX-License-Identifier: MIT
// The draw options of methods that page: `stream`, `cpu_cache_mb`, `gpu_cache_mb`, `fetch_delay_ms`.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include "base/options.h"

namespace lodlab {

struct PagingOptions {
  bool stream;
  int64_t cpu_bytes, gpu_bytes;
  std::chrono::milliseconds fetch_delay;
};

/// Their values.
PagingOptions paging_of(const Options& options);

/// What a method says of them: what it loads while flying, what it keeps where.
struct PagingHelp {
  std::string stream, cpu_cache, gpu_cache;
};

/// Adds them to a method's table.
void add_paging_options(std::vector<OptionSpec>& table, const PagingHelp& help);

}  // namespace lodlab
