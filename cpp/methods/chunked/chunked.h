// SPDX-License-Identifier: MIT
// Chunked LOD (Ulrich, Rendering massive terrains using chunked level of detail control, 2002).
#pragma once

#include "method/method.h"

namespace lodlab::chunked {

void build(const HeightField& field, const Options& options, StoreWriter& writer, const Progress& progress);

}  // namespace lodlab::chunked
