// SPDX-License-Identifier: MIT
// What a user brings: the one face that building, stores and the instrument know sources by. A source is
// immutable and shared. Below it stand the kinds: FieldSource (heights on a grid,
// height_field.h) and Mesh (mesh.h).
#pragma once

#include <cstdint>
#include <string>

namespace lodlab {

struct Source {
  virtual ~Source() = default;

  virtual std::string kind() const = 0;  ///< heightfield, planet or mesh: what MethodInfo::accepts lists
  virtual std::string hash() const = 0;  ///< of all that is measured against: 32 hex digits
  /// Where it lies, JSON with its kind: what stores keep of it.
  virtual std::string frame() const = 0;
  /// Points that it is made of.
  virtual int64_t samples() const = 0;

  std::string spec;  ///< how to load it again (SOURCE of the command line), or empty
};

/// The kind in the JSON text of Source::frame(); a frame of before there were meshes says none, and is a
/// field's.
std::string kind_of_frame(const std::string& frame);

}  // namespace lodlab
