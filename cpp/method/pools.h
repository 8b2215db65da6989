// SPDX-License-Identifier: MIT
// One budget of GPU memory parted among pages of several kinds, each kind of a size of its own.
#pragma once

#include <cstdint>
#include <vector>

namespace lodlab {

struct Pool {
  int64_t slot, count, least;  ///< bytes of a page; how many there are, and must fit
  int64_t capacity = 0;        ///< bytes: whole slots
};

/// Bytes that all pools need at least.
int64_t least_of(const std::vector<Pool>& pools);

/// Gives each pool its least and parts the rest of the room equally; what one has no use for goes to the
/// others. The room is at least least_of(pools).
void part_room(int64_t room, std::vector<Pool>& pools);

}  // namespace lodlab
