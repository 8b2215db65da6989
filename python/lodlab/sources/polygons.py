# SPDX-License-Identifier: MIT
"""What all readers of mesh files share: numbers in text, lists of corners, polygons, and polygons as triangles."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field

import numpy as np

from .. import _core
from ..errors import InvalidInput

UNPACKED_AT_MOST = (
    64  # times the bytes of a file that it may come to, packed or by instances; as text, meshes come to 10
)
UNPACKED_ALWAYS = 1 << 26  # bytes that any file may come to


@dataclass
class MeshData:
    """Arrays of a mesh: (V, 3) float64, (F, 3) uint32, (V, 4) uint8, (V, 3) float32; and what was done to have them."""

    positions: np.ndarray
    faces: np.ndarray
    colors: np.ndarray | None = None
    normals: np.ndarray | None = None
    used: dict[str, str] = field(default_factory=dict)


@dataclass
class Polygons:
    """What a file holds: faces one after the other, `sizes` corners each, as indices of vertices."""

    positions: np.ndarray
    corners: np.ndarray
    sizes: np.ndarray
    colors: np.ndarray | None = None
    normals: np.ndarray | None = None
    used: dict[str, str] = field(default_factory=dict)


def numbers(text: bytes, path: str) -> np.ndarray:
    """(N,) float64: numbers with white space between them. InvalidInput where something else stands."""
    return _parsed(text, int(np.count_nonzero(_begins(text))), path)


def lines_of_numbers(text: bytes, path: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """All numbers of a text, and for each line that has any its first and how many it has."""
    codes = np.frombuffer(text, np.uint8)
    at = np.flatnonzero(_begins(text))
    ends = np.searchsorted(at, np.flatnonzero((codes == 10) | (codes == 13)))
    sizes = np.diff(np.concatenate([[0], ends, [len(at)]]))
    sizes = sizes[sizes > 0]
    return _parsed(text, len(at), path), np.cumsum(sizes) - sizes, sizes


def _begins(text: bytes) -> np.ndarray:
    """Where words begin."""
    blank = np.frombuffer(text, np.uint8) <= 32
    out = ~blank
    out[1:] &= blank[:-1]
    return out


def _parsed(text: bytes, words: int, path: str) -> np.ndarray:
    """A number for each of the words of a text."""
    if not words:
        return np.zeros(0)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", DeprecationWarning)  # what older numpys say in place of ValueError
            values = np.fromstring(text, sep=" ")
    except (ValueError, DeprecationWarning):
        values = None
    if values is None or len(values) != words:  # 1-2 reads as two
        raise InvalidInput(f"open {path}: something that is no number stands among its numbers")
    return values


def as_indices(values: np.ndarray, vertices: int, path: str) -> np.ndarray:
    """Corners as uint32. InvalidInput names the first that is no index of a vertex."""
    bad = ~((values >= 0) & (values < vertices))
    if values.dtype.kind == "f":
        bad |= values != np.floor(values)
    if bad.any():
        at = int(np.argmax(bad))
        raise InvalidInput(f"open {path}: corner {at} of its faces names vertex {values[at]:g} of {vertices}")
    return values.astype(np.uint32)


def gather(values: np.ndarray, starts: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """values[starts[i] : starts[i] + sizes[i]] for all i, one after the other."""
    ends = np.cumsum(sizes)
    shift = np.repeat(starts - (ends - sizes), sizes)
    return values[np.arange(len(shift)) + shift]


def as_bytes(colors: np.ndarray) -> np.ndarray:
    """(V, 4) uint8 of 8 bits, 16 bits or floats of 0 to 1."""
    out = np.full((len(colors), 4), 255, np.uint8)
    if colors.dtype.kind == "f":
        colors = np.rint(np.clip(np.nan_to_num(colors), 0.0, 1.0) * 255.0)
    elif colors.dtype.itemsize > 1 and colors.size and colors.max() > 255:
        colors = colors >> 8
    out[:, : colors.shape[1]] = np.clip(colors, 0, 255)
    return out


# ---- triangles ------------------------------------------------------------------------------------


def triangles(polygons: Polygons, path: str) -> MeshData:
    """Polygons as triangles; faces of fewer than three corners are left out."""
    sizes, used = polygons.sizes, polygons.used
    corners = as_indices(polygons.corners, len(polygons.positions), path)
    small = int(np.count_nonzero(sizes < 3))
    if small:
        used["left_out"] = f"{small} faces of fewer than three corners"
    positions = np.ascontiguousarray(polygons.positions, np.float64)
    if (sizes == 3).all():
        faces = corners.reshape(-1, 3)
    else:
        faces = _core.polygon_triangles(positions, corners, sizes.astype(np.int64))
        if (large := sizes > 3).any():
            used["polygons"] = (
                f"{large.sum()} faces of more than three corners, as {(sizes[large] - 2).sum()} triangles"
            )
    return MeshData(positions, faces, polygons.colors, polygons.normals, used)


def unrolled(values: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """The corners of the triangles of strips, `lengths` values each; -1 begins a new strip, every second triangle is
    turned, and triangles that only join (a vertex twice) are left out."""
    values = values.astype(np.int64)
    first = np.zeros(len(values) + 1, bool)  # where a strip begins
    first[np.cumsum(lengths)[:-1]] = True
    cut = values == -1
    first[1:] |= cut
    first[0] = True
    begin = np.maximum.accumulate(np.where(first, np.arange(len(first)), 0))[:-1]
    at = np.arange(len(values))
    last = at[(at - begin >= 2) & ~cut]
    a, b, c = values[last - 2], values[last - 1], values[last]
    odd = (last - begin[last]) % 2 == 1
    a, b = np.where(odd, b, a), np.where(odd, a, b)
    joins = (a == b) | (b == c) | (a == c)
    return np.stack([a, b, c], axis=1)[~joins].reshape(-1)
