// SPDX-License-Identifier: MIT
// A query around GL work, as GL_TIME_ELAPSED or GL_PRIMITIVES_GENERATED.
#pragma once

#include <cstdint>

#include "gl/handle.h"

namespace lodlab::gl {

class Query {
 public:
  Query() = default;
  /// `stream`: of vertices, where the target counts those of one.
  explicit Query(unsigned target, unsigned stream = 0);

  void begin() const;
  void end() const;
  /// Waits for the result: nanoseconds, or a count.
  uint64_t result() const;

 private:
  Handle<Kind::kQuery> handle_;
  unsigned target_ = 0, stream_ = 0;
};

}  // namespace lodlab::gl
