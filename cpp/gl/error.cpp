// SPDX-License-Identifier: MIT
#include "gl/error.h"

#include <epoxy/gl.h>

#include "base/errors.h"

namespace lodlab::gl {
namespace {

std::string message;  // of the first error since the last check

void GLAPIENTRY note_error(GLenum, GLenum type, GLuint, GLenum, GLsizei length, const GLchar* text,
                           const void*) {
  if (type != GL_DEBUG_TYPE_ERROR || detail::error_pending) return;
  detail::error_pending = true;
  message.assign(text, length >= 0 ? static_cast<size_t>(length) : std::char_traits<char>::length(text));
}

}  // namespace

namespace detail {

bool error_pending = false;

void throw_pending(const char* call) {
  error_pending = false;
  while (!message.empty() && (message.back() == '\n' || message.back() == ' ')) message.pop_back();
  throw GLError(std::string(call) + " failed: " + message);
}

}  // namespace detail

void install_debug_callback() {
  glEnable(GL_DEBUG_OUTPUT);
  glEnable(GL_DEBUG_OUTPUT_SYNCHRONOUS);
  glDebugMessageCallback(note_error, nullptr);
  glDebugMessageControl(GL_DONT_CARE, GL_DONT_CARE, GL_DONT_CARE, 0, nullptr, GL_FALSE);
  glDebugMessageControl(GL_DONT_CARE, GL_DEBUG_TYPE_ERROR, GL_DONT_CARE, 0, nullptr, GL_TRUE);
}

void clear_error() { detail::error_pending = false; }

}  // namespace lodlab::gl
