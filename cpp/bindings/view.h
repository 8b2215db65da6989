// SPDX-License-Identifier: MIT
// Bindings that session.cpp calls: views and budgets, and the benchmark's static mesh.
#pragma once

#include <pybind11/pybind11.h>

namespace lodlab {

void bind_view(pybind11::module_& m);
void bind_static_mesh(pybind11::module_& m);

}  // namespace lodlab
