// SPDX-License-Identifier: MIT
#include "method/pools.h"

#include <algorithm>

namespace lodlab {

int64_t least_of(const std::vector<Pool>& pools) {
  int64_t sum = 0;
  for (const Pool& pool : pools) sum += pool.least * pool.slot;
  return sum;
}

void part_room(int64_t room, std::vector<Pool>& pools) {
  room -= least_of(pools);
  std::vector<Pool*> order;
  for (Pool& pool : pools) order.push_back(&pool);
  const auto open = [](const Pool* pool) { return (pool->count - pool->least) * pool->slot; };
  std::stable_sort(order.begin(), order.end(),
                   [&](const Pool* a, const Pool* b) { return open(a) < open(b); });
  auto left = static_cast<int64_t>(order.size());
  for (Pool* pool : order) {
    pool->capacity = (pool->least + std::min(open(pool), room / left--) / pool->slot) * pool->slot;
    room -= pool->capacity - pool->least * pool->slot;
  }
}

}  // namespace lodlab
