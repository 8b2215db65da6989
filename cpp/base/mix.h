// SPDX-License-Identifier: MIT
// Well mixed bits, for noise that is a pure function of integers.
#pragma once

#include <cstdint>

namespace lodlab {

/// The finalizer of splitmix64.
inline uint64_t mix(uint64_t h) {
  h = (h ^ (h >> 30)) * 0xbf58476d1ce4e5b9ull;
  h = (h ^ (h >> 27)) * 0x94d049bb133111ebull;
  return h ^ (h >> 31);
}

}  // namespace lodlab
