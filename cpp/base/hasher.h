// SPDX-License-Identifier: MIT
// The hash of sources, stores and cuts: XXH3 of 128 bits, in pieces. For .cpp files: it brings the whole of
// xxhash.
#pragma once

#define XXH_INLINE_ALL
#include <xxhash.h>

#include <cstddef>
#include <cstdint>
#include <string>

namespace lodlab {

class Hasher {
 public:
  Hasher() { XXH3_128bits_reset(&state_); }
  void add(const void* data, size_t size) { XXH3_128bits_update(&state_, data, size); }
  XXH128_hash_t value() const { return XXH3_128bits_digest(&state_); }

  /// 32 hex digits.
  std::string text() const {
    const XXH128_hash_t hash = value();
    std::string out;
    for (const uint64_t half : {hash.high64, hash.low64})
      for (int shift = 60; shift >= 0; shift -= 4) out += "0123456789abcdef"[half >> shift & 15];
    return out;
  }

 private:
  XXH3_state_t state_;
};

}  // namespace lodlab
