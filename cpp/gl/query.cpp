// SPDX-License-Identifier: MIT
#include "gl/query.h"

#include <epoxy/gl.h>

#include "gl/error.h"

namespace lodlab::gl {

Query::Query(unsigned target) : target_(target) {
  ensure_context();
  unsigned name = 0;
  glCreateQueries(target, 1, &name);
  handle_ = Handle<Kind::kQuery>(name);
  check("glCreateQueries");
}

void Query::begin() const {
  glBeginQuery(target_, handle_.id());
  check("glBeginQuery");
}

void Query::end() const {
  glEndQuery(target_);
  check("glEndQuery");
}

uint64_t Query::result() const {
  GLuint64 value = 0;
  glGetQueryObjectui64v(handle_.id(), GL_QUERY_RESULT, &value);
  check("glGetQueryObjectui64v");
  return value;
}

}  // namespace lodlab::gl
