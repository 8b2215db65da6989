// SPDX-License-Identifier: MIT
#include "gl/framebuffer.h"

#include <epoxy/gl.h>

#include <string>

#include "base/errors.h"
#include "gl/error.h"

namespace lodlab::gl {

Framebuffer::Framebuffer(int width, int height)
    : color_(Texture::target(GL_RGBA8, width, height)),
      depth_(Texture::target(GL_DEPTH_COMPONENT32F, width, height)) {
  unsigned name = 0;
  glCreateFramebuffers(1, &name);
  handle_ = Handle<Kind::kFramebuffer>(name);
  glNamedFramebufferTexture(name, GL_COLOR_ATTACHMENT0, color_.id(), 0);
  glNamedFramebufferTexture(name, GL_DEPTH_ATTACHMENT, depth_.id(), 0);
  check("glNamedFramebufferTexture");
  if (glCheckNamedFramebufferStatus(name, GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE) {
    throw GLError("framebuffer of " + std::to_string(width) + " x " + std::to_string(height) +
                  " pixels is not complete");
  }
}

void Framebuffer::bind() const {
  glBindFramebuffer(GL_FRAMEBUFFER, handle_.id());
  glViewport(0, 0, width(), height());
  check("glBindFramebuffer");
}

void Framebuffer::read_color(void* pixels) const {
  glBindFramebuffer(GL_FRAMEBUFFER, handle_.id());
  glReadPixels(0, 0, width(), height(), GL_RGBA, GL_UNSIGNED_BYTE, pixels);
  check("glReadPixels");
}

void Framebuffer::read_depth(void* depths) const {
  glBindFramebuffer(GL_FRAMEBUFFER, handle_.id());
  glReadPixels(0, 0, width(), height(), GL_DEPTH_COMPONENT, GL_FLOAT, depths);
  check("glReadPixels");
}

}  // namespace lodlab::gl
