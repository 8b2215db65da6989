// SPDX-License-Identifier: MIT
// Shader files: #include "folder/file" is resolved below the shader folder, each file at most once, with
// #line so that the driver's messages can be turned into file and line.
#pragma once

#include <string>
#include <vector>

namespace lodlab::gl {

/// Where shaders are: LODLAB_SHADER_DIR, else the folder set here. GLError when neither is set.
void set_shader_dir(const std::string& folder);
std::string shader_dir();

struct ShaderSource {
  std::string text;                ///< "#version 450 core", the defines, the file with its includes
  std::vector<std::string> files;  ///< file of each #line source number
};

/// Loads a file below the shader folder; `defines` are "NAME" or "NAME VALUE". A #version line of the file
/// is left out: the loader writes it. GLError names a missing file and the line that includes it.
ShaderSource load_shader(const std::string& file, const std::vector<std::string>& defines);

/// The driver's log with "0:12(3)" or "0(12)" turned into "file:12".
std::string readable_log(const std::string& log, const std::vector<std::string>& files);

}  // namespace lodlab::gl
