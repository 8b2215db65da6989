# SPDX-License-Identifier: MIT
"""Generated meshes, closed: the Earth as a globe, a sphere, a torus, a fractal blob. Coordinates are rounded to 32-bit
floats, outside is out."""

from __future__ import annotations

import numpy as np

from .. import _core
from ..errors import InvalidInput
from .base import FieldSource
from .mesh import Mesh
from .polygons import MeshData
from .spec import format_spec

LARGEST = 7000  # points of a cube's edge
_AT_ONCE = 1 << 20


def _within(what: str, value: float, low: float, high: float) -> None:
    if not low <= value <= high:
        raise InvalidInput(f"{what} {value} is not within {low} to {high}")


def _shape(name: str, keys: dict, positions: np.ndarray, faces: np.ndarray) -> Mesh:
    rounded = positions.astype(np.float32).astype(np.float64)
    return Mesh.made(MeshData(rounded, np.ascontiguousarray(faces, np.uint32)), name, format_spec(name, keys))


def globe(earth: FieldSource, size: int = 256, vertical_scale: float = 1.0) -> Mesh:
    """A planet as a closed mesh, metres: a cube's surface of size x size points a face blown up, each at the radius and
    the height above it, interpolated between the planet's samples."""
    _within("earth-globe: size", size, 2, LARGEST)
    _within("earth-globe: vertical_scale", vertical_scale, 0.0, 100.0)
    directions, faces = _core.cube_sphere(size)
    for begin in range(0, len(directions), _AT_ONCE):
        part = directions[begin : begin + _AT_ONCE]
        part *= (earth.radius + vertical_scale * _heights_along(earth, part))[:, None]
    keys = {"size": size, "vertical_scale": None if vertical_scale == 1.0 else vertical_scale}
    return _shape("earth-globe", keys, directions, faces)


def _heights_along(planet: FieldSource, directions: np.ndarray) -> np.ndarray:
    """Heights of a planet that closes, metres, bilinear between its samples, along (N, 3) unit vectors."""
    frame = planet.frame
    rows, cols = planet.shape
    x, y, z = directions.T
    row = (frame["lat0"] - np.degrees(np.arcsin(np.clip(z, -1.0, 1.0)))) / frame["dlat"]
    col = (np.degrees(np.arctan2(y, x)) - frame["lon0"]) / frame["dlon"] % cols
    r0 = np.clip(row.astype(np.int64), 0, rows - 2)
    c0 = np.minimum(col.astype(np.int64), cols - 1)
    c1 = (c0 + 1) % cols
    down, east = np.clip(row - r0, 0.0, 1.0), col - c0
    heights = planet.grid
    upper = heights[r0, c0] * (1.0 - east) + heights[r0, c1] * east
    lower = heights[r0 + 1, c0] * (1.0 - east) + heights[r0 + 1, c1] * east
    return upper * (1.0 - down) + lower * down


def icosphere(level: int = 5) -> Mesh:
    """The unit sphere: an icosahedron whose triangles are cut into four `level` times, 20 * 4^level triangles."""
    from trimesh.creation import icosphere as made

    _within("icosphere: level", level, 0, 9)
    sphere = made(level)
    return _shape("icosphere", {"level": level}, sphere.vertices, sphere.faces)


def torus(rings: int = 256, sides: int = 128, tube: float = 0.4) -> Mesh:
    """A torus round the z axis, genus 1: `rings` circles of `sides` points and radius `tube`, their middles on the unit
    circle."""
    _within("torus: rings", rings, 3, LARGEST)
    _within("torus: sides", sides, 3, LARGEST)
    if not 0.0 < tube < 1.0:
        raise InvalidInput(f"torus: tube {tube} is not between 0 and 1")
    u, v = np.meshgrid(np.arange(rings) * (2 * np.pi / rings), np.arange(sides) * (2 * np.pi / sides), indexing="ij")
    reach = 1.0 + tube * np.cos(v)
    positions = np.stack([reach * np.cos(u), reach * np.sin(u), tube * np.sin(v)], axis=-1).reshape(-1, 3)
    ids = np.arange(rings * sides).reshape(rings, sides)
    a, b = ids, np.roll(ids, -1, axis=0)
    d, c = np.roll(a, -1, axis=1), np.roll(b, -1, axis=1)
    faces = np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)
    keys = {"rings": rings, "sides": sides, "tube": None if tube == 0.4 else tube}
    return _shape("torus", keys, positions, faces)


def blob(size: int = 256, seed: int = 1) -> Mesh:
    """A closed fractal surface of genus 0, radius about 1, 12 (size - 1)^2 triangles."""
    _within("blob: size", size, 2, LARGEST)
    _within("blob: seed", seed, 0, 2**64 - 1)
    return _shape("blob", {"size": size, "seed": seed}, *_core.blob(size, seed))
