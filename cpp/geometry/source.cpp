// SPDX-License-Identifier: MIT
#include "geometry/source.h"

#include <nlohmann/json.hpp>

#include "base/errors.h"

namespace lodlab {

std::string kind_of_frame(const std::string& frame) {
  try {
    return nlohmann::json::parse(frame).value("kind", "heightfield");
  } catch (const nlohmann::json::exception& error) {
    throw InvalidInput(std::string("frame of a source: ") + error.what());
  }
}

}  // namespace lodlab
