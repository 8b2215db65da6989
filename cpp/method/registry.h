// SPDX-License-Identifier: MIT
// The methods that this library is built with. In a file of its own, so that a program linked without the
// rooms (a unit test) can define its own list.
#pragma once

#include <vector>

#include "method/method.h"

namespace lodlab {

std::vector<const Method*> built_in_methods();

}  // namespace lodlab
