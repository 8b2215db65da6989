// SPDX-License-Identifier: MIT
// A linked GL program from shader files. A stage that fails to compile throws GLError with file, line and
// the driver's message.
#pragma once

#include <string>
#include <vector>

#include "gl/handle.h"

namespace lodlab::gl {

struct ProgramStage {
  unsigned type;     ///< GL_VERTEX_SHADER, ...
  std::string file;  ///< below the shader folder
};

struct ProgramSpec {
  std::vector<ProgramStage> stages;
  std::vector<std::string> defines;   ///< "NAME" or "NAME VALUE", given to every stage
  std::vector<std::string> feedback;  ///< outputs that transform feedback captures, interleaved
};

class Program {
 public:
  Program() = default;
  explicit Program(const ProgramSpec& spec);

  void use() const;
  /// Runs a compute program that is in use, so many groups. What it writes is there for all later calls.
  static void dispatch(unsigned groups);
  /// Location of a uniform, -1 when the program does not use it.
  int uniform(const char* name) const;

  unsigned id() const { return handle_.id(); }
  explicit operator bool() const { return static_cast<bool>(handle_); }

 private:
  Handle<Kind::kProgram> handle_;
};

/// GL_VERTEX_SHADER and so on from "vertex", "geometry", "tess_control", "tess_evaluation", "fragment",
/// "compute". InvalidInput for another word.
unsigned stage_type(const std::string& stage);

}  // namespace lodlab::gl
