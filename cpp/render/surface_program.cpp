// SPDX-License-Identifier: MIT
#include <epoxy/gl.h>

#include <map>

#include "gl/program.h"
#include "render/variant.h"

namespace lodlab::render {

struct SurfaceProgram::Impl {
  std::vector<StageFile> stages;
  std::vector<std::string> defines;
  std::map<Variant, gl::Program> programs;
};

namespace {

std::vector<std::string> defines_of(const Variant& variant) {
  std::vector<std::string> defines = {"LODLAB_SHOW " + std::to_string(variant.show)};
  if (variant.kind == SurfaceKind::kPlanet) defines.push_back("LODLAB_PLANET");
  if (variant.kind == SurfaceKind::kMesh) defines.push_back("LODLAB_MESH");
  if (variant.coverage) defines.push_back("LODLAB_COVERAGE");
  if (variant.maps.colors) defines.push_back("LODLAB_COLORS");
  if (variant.maps.normals) defines.push_back("LODLAB_NORMALS");
  if (variant.feedback) defines.push_back("LODLAB_FEEDBACK");
  return defines;
}

}  // namespace

SurfaceProgram::SurfaceProgram(std::initializer_list<StageFile> stages, std::vector<std::string> defines)
    : impl_(std::make_unique<Impl>()) {
  for (const StageFile& stage : stages) gl::stage_type(stage.stage);  // refuses unknown stages early
  impl_->stages = stages;
  impl_->defines = std::move(defines);
}

SurfaceProgram::~SurfaceProgram() = default;

unsigned Pass::program_of(SurfaceProgram& program, const Variant& variant) {
  SurfaceProgram::Impl& impl = *program.impl_;
  gl::Program& compiled = impl.programs[variant];
  if (!compiled) {
    gl::ProgramSpec spec;
    for (const auto& stage : impl.stages) spec.stages.push_back({gl::stage_type(stage.stage), stage.file});
    spec.stages.push_back({GL_FRAGMENT_SHADER, "common/surface.frag"});
    spec.defines = defines_of(variant);
    spec.defines.insert(spec.defines.end(), impl.defines.begin(), impl.defines.end());
    if (variant.feedback) spec.feedback = {"v_captured_start", "v_captured_end"};
    compiled = gl::Program(spec);
  }
  return compiled.id();
}

}  // namespace lodlab::render
