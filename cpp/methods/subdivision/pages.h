// SPDX-License-Identifier: MIT
// What is paged: groups of consecutive control faces. The page of a group has all heights of its faces but
// those of vertices: a block each for the control edges of its faces, in the order of their first use, then
// for the faces' insides. A block is as bits.h has it; those of edges that groups share stand in each, with
// the same bits. Ranges come first, then values.
#pragma once

#include <span>
#include <vector>

#include "methods/subdivision/bits.h"
#include "store/store.h"

namespace lodlab::subdivision {

inline constexpr int64_t kGroupFaces = 64;

inline int64_t groups_of(int64_t faces) { return (faces + kGroupFaces - 1) / kGroupFaces; }

Bytes group_page(const Samples& samples, const PackedHeights& packed, int64_t group);

/// Puts what a page has into a list of all samples' heights. False: it is no such page.
bool read_page(const Samples& samples, int bits, int64_t group, std::span<const std::byte> page,
               std::vector<float>& heights);

/// Floats, points() a face of the group, of such a page; `heights` has those of vertices.
Bytes decode_page(const Samples& samples, int bits, int64_t group, std::span<const std::byte> page,
                  std::span<const float> heights);

}  // namespace lodlab::subdivision
