// SPDX-License-Identifier: MIT
#include "gl/program.h"

#include <epoxy/gl.h>

#include "base/errors.h"
#include "gl/error.h"
#include "gl/shader_source.h"

namespace lodlab::gl {
namespace {

std::string shader_log(unsigned shader) {
  GLint length = 0;
  glGetShaderiv(shader, GL_INFO_LOG_LENGTH, &length);
  std::string log(static_cast<size_t>(length), '\0');
  if (length > 0) glGetShaderInfoLog(shader, length, &length, log.data());
  log.resize(static_cast<size_t>(length));
  return log;
}

std::string program_log(unsigned program) {
  GLint length = 0;
  glGetProgramiv(program, GL_INFO_LOG_LENGTH, &length);
  std::string log(static_cast<size_t>(length), '\0');
  if (length > 0) glGetProgramInfoLog(program, length, &length, log.data());
  log.resize(static_cast<size_t>(length));
  return log;
}

/// Compiles and attaches one stage; the shader object lives as long as the program.
void attach(unsigned program, const ProgramStage& stage, const std::vector<std::string>& defines) {
  const ShaderSource source = load_shader(stage.file, defines);
  const unsigned shader = glCreateShader(stage.type);
  const char* text = source.text.c_str();
  glShaderSource(shader, 1, &text, nullptr);
  glCompileShader(shader);
  GLint good = 0;
  glGetShaderiv(shader, GL_COMPILE_STATUS, &good);
  const std::string log = good ? std::string() : readable_log(shader_log(shader), source.files);
  if (good) glAttachShader(program, shader);
  glDeleteShader(shader);
  clear_error();  // some drivers also report the failure as a debug message
  if (!good) throw GLError("shader " + stage.file + " does not compile:\n" + log);
}

}  // namespace

Program::Program(const ProgramSpec& spec) {
  ensure_context();
  handle_ = Handle<Kind::kProgram>(glCreateProgram());
  std::string names;
  for (const ProgramStage& stage : spec.stages) {
    attach(id(), stage, spec.defines);
    names += (names.empty() ? "" : " + ") + stage.file;
  }
  if (!spec.feedback.empty()) {
    std::vector<const char*> outputs;
    for (const std::string& name : spec.feedback) outputs.push_back(name.c_str());
    glTransformFeedbackVaryings(id(), static_cast<GLsizei>(outputs.size()), outputs.data(),
                                GL_INTERLEAVED_ATTRIBS);
  }
  glLinkProgram(id());
  GLint good = 0;
  glGetProgramiv(id(), GL_LINK_STATUS, &good);
  clear_error();
  if (!good) throw GLError("program " + names + " does not link:\n" + program_log(id()));
}

void Program::use() const {
  glUseProgram(id());
  check("glUseProgram");
}

void Program::dispatch(unsigned groups) {
  glDispatchCompute(groups, 1, 1);
  glMemoryBarrier(GL_ALL_BARRIER_BITS);
  check("glDispatchCompute");
}

int Program::uniform(const char* name) const { return glGetUniformLocation(id(), name); }

unsigned stage_type(const std::string& stage) {
  if (stage == "vertex") return GL_VERTEX_SHADER;
  if (stage == "geometry") return GL_GEOMETRY_SHADER;
  if (stage == "tess_control") return GL_TESS_CONTROL_SHADER;
  if (stage == "tess_evaluation") return GL_TESS_EVALUATION_SHADER;
  if (stage == "fragment") return GL_FRAGMENT_SHADER;
  if (stage == "compute") return GL_COMPUTE_SHADER;
  throw InvalidInput("shader stage '" + stage +
                     "' is not one of vertex, geometry, tess_control, tess_evaluation, fragment, compute");
}

}  // namespace lodlab::gl
