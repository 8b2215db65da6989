// SPDX-License-Identifier: MIT
// The one GL context of this process: 4.5 core, no window, created when first needed, bound to the thread
// that made it; when that one has ended, to the next thread that asks. Use from another thread while its own
// lives, or after fork, is a GLError.
#pragma once

#include <cstdint>
#include <string>

namespace lodlab::gl {

struct Info {
  std::string vendor, renderer, version;
  std::string device;  ///< name of the EGL device
  int device_index = 0;
  bool software = false;              ///< a rasterizer on the CPU: GPU timers say little
  int max_width = 0, max_height = 0;  ///< largest viewport
  int max_texture = 0;                ///< largest side of a texture
};

/// Sets the device for this process: auto, software, cuda:N, N. InvalidInput for another text; GLError
/// when there is no such device, or when the process already draws on another one.
void choose_device(const std::string& text);

/// Creates the context on this thread, takes it over from a thread that has ended, or checks that it belongs
/// to this thread and process.
const Info& ensure_context();

/// True when GL may be called here and now: the context exists and belongs to this thread and process.
bool context_is_here() noexcept;

/// Deletes a GL object now, or, when this is not the context's thread, at its next ensure_context().
/// Does nothing after fork.
enum class Kind : uint8_t { kBuffer, kTexture, kFramebuffer, kQuery, kVertexArray, kProgram };
void release(Kind kind, unsigned name) noexcept;

}  // namespace lodlab::gl
