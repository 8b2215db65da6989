// SPDX-License-Identifier: MIT
#include "gl/query.h"

#include <epoxy/gl.h>

#include "gl/error.h"

namespace lodlab::gl {

Query::Query(unsigned target, unsigned stream) : target_(target), stream_(stream) {
  ensure_context();
  unsigned name = 0;
  glCreateQueries(target, 1, &name);
  handle_ = Handle<Kind::kQuery>(name);
  check("glCreateQueries");
}

void Query::begin() const {
  glBeginQueryIndexed(target_, stream_, handle_.id());
  check("glBeginQueryIndexed");
}

void Query::end() const {
  glEndQueryIndexed(target_, stream_);
  check("glEndQueryIndexed");
}

uint64_t Query::result() const {
  GLuint64 value = 0;
  glGetQueryObjectui64v(handle_.id(), GL_QUERY_RESULT, &value);
  check("glGetQueryObjectui64v");
  return value;
}

}  // namespace lodlab::gl
