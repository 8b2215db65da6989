// SPDX-License-Identifier: MIT
// GL errors as exceptions. The driver reports errors synchronously through KHR_debug; the callback only
// notes the first one, and the next check() throws it with the name of the call that it follows.
// A check costs one comparison: there is no glGetError anywhere.
#pragma once

#include <string>

namespace lodlab::gl {

namespace detail {
extern bool error_pending;
[[noreturn]] void throw_pending(const char* call);
}  // namespace detail

/// Throws GLError when the driver reported an error since the last check. `call` names what was called.
inline void check(const char* call) {
  if (detail::error_pending) [[unlikely]]
    detail::throw_pending(call);
}

/// Installs the debug callback in the current context.
void install_debug_callback();

/// Forgets a reported error (destructors, tests).
void clear_error();

}  // namespace lodlab::gl
