// SPDX-License-Identifier: MIT
// The context is never destroyed: at the process's end drivers tear themselves down better than we could.
#include "gl/context.h"

#include <epoxy/egl.h>
#include <epoxy/gl.h>
#include <unistd.h>

#include <cstdlib>
#include <mutex>
#include <optional>
#include <utility>
#include <vector>

#include "base/errors.h"
#include "base/thread_key.h"
#include "gl/device.h"
#include "gl/egl.h"
#include "gl/error.h"

namespace lodlab::gl {
namespace {

struct Context {
  ThreadKey thread;
  pid_t process;
  Info info;
  EGLDisplay display;
  EGLContext handle;
};

std::mutex mutex;  // guards all below
std::optional<Context> context;
std::string chosen;
std::vector<std::pair<Kind, unsigned>> doomed;  // released on another thread

std::string choice() {
  if (!chosen.empty()) return chosen;
  const char* text = std::getenv("LODLAB_DEVICE");
  return text != nullptr && *text != '\0' ? text : "auto";
}

std::string text_of(GLenum name) {
  const auto* text = reinterpret_cast<const char*>(glGetString(name));
  return text != nullptr ? text : "";
}

EGLConfig any_config(EGLDisplay display) {
  const EGLint wanted[] = {EGL_SURFACE_TYPE, EGL_PBUFFER_BIT, EGL_RENDERABLE_TYPE, EGL_OPENGL_BIT, EGL_NONE};
  EGLConfig config = nullptr;
  EGLint count = 0;
  if (eglChooseConfig(display, wanted, &config, 1, &count) && count > 0) return config;
  return EGL_NO_CONFIG_KHR;
}

std::string egl_error() {
  char text[16];
  std::snprintf(text, sizeof text, "0x%04x", static_cast<unsigned>(eglGetError()));
  return text;
}

/// Makes a context on the device current on this thread. GLError says which step failed.
std::pair<EGLDisplay, EGLContext> make_current(const Device& device) {
  const auto fail = [&](const char* step) {
    throw GLError(std::string(step) + " failed on device " + std::to_string(device.index) + " (" +
                  device.name + "), EGL error " + egl_error());
  };
  const auto get_display = egl_function<PFNEGLGETPLATFORMDISPLAYEXTPROC>("eglGetPlatformDisplayEXT");
  EGLDisplay display = get_display(EGL_PLATFORM_DEVICE_EXT, device.handle, nullptr);
  if (display == EGL_NO_DISPLAY) fail("eglGetPlatformDisplayEXT");
  if (!eglInitialize(display, nullptr, nullptr)) fail("eglInitialize");
  if (!eglBindAPI(EGL_OPENGL_API)) fail("eglBindAPI(EGL_OPENGL_API)");
  const EGLint attributes[] = {EGL_CONTEXT_MAJOR_VERSION_KHR,
                               4,
                               EGL_CONTEXT_MINOR_VERSION_KHR,
                               5,
                               EGL_CONTEXT_OPENGL_PROFILE_MASK_KHR,
                               EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT_KHR,
                               EGL_CONTEXT_FLAGS_KHR,
                               EGL_CONTEXT_OPENGL_DEBUG_BIT_KHR,
                               EGL_NONE};
  EGLContext made = eglCreateContext(display, any_config(display), EGL_NO_CONTEXT, attributes);
  if (made == EGL_NO_CONTEXT) fail("eglCreateContext (OpenGL 4.5 core)");
  if (!eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, made)) {
    eglDestroyContext(display, made);
    fail("eglMakeCurrent without a surface");
  }
  return {display, made};
}

/// Lets go of the context when its thread ends: EGL leaves it with that thread for good. Not on the main
/// thread, whose end is the process's.
struct Parting {
  EGLDisplay display = EGL_NO_DISPLAY;
  ~Parting() {
    if (display != EGL_NO_DISPLAY && gettid() != getpid())
      eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
  }
};
thread_local Parting parting;

void take_over(Context& taken) {
  if (!eglBindAPI(EGL_OPENGL_API) ||
      !eglMakeCurrent(taken.display, EGL_NO_SURFACE, EGL_NO_SURFACE, taken.handle)) {
    throw GLError(
        "GL from another thread: the one that drew has ended, and its context cannot be taken over, EGL "
        "error " +
        egl_error());
  }
  taken.thread = ThreadKey::here();
}

Info read_info(const Device& device) {
  Info info;
  info.vendor = text_of(GL_VENDOR);
  info.renderer = text_of(GL_RENDERER);
  info.version = text_of(GL_VERSION);
  info.device = device.name;
  info.device_index = device.index;
  info.software = info.renderer.find("llvmpipe") != std::string::npos ||
                  info.renderer.find("softpipe") != std::string::npos ||
                  info.renderer.find("SWR") != std::string::npos;
  GLint viewport[2] = {0, 0}, renderbuffer = 0;
  glGetIntegerv(GL_MAX_VIEWPORT_DIMS, viewport);
  glGetIntegerv(GL_MAX_RENDERBUFFER_SIZE, &renderbuffer);
  glGetIntegerv(GL_MAX_TEXTURE_SIZE, &info.max_texture);
  info.max_width = std::min(viewport[0], renderbuffer);
  info.max_height = std::min(viewport[1], renderbuffer);
  return info;
}

/// State that no one changes afterwards.
void set_constant_state() {
  glClipControl(GL_LOWER_LEFT, GL_ZERO_TO_ONE);
  glPixelStorei(GL_PACK_ALIGNMENT, 1);
  glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
  check("setting up the GL context");
}

Context create() {
  const std::string wanted = choice();
  std::string reasons;
  for (const Device& device : candidates(wanted, devices())) {
    try {
      const auto [display, handle] = make_current(device);
      Info info = read_info(device);
      if (device.software && !info.software) {
        throw GLError("device " + device.name + " renders with '" + info.renderer +
                      "', which is no software renderer");
      }
      install_debug_callback();
      set_constant_state();
      return {ThreadKey::here(), getpid(), std::move(info), display, handle};
    } catch (const GLError& error) {
      reasons += (reasons.empty() ? "" : "; ") + std::string(error.what());
    }
  }
  throw GLError("device '" + wanted + "': no OpenGL 4.5 core context: " + reasons);
}

void delete_object(Kind kind, unsigned name) {
  switch (kind) {
    case Kind::kBuffer:
      glDeleteBuffers(1, &name);
      break;
    case Kind::kTexture:
      glDeleteTextures(1, &name);
      break;
    case Kind::kFramebuffer:
      glDeleteFramebuffers(1, &name);
      break;
    case Kind::kQuery:
      glDeleteQueries(1, &name);
      break;
    case Kind::kVertexArray:
      glDeleteVertexArrays(1, &name);
      break;
    case Kind::kProgram:
      glDeleteProgram(name);
      break;
  }
}

bool is_here() { return context && context->process == getpid() && context->thread.is_here(); }

}  // namespace

void choose_device(const std::string& text) {
  const std::vector<Device> found = candidates(text, devices());
  const std::lock_guard lock(mutex);
  if (context && context->process == getpid()) {
    for (const Device& device : found) {
      if (device.index == context->info.device_index) return;
    }
    throw GLError("device '" + text + "': this process already draws on device " +
                  std::to_string(context->info.device_index) + " (" + context->info.device +
                  "); choose before the first drawing, or start another process");
  }
  chosen = text;
}

const Info& ensure_context() {
  const std::lock_guard lock(mutex);
  if (!context) context = create();
  if (context->process != getpid()) {
    throw GLError(
        "GL after fork: the context belongs to the parent process; spawn processes instead of forking");
  }
  if (context->thread.ended()) take_over(*context);
  if (!context->thread.is_here()) {
    throw GLError(
        "GL from another thread: the context belongs to the thread that first drew; draw there, or end it "
        "first");
  }
  parting.display = context->display;
  for (const auto& [kind, name] : doomed) delete_object(kind, name);
  doomed.clear();
  return context->info;
}

bool context_is_here() noexcept {
  const std::lock_guard lock(mutex);
  return is_here();
}

void release(Kind kind, unsigned name) noexcept {
  if (name == 0) return;
  const std::lock_guard lock(mutex);
  if (is_here()) {
    delete_object(kind, name);
  } else if (context && context->process == getpid()) {
    doomed.emplace_back(kind, name);
  }
}

}  // namespace lodlab::gl
