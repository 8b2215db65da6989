# SPDX-License-Identifier: MIT
"""Cases on meshes: plates a known gap apart, half a plate, a cube with a bump, the sagitta of a refined icosahedron.

Distances are those of plane geometry, both ways; a point corresponds to the closest one.
"""

from __future__ import annotations

import math

import numpy as np

from ..._core import View
from ...sources.mesh import Mesh
from ...sources.shapes import icosphere
from .case import FOV, SIDE, Case, K

GAP = 0.25
EYE = 2.0  # above the plates
VIEW = View((0.5, 0.5, EYE), (0.5, 0.5, 0.0), up=(0.0, 1.0, 0.0), fov=FOV, size=(SIDE, SIDE))
NAN = math.nan


def _plate(cells: int, z: float = 0.0, rows: int | None = None) -> Mesh:
    """The unit square at height z, cells x cells, outside up; of its rows of cells the first ones."""
    at = np.linspace(0.0, 1.0, cells + 1)
    x, y = np.meshgrid(at, at)
    row, col = np.divmod(np.arange((cells if rows is None else rows) * cells), cells)
    a = row * (cells + 1) + col
    faces = np.stack([a, a + 1, a + cells + 2, a, a + cells + 2, a + cells + 1], axis=1).reshape(-1, 3)
    return Mesh(np.stack([x.ravel(), y.ravel(), np.full(x.size, z)], axis=1), faces)


def _cube(bump: float = 0.0) -> Mesh:
    """[-1, 1]^3, its top four triangles round a middle that stands up by the bump."""
    corners = np.array([[x, y, z] for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)], float)
    top = [[4, 5, 8], [5, 7, 8], [7, 6, 8], [6, 4, 8]]
    rest = [
        [0, 2, 3],
        [0, 3, 1],
        [0, 1, 5],
        [0, 5, 4],
        [2, 6, 7],
        [2, 7, 3],
        [0, 4, 6],
        [0, 6, 2],
        [1, 3, 7],
        [1, 7, 5],
    ]
    return Mesh(np.vstack([corners, [0.0, 0.0, 1.0 + bump]]), np.array(top + rest))


def _both(to_drawn: float, to_source: float) -> dict[str, float]:
    names = ("measured_max_source_to_drawn", "measured_max_drawn_to_source")
    return dict(zip(names, (to_drawn, to_source), strict=True)) | {"measured_max": max(to_drawn, to_source)}


def _lifted() -> Case:
    # A corner is sqrt(1/2) off the axis, at distances EYE and EYE - GAP. The 16 edges of the drawn border lie off the
    # source's, and each is a crack.
    corner = K * math.sqrt(0.5) * (1.0 / (EYE - GAP) - 1.0 / EYE)
    expected = _both(GAP, GAP) | {
        "measured_rms": GAP,
        "measured_rms_source_to_drawn": GAP,
        "measured_rms_drawn_to_source": GAP,
        "measured_px_max": corner,
        "pop_px_max": corner,
        "measured_samples": 25,
        "crack_edges": 16,
        "hole_samples": NAN,
        "inverted_triangles": 0,  # nothing is said of what is off by more than its bound
    }
    return Case("mesh, a plate above the plate", _plate(4), (_plate(4, GAP),), VIEW, expected, before=(_plate(4),))


def _half() -> Case:
    # Half of the surface is up to 1/2 away, the mean square over it a third of 1/4. Two edges end inside.
    expected = _both(0.5, 0.0) | {
        "measured_rms_source_to_drawn": math.sqrt(0.5 * 0.25 / 3.0),
        "measured_rms_drawn_to_source": 0.0,
        "crack_edges": 2,
    }
    return Case("mesh, half of a plate", _plate(2), (_plate(2, rows=1),), VIEW, expected)


def _bump() -> Case:
    # From the tip straight down; back from below the tip to a side of the pyramid, by the height of the triangle of
    # bump and half a base.
    h = 0.5
    view = View((0.0, -4.0, 3.0), (0.0, 0.0, 0.0), fov=FOV, size=(SIDE, SIDE))
    expected = _both(h, h / math.hypot(h, 1.0)) | {"crack_edges": 0}
    return Case("mesh, a cube without its bump", _cube(h), (_cube(),), view, expected)


def _sagitta() -> Case:
    # The middle triangle of a refined equilateral one has half the tangent: of the angle from the axis to a corner.
    inradius = (3.0 * math.sqrt(3.0) + math.sqrt(15.0)) / 12.0 / math.sqrt((5.0 + math.sqrt(5.0)) / 8.0)
    tangent = math.tan(math.acos(inradius))
    off = [math.cos(math.atan(tangent / 2.0**level)) for level in (4, 2)]
    view = View((0.0, -3.0, 0.0), (0.0, 0.0, 0.0), fov=FOV, size=(SIDE, SIDE))
    expected = {"measured_max_source_to_drawn": off[0] - off[1], "crack_edges": 0, "measured_samples": 2562}
    return Case("mesh, a sphere drawn two levels coarser", icosphere(4), (icosphere(2),), view, expected)


def _turned() -> Case:
    # Two triangles of the cube's top the other way round: each has three edges, one of them common to both; of those
    # that the rest of the cube has too, both directed edges lack their opposite.
    cube = _cube()
    faces = cube.faces.copy()
    faces[:2] = faces[:2, ::-1]
    view = View((0.0, -4.0, 3.0), (0.0, 0.0, 0.0), fov=FOV, size=(SIDE, SIDE))
    expected = _both(0.0, 0.0) | {"inverted_triangles": 2, "crack_edges": 8, "slanted_filler_triangles": NAN}
    return Case("mesh, a cube with two triangles turned", cube, (Mesh(cube.positions, faces),), view, expected)


def mesh_cases() -> list[Case]:
    """All of them."""
    return [_lifted(), _half(), _bump(), _sagitta(), _turned()]
