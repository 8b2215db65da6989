// SPDX-License-Identifier: MIT
#include "gl/texture.h"

#include <epoxy/gl.h>

#include "gl/error.h"

namespace lodlab::gl {

Texture::Texture(unsigned target, int width, int height) : width_(width), height_(height) {
  ensure_context();
  unsigned name = 0;
  glCreateTextures(target, 1, &name);
  handle_ = Handle<Kind::kTexture>(name);
}

Texture Texture::target(unsigned format, int width, int height) {
  Texture texture(GL_TEXTURE_2D, width, height);
  glTextureStorage2D(texture.id(), 1, format, width, height);
  check("glTextureStorage2D");
  return texture;
}

Texture Texture::array(unsigned format, int width, int height, int layers, int levels) {
  Texture texture(GL_TEXTURE_2D_ARRAY, width, height);
  const unsigned name = texture.id();
  glTextureStorage3D(name, levels, format, width, height, layers);
  glTextureParameteri(name, GL_TEXTURE_MIN_FILTER, levels > 1 ? GL_LINEAR_MIPMAP_LINEAR : GL_LINEAR);
  glTextureParameteri(name, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
  glTextureParameteri(name, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
  glTextureParameteri(name, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
  check("glTextureStorage3D");
  return texture;
}

void Texture::upload_rgba(int level, int layer, int x, int y, int width, int height, const void* pixels) {
  glTextureSubImage3D(id(), level, x, y, layer, width, height, 1, GL_RGBA, GL_UNSIGNED_BYTE, pixels);
  check("glTextureSubImage3D");
}

void Texture::make_mips() {
  glGenerateTextureMipmap(id());
  check("glGenerateTextureMipmap");
}

void Texture::bind(unsigned unit) const {
  glBindTextureUnit(unit, id());
  check("glBindTextureUnit");
}

}  // namespace lodlab::gl
