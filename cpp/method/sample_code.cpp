// SPDX-License-Identifier: MIT
#include "method/sample_code.h"

#include <meshoptimizer.h>

#include <string>

#include "base/errors.h"

namespace lodlab {

Bytes encode_samples(const void* values, int64_t count) {
  const auto size = static_cast<size_t>(count);
  Bytes bytes(meshopt_encodeVertexBufferBound(size, 4));
  bytes.resize(meshopt_encodeVertexBuffer(reinterpret_cast<unsigned char*>(bytes.data()), bytes.size(),
                                          values, size, 4));
  return bytes;
}

void decode_samples(const Bytes& bytes, void* values, int64_t count) {
  const auto* code = reinterpret_cast<const unsigned char*>(bytes.data());
  if (meshopt_decodeVertexBuffer(values, static_cast<size_t>(count), 4, code, bytes.size()) != 0) {
    throw StoreError("store: a page of " + std::to_string(bytes.size()) + " bytes does not decode to " +
                     std::to_string(count) + " samples");
  }
}

}  // namespace lodlab
