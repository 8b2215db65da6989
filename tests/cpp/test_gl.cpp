// SPDX-License-Identifier: MIT
// Devices, the one context and its thread, shader errors, buffers. Everything ends without a GL error.
#include <doctest/doctest.h>
#include <epoxy/gl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <numeric>
#include <string>
#include <thread>

#include "base/errors.h"
#include "gl/buffer.h"
#include "gl/context.h"
#include "gl/device.h"
#include "gl/error.h"
#include "gl/program.h"
#include "gl/query.h"
#include "gl/shader_source.h"

using namespace lodlab;

namespace {

template <class Action>
std::string message_of(const Action& action) {
  try {
    action();
  } catch (const std::exception& error) {
    return error.what();
  }
  return "";
}

/// A folder of shader files that LODLAB_SHADER_DIR points to while it lives.
class ShaderFolder {
 public:
  ShaderFolder()
      : path_(std::filesystem::temp_directory_path() / ("lodlab_test_gl_" + std::to_string(getpid()))) {
    std::filesystem::create_directories(path_ / "part");
    const char* before = std::getenv("LODLAB_SHADER_DIR");
    if (before != nullptr) before_ = before;
    setenv("LODLAB_SHADER_DIR", path_.c_str(), 1);
  }
  ~ShaderFolder() {
    before_.empty() ? unsetenv("LODLAB_SHADER_DIR") : setenv("LODLAB_SHADER_DIR", before_.c_str(), 1);
    std::filesystem::remove_all(path_);
  }
  void write(const std::string& file, const std::string& text) const { std::ofstream(path_ / file) << text; }

 private:
  std::filesystem::path path_;
  std::string before_;
};

constexpr char kFragment[] = "layout(location = 0) out vec4 color;\nvoid main() { color = vec4(1.0); }\n";

gl::ProgramSpec two_stages() {
  return {{{GL_VERTEX_SHADER, "a.vert"}, {GL_FRAGMENT_SHADER, "a.frag"}}, {}, {}};
}

}  // namespace

TEST_CASE("devices: choices name exactly what they say") {
  using gl::Device;
  const std::vector<Device> all = {
      {0, "software", true, -1, nullptr}, {1, "cuda:1", false, 1, nullptr}, {2, "cuda:0", false, 0, nullptr}};
  CHECK(gl::candidates("auto", all).front().index == 1);
  CHECK(gl::candidates("auto", all).back().software);
  CHECK(gl::candidates("software", all).front().index == 0);
  CHECK(gl::candidates("cuda:0", all).front().index == 2);
  CHECK(gl::candidates("cuda:0", all).size() == 1);
  CHECK(gl::candidates("2", all).front().name == "cuda:0");
  CHECK_THROWS_AS(gl::candidates("cuda:7", all), GLError);
  CHECK_THROWS_AS(gl::candidates("3", all), GLError);
  for (const char* wrong : {"gpu", "cuda:", "cuda:x", "-1", "1.5", ""}) {
    CHECK_THROWS_AS(gl::candidates(wrong, all), InvalidInput);
  }
}

TEST_CASE("context: 4.5 core, and the software device is software") {
  const std::vector<gl::Device> all = gl::devices();
  CHECK(!all.empty());
  const gl::Info& info = gl::ensure_context();
  GLint major = 0, minor = 0, profile = 0;
  glGetIntegerv(GL_MAJOR_VERSION, &major);
  glGetIntegerv(GL_MINOR_VERSION, &minor);
  glGetIntegerv(GL_CONTEXT_PROFILE_MASK, &profile);
  CHECK(10 * major + minor >= 45);
  CHECK(profile == GL_CONTEXT_CORE_PROFILE_BIT);
  CHECK(!info.renderer.empty());
  CHECK(info.max_width >= 1920);
  if (all[static_cast<size_t>(info.device_index)].software) CHECK(info.software);
  gl::choose_device(std::to_string(info.device_index));  // the same again is fine
  CHECK_THROWS_AS(gl::choose_device("cuda:99"), GLError);
  CHECK_THROWS_AS(gl::choose_device("nonsense"), InvalidInput);
  gl::check("the context test");
}

TEST_CASE("context: another thread gets an error, and its objects die on the right thread") {
  gl::ensure_context();
  auto buffer = std::make_unique<gl::Buffer>(64);
  const unsigned name = buffer->id();
  std::string message;
  std::thread([&] {
    message = message_of([] { gl::Buffer other(64); });
    buffer.reset();
  }).join();
  CHECK(message.find("another thread") != std::string::npos);
  CHECK(glIsBuffer(name));
  gl::ensure_context();
  CHECK(!glIsBuffer(name));
}

TEST_CASE("context: a forked child gets an error, not a crash") {
  gl::ensure_context();
  const pid_t child = fork();
  if (child == 0) {
    const std::string message = message_of([] { gl::ensure_context(); });
    _exit(message.find("fork") != std::string::npos ? 0 : 1);
  }
  int status = -1;
  REQUIRE(waitpid(child, &status, 0) == child);
  CHECK(WIFEXITED(status));
  CHECK(WEXITSTATUS(status) == 0);
}

TEST_CASE("errors: a wrong call throws once, with the call's name") {
  gl::ensure_context();
  glEnable(GL_TRIANGLES);  // no capability
  const std::string message = message_of([] { gl::check("glEnable"); });
  CHECK(message.find("glEnable failed") == 0);
  gl::check("nothing");
  std::vector<std::byte> room(64);
  const std::string read = message_of([&] { gl::Buffer(int64_t{16}).read(8, room); });
  CHECK(read.find("glGetNamedBufferSubData failed") == 0);
}

TEST_CASE("shaders: errors name file, line and the driver's words") {
  const ShaderFolder folder;
  folder.write("a.frag", kFragment);
  folder.write("part/helper.glsl", "// one\n// two\nfloat helper() { return nonsense; }\n");
  folder.write("a.vert", "#include \"part/helper.glsl\"\nvoid main() { gl_Position = vec4(helper()); }\n");
  std::string message = message_of([] { gl::Program{two_stages()}; });
  CHECK(message.find("part/helper.glsl:3") != std::string::npos);
  CHECK(message.find("nonsense") != std::string::npos);

  folder.write("part/helper.glsl", "float helper() { return 1.0; }\n");
  folder.write("a.vert",
               "#version 450 core\n#include \"part/helper.glsl\"\n\n\nvoid main() { gl_Position = bad; }\n");
  message = message_of([] { gl::Program{two_stages()}; });
  CHECK(message.find("a.vert:5") != std::string::npos);

  folder.write("a.vert", "void main() {}\n#include \"part/absent.glsl\"\n");
  message = message_of([] { gl::Program{two_stages()}; });
  CHECK(message.find("part/absent.glsl") != std::string::npos);
  CHECK(message.find("a.vert:2") != std::string::npos);

  folder.write("a.vert", "void never();\nvoid main() { never(); gl_Position = vec4(0.0); }\n");
  message = message_of([] { gl::Program{two_stages()}; });
  CHECK(message.find("does not link") != std::string::npos);

  folder.write("a.vert",
               "#include \"part/helper.glsl\"\n#include \"part/helper.glsl\"\nvoid main() { gl_Position = "
               "vec4(SIZE * helper()); }\n");
  gl::ProgramSpec spec = two_stages();
  spec.defines = {"SIZE 2.0"};
  CHECK(gl::Program(spec).id() != 0);
  gl::check("the shader test");
}

TEST_CASE("shaders: both styles of log are understood") {
  const std::vector<std::string> files = {"a.vert", "b.glsl"};
  CHECK(gl::readable_log("1:7(3): error: x\n", files) == "b.glsl:7: error: x\n");
  CHECK(gl::readable_log("0(12) : error C1: x\n", files) == "a.vert:12: error C1: x\n");
  CHECK(gl::readable_log("5(12) : far\nplain\n", files) == "5(12) : far\nplain\n");
}

TEST_CASE("buffers: what goes in comes out, empty ones too") {
  std::vector<uint32_t> values(1000);
  std::iota(values.begin(), values.end(), 7u);
  gl::Buffer buffer(values);
  const uint32_t changed = 99;
  buffer.upload(40, std::as_bytes(std::span(&changed, 1)));
  std::vector<uint32_t> back(values.size());
  buffer.read(0, std::as_writable_bytes(std::span(back)));
  values[10] = changed;
  CHECK(back == values);
  CHECK(gl::Buffer(std::vector<float>{}).bytes() == 0);
  gl::check("the buffer test");
}
