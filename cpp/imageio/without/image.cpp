// SPDX-License-Identifier: MIT
// The same functions in a build without OpenImageIO: each says so.
#include "imageio/image.h"

#include "base/errors.h"

namespace lodlab {
namespace {

[[noreturn]] void refuse(const std::string& path) {
  throw Unsupported("pictures: this build has no OpenImageIO (LODLAB_OPENIMAGEIO=OFF) for " + path);
}

}  // namespace

Image read_image(const std::string& path) { refuse(path); }
ImageU8 read_rgba8(const std::string& path) { refuse(path); }
void write_image(const std::string& path, const ImageU8&) { refuse(path); }
std::string image_library_version() { return "none"; }

}  // namespace lodlab
