# SPDX-License-Identifier: MIT
"""STL files, binary and text. They hold no indices: corners at equal places are one vertex."""

from __future__ import annotations

import re

import numpy as np

from .. import _core
from ..errors import InvalidInput
from .polygons import Polygons, numbers

_HEAD = 84  # bytes: a title and the number of triangles
_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def read_stl(data: bytes, path: str) -> Polygons:
    """The triangles of an STL file. InvalidInput names the path."""
    places = _binary(data, path)
    corners = _text(data, path) if places is None else places
    bad = ~np.isfinite(corners).all(axis=1)
    if bad.any():
        at = int(np.argmax(bad))
        raise InvalidInput(
            f"open {path}: triangle {at // 3} has a corner at {corners[at].tolist()}, which is not finite"
        )
    first = _core.first_at_position(np.ascontiguousarray(corners, np.float64))
    kept, index = np.unique(first, return_inverse=True)
    used = {"merged": f"{len(corners)} corners into {len(kept)} vertices at equal places"}
    return Polygons(corners[kept], index.reshape(-1), np.full(len(corners) // 3, 3), used=used)


def _binary(data: bytes, path: str) -> np.ndarray | None:
    """(3 T, 3) float32 corners; None for text."""
    text = data[:_HEAD].lstrip().lower().startswith(b"solid")
    count = int.from_bytes(data[80:_HEAD], "little") if len(data) >= _HEAD else 0
    there = max(len(data) - _HEAD, 0) // _TRIANGLE.itemsize
    if text and len(data) != _HEAD + count * _TRIANGLE.itemsize:
        return None
    if len(data) < _HEAD or count > there:
        raise InvalidInput(
            f"open {path}: it claims {count} triangles and has the bytes of {there}: cut short or no STL"
        )
    return np.frombuffer(data, _TRIANGLE, count, _HEAD)["corners"].reshape(-1, 3)


def _text(data: bytes, path: str) -> np.ndarray:
    """(3 T, 3) corners of the lines that begin with the word vertex."""
    vertices = re.findall(rb"(?im)^[ \t]*vertex([^\r\n]*)", data)
    facets = data.count(b"endfacet") or data.count(b"ENDFACET")
    values = numbers(b"\n".join(vertices), path)
    if len(vertices) != 3 * facets or len(values) != 9 * facets or not re.search(rb"(?i)endsolid", data[-200:]):
        raise InvalidInput(
            f"open {path}: {len(vertices)} vertices, {len(values)} numbers in {facets} facets, not three of three "
            "each, or there is no endsolid at its end: it is damaged or cut short"
        )
    return values.reshape(-1, 3)
