// SPDX-License-Identifier: MIT
// The only file that touches OpenImageIO.
#include "imageio/image.h"

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <memory>
#include <vector>

#include "base/errors.h"

namespace lodlab {
namespace {

constexpr int64_t kMaxSamples = int64_t{1} << 31;

std::unique_ptr<OIIO::ImageInput> open_image(const std::string& path) {
  auto input = OIIO::ImageInput::open(path);
  if (!input) {
    const std::string why = OIIO::geterror();
    throw InvalidInput("read_image: cannot read " + path + ": " + (why.empty() ? "not a picture" : why));
  }
  const OIIO::ImageSpec& spec = input->spec();
  if (spec.depth > 1 || spec.deep) throw InvalidInput("read_image: " + path + " is not a flat picture");
  const int64_t pixels = int64_t{spec.width} * spec.height;
  if (spec.nchannels < 1 || pixels < 1 || pixels > kMaxSamples / spec.nchannels) {
    throw InvalidInput("read_image: " + path + " has " + std::to_string(spec.width) + " x " +
                       std::to_string(spec.height) + " x " + std::to_string(spec.nchannels) +
                       " samples; 1 to 2^31 are possible");
  }
  return input;
}

template <class T>
ImageOf<T> read_as(OIIO::ImageInput& input, const std::string& path, OIIO::TypeDesc type) {
  const OIIO::ImageSpec spec = input.spec();
  ImageOf<T> out{spec.width, spec.height, spec.nchannels, {}};
  out.samples.resize(static_cast<size_t>(spec.width) * spec.height * spec.nchannels);
  if (!input.read_image(0, 0, 0, spec.nchannels, type, out.samples.data())) {
    throw InvalidInput("read_image: " + path + " is damaged or cut short: " + input.geterror());
  }
  return out;
}

}  // namespace

Image read_image(const std::string& path) {
  const auto input = open_image(path);
  switch (input->spec().format.basetype) {
    case OIIO::TypeDesc::UINT8:
      return read_as<uint8_t>(*input, path, OIIO::TypeDesc::UINT8);
    case OIIO::TypeDesc::UINT16:
      return read_as<uint16_t>(*input, path, OIIO::TypeDesc::UINT16);
    case OIIO::TypeDesc::HALF:
    case OIIO::TypeDesc::FLOAT:
    case OIIO::TypeDesc::DOUBLE:
      return read_as<float>(*input, path, OIIO::TypeDesc::FLOAT);
    default:
      throw InvalidInput("read_image: " + path + " holds samples of type " + input->spec().format.c_str() +
                         "; uint8, uint16, half, float and double are read");
  }
}

ImageU8 read_rgba8(const std::string& path) {
  const auto input = open_image(path);
  const ImageU8 in = read_as<uint8_t>(*input, path, OIIO::TypeDesc::UINT8);
  const bool grey = in.channels < 3;
  const int alpha = grey ? (in.channels == 2 ? 1 : -1) : (in.channels > 3 ? 3 : -1);
  ImageU8 out{in.width, in.height, 4, {}};
  const size_t pixels = static_cast<size_t>(in.width) * in.height;
  out.samples.resize(pixels * 4);
  for (size_t i = 0; i < pixels; ++i) {
    const uint8_t* from = in.samples.data() + i * in.channels;
    uint8_t* to = out.samples.data() + i * 4;
    for (int k = 0; k < 3; ++k) to[k] = from[grey ? 0 : k];
    to[3] = alpha < 0 ? uint8_t{255} : from[alpha];
  }
  return out;
}

namespace {

[[noreturn]] void fail_to_write(const std::string& path, const std::string& why) {
  throw StoreError("write_image: " + path + ": " + why);
}

void write_bytes(const std::string& path, const std::vector<unsigned char>& bytes) {
  std::FILE* file = std::fopen(path.c_str(), "wb");
  if (file == nullptr) fail_to_write(path, std::strerror(errno));
  const bool written = std::fwrite(bytes.data(), 1, bytes.size(), file) == bytes.size();
  int reason = written ? 0 : errno;
  if (std::fclose(file) != 0 && reason == 0) reason = errno;
  if (written && reason == 0) return;
  std::remove(path.c_str());
  fail_to_write(path, std::strerror(reason));
}

}  // namespace

void write_image(const std::string& path, const ImageU8& image) {
  auto output = OIIO::ImageOutput::create(path);
  if (!output) fail_to_write(path, OIIO::geterror());
  // Into memory where the format can: some encoders do not notice that the disk is full.
  OIIO::Filesystem::IOVecOutput memory;
  const bool buffered = output->supports("ioproxy") != 0;
  const OIIO::ImageSpec spec(image.width, image.height, image.channels, OIIO::TypeDesc::UINT8);
  if (buffered) output->set_ioproxy(&memory);
  if (!output->open(path, spec)) fail_to_write(path, output->geterror());
  if (!output->write_image(OIIO::TypeDesc::UINT8, image.samples.data()) || !output->close()) {
    fail_to_write(path, output->geterror());
  }
  if (buffered) write_bytes(path, memory.buffer());
}

std::string image_library_version() {
  const int version = OIIO::openimageio_version();
  return std::to_string(version / 10000) + "." + std::to_string(version / 100 % 100) + "." +
         std::to_string(version % 100);
}

}  // namespace lodlab
