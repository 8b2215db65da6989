// SPDX-License-Identifier: MIT
#include "method/paging_options.h"

namespace lodlab {

PagingOptions paging_of(const Options& options) {
  return {options.flag("stream"), options.integer("cpu_cache_mb") << 20,
          options.integer("gpu_cache_mb") << 20,
          std::chrono::milliseconds(options.integer("fetch_delay_ms"))};
}

void add_paging_options(std::vector<OptionSpec>& table, const PagingHelp& help) {
  using enum Stage;
  table.push_back({"stream", false, kDraw, "", help.stream, {}});
  table.push_back({"cpu_cache_mb", int64_t{256}, kDraw, "MiB", help.cpu_cache, {}, 1, 1 << 20});
  table.push_back({"gpu_cache_mb", int64_t{1024}, kDraw, "MiB", help.gpu_cache, {}, 1, 1 << 20});
  table.push_back({"fetch_delay_ms",
                   int64_t{0},
                   kDraw,
                   "ms",
                   "Delay of every read, to test slow storage.",
                   {},
                   0,
                   60000});
}

}  // namespace lodlab
