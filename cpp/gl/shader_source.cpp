// SPDX-License-Identifier: MIT
#include "gl/shader_source.h"

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <regex>
#include <sstream>

#include "base/errors.h"

namespace lodlab::gl {
namespace {

std::string package_dir;

const std::regex kInclude(R"rx(^\s*#\s*include\s+"([^"]+)"\s*(//.*)?$)rx");
const std::regex kVersion(R"rx(^\s*#\s*version\b.*$)rx");

/// Appends a file and what it includes. `from` says who asked, for messages.
void append(const std::string& file, const std::string& from, ShaderSource& source) {
  if (std::find(source.files.begin(), source.files.end(), file) != source.files.end()) return;
  const std::string path = shader_dir() + "/" + file;
  std::ifstream stream(path);
  if (!stream)
    throw GLError("shader " + path + " cannot be read" + from + " (LODLAB_SHADER_DIR says where else)");
  const size_t number = source.files.size();
  source.files.push_back(file);
  source.text += "#line 1 " + std::to_string(number) + "\n";
  std::string line;
  for (int at = 1; std::getline(stream, line); ++at) {
    std::smatch match;
    if (std::regex_match(line, match, kInclude)) {
      append(match[1].str(), " (included at " + file + ":" + std::to_string(at) + ")", source);
      source.text += "#line " + std::to_string(at + 1) + " " + std::to_string(number) + "\n";
    } else {
      source.text += (std::regex_match(line, kVersion) ? std::string() : line) + "\n";
    }
  }
}

}  // namespace

void set_shader_dir(const std::string& folder) { package_dir = folder; }

std::string shader_dir() {
  const char* folder = std::getenv("LODLAB_SHADER_DIR");
  if (folder != nullptr && *folder != '\0') return folder;
  if (package_dir.empty()) throw GLError("shaders: no folder known; set LODLAB_SHADER_DIR");
  return package_dir;
}

ShaderSource load_shader(const std::string& file, const std::vector<std::string>& defines) {
  ShaderSource source;
  source.text = "#version 450 core\n";
  for (const std::string& define : defines) source.text += "#define " + define + "\n";
  append(file, "", source);
  return source;
}

std::string readable_log(const std::string& log, const std::vector<std::string>& files) {
  static const std::regex kPlace(R"rx(^(\d+)(:(\d+)\(\d+\)|\((\d+)\))\s*)rx");
  std::istringstream stream(log);
  std::string line, out;
  while (std::getline(stream, line)) {
    std::smatch match;
    if (std::regex_search(line, match, kPlace)) {
      const size_t number = std::stoul(match[1].str());
      const std::string at = match[3].matched ? match[3].str() : match[4].str();
      if (number < files.size()) line = files[number] + ":" + at + match.suffix().str();
    }
    out += line + "\n";
  }
  return out;
}

}  // namespace lodlab::gl
