// SPDX-License-Identifier: MIT
// Pages of 4-byte samples (heights, colours), coded without loss by meshoptimizer's vertex codec.
#pragma once

#include <cstdint>

#include "store/store.h"

namespace lodlab {

/// A code for `count` values of 4 bytes, and back. StoreError when the bytes are not such a code.
Bytes encode_samples(const void* values, int64_t count);
void decode_samples(const Bytes& bytes, void* values, int64_t count);

}  // namespace lodlab
