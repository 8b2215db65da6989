# SPDX-License-Identifier: MIT
"""What all readers of mesh files share: numbers in text, lists of corners, polygons, and polygons as triangles."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field

import numpy as np

from .. import _core
from ..errors import InvalidInput


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
    text = text.strip()
    if not text:
        return np.zeros(0)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", DeprecationWarning)  # what older numpys say in place of ValueError
            return np.fromstring(text, sep=" ")
    except (ValueError, DeprecationWarning):
        raise InvalidInput(f"open {path}: something that is no number stands among its numbers") from None


def lines_of_numbers(text: bytes, path: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """All numbers of a text, and for each line that has any its first and how many it has."""
    values = numbers(text, path)
    codes = np.frombuffer(text, np.uint8)
    blank = codes <= 32
    begins = ~blank
    begins[1:] &= blank[:-1]
    at = np.flatnonzero(begins)
    ends = np.searchsorted(at, np.flatnonzero((codes == 10) | (codes == 13)))
    sizes = np.diff(np.concatenate([[0], ends, [len(at)]]))
    sizes = sizes[sizes > 0]
    return values, np.cumsum(sizes) - sizes, sizes


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
