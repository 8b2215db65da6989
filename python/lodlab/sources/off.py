# SPDX-License-Identifier: MIT
"""OFF files: a word, three counts, a line a vertex, a line a face. Of the variants those with colours (C) and
normals (N) are read."""

from __future__ import annotations

import re

import numpy as np

from ..errors import InvalidInput
from .polygons import Polygons, gather, lines_of_numbers


def read_off(data: bytes, path: str) -> Polygons:
    """The polygons of an OFF file. InvalidInput names the path."""
    if b"#" in data:
        data = re.sub(rb"#[^\r\n]*", b"", data)
    head = re.match(rb"\s*(ST)?(C?)(N?)(4?)(n?)OFF(?![A-Za-z])", data)
    if head is None:
        raise InvalidInput(f"open {path}: it does not begin with the word OFF")
    texture, _, normal, four, many = head.groups()
    if texture or four or many or re.match(rb"\s*BINARY", data[head.end() :]):
        raise InvalidInput(f"open {path}: {data[: head.end()].strip().decode()} with texture coordinates, of four or n "
                           "dimensions, or binary, is not read")  # fmt: skip
    counts = re.compile(rb"\s*(\d{1,18})\s+(\d{1,18})(\s+\d{1,18})?[^\S\r\n]*").match(data, head.end())
    if counts is None:
        raise InvalidInput(f"open {path}: the numbers of its vertices, faces and edges do not follow the word OFF")
    vertices, faces = int(counts[1]), int(counts[2])
    body = data[counts.end() :]
    values, starts, sizes = lines_of_numbers(body, path)
    if vertices + faces > len(sizes):
        raise InvalidInput(
            f"open {path}: it claims {vertices} vertices and {faces} faces; it has {len(sizes)} lines: it is cut "
            "short or its counts are wrong"
        )
    width = int(sizes[0]) if vertices else 3
    uneven = np.flatnonzero(sizes[:vertices] != width)
    least = 6 if normal else 3
    if len(uneven) or width not in (least, least + 3, least + 4):
        row = int(uneven[0]) if len(uneven) else 0
        raise InvalidInput(f"open {path}: vertex {row} has {sizes[row] if vertices else 0} numbers")
    table = values[: vertices * width].reshape(vertices, width)
    rows, lengths = starts[vertices : vertices + faces], sizes[vertices : vertices + faces]
    wanted = values[rows]
    bad = ~((wanted >= 0) & (wanted == np.floor(wanted)) & (wanted + 1 <= lengths))
    if bad.any():
        face = int(np.argmax(bad))
        raise InvalidInput(f"open {path}: face {face} claims {wanted[face]:g} corners of {lengths[face] - 1}")
    corners = wanted.astype(np.int64)
    used = {"ignored": "of faces their colours"} if (lengths > corners + 1).any() else {}
    return Polygons(
        table[:, :3],
        gather(values, rows + 1, corners),
        corners,
        _colors(table[:, least:]) if width > least else None,
        table[:, 3:6].astype(np.float32) if normal else None,
        used,
    )


def _colors(values: np.ndarray) -> np.ndarray:
    """(V, 4) uint8 of floats of 0 to 1, or of whole numbers to 255."""
    out = np.full((len(values), 4), 255, np.uint8)
    values = np.nan_to_num(values)
    factor = 255.0 if values.size and values.max() <= 1.0 else 1.0
    out[:, : values.shape[1]] = np.rint(np.clip(values * factor, 0.0, 255.0))
    return out
