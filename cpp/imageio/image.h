// SPDX-License-Identifier: MIT
// Pictures and rasters through OpenImageIO, the one room that knows it: 16-bit PNG, EXR, TIFF and the like.
// Rows run from top to bottom, channels are interleaved.
#pragma once

#include <cstdint>
#include <string>
#include <variant>
#include <vector>

namespace lodlab {

template <class T>
struct ImageOf {
  int width = 0, height = 0, channels = 0;
  std::vector<T> samples;  ///< height x width x channels
};

using ImageU8 = ImageOf<uint8_t>;
using ImageU16 = ImageOf<uint16_t>;
using ImageF32 = ImageOf<float>;

/// In the type of the file: 8 and 16 bits stay, everything else becomes float.
using Image = std::variant<ImageU8, ImageU16, ImageF32>;

/// Reads the first picture of a file. InvalidInput names the path and the reason.
Image read_image(const std::string& path);

/// The same as colours: 4 channels of 8 bits; grey is spread to RGB, missing alpha is opaque.
ImageU8 read_rgba8(const std::string& path);

/// Writes 8-bit channels; the format follows the extension. StoreError names the path and the reason.
void write_image(const std::string& path, const ImageU8& image);

/// The library's version, as "2.4.7".
std::string image_library_version();

}  // namespace lodlab
