# SPDX-License-Identifier: MIT
"""The built-in paths around meshes as functions of t in 0 to 1: orbit, zoom, flyby, still.

All are made from the mesh's vertices alone, deterministic, and stay outside the surface: of a ball that no vertex lies
in, and of a plane that all lie below, no triangle of large meshes reaches far inside. Up is z; lengths are shares of
the mesh's extent, the diagonal of its box.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from ..sources.mesh import Mesh
from .terrain import NEAR_SHARE, Pose, PoseAt, Vec

_AWAY = 1.6  # of the orbit: a ball round the box fits into a picture of 16 to 9, 60 degrees wide
_ELEVATION = math.radians(20.0)
_CLOSE = 0.02  # where zoom ends
_PASS = 0.05  # how near flyby comes
_UP = np.array([0.0, 0.0, 1.0])


def _middle(mesh: Mesh) -> tuple[Vec, float]:
    low, high = np.asarray(mesh.bounds)
    return 0.5 * (low + high), float(np.linalg.norm(high - low))


def _pose(mesh: Mesh, eye: Vec, target: Vec) -> Pose:
    """A view whose near plane leaves the nearest part of the box's ball, or of what it looks at, in sight."""
    middle, extent = _middle(mesh)
    outside = float(np.linalg.norm(eye - middle)) - 0.5 * extent
    free = max(outside, 0.25 * _CLOSE * float(np.linalg.norm(target - eye)))
    return Pose(eye, target, _UP, near=NEAR_SHARE * free)


def _ring(mesh: Mesh, azimuth: float) -> Vec:
    middle, extent = _middle(mesh)
    flat = math.cos(_ELEVATION)
    way = np.array([flat * math.cos(azimuth), flat * math.sin(azimuth), math.sin(_ELEVATION)])
    return middle + _AWAY * extent * way


def orbit(mesh: Mesh) -> PoseAt:
    """Once round, looking at the middle."""
    middle, _ = _middle(mesh)
    return lambda t: _pose(mesh, _ring(mesh, 2.0 * math.pi * t - 0.5 * math.pi), middle)


def still(mesh: Mesh) -> PoseAt:
    """One view, that of the orbit after an eighth of the way."""
    pose = orbit(mesh)(0.125)
    return lambda t: pose


def zoom(mesh: Mesh) -> PoseAt:
    """From the whole mesh straight to the vertex that is nearest; the distance left falls by equal factors in equal
    times."""
    start = _ring(mesh, -0.25 * math.pi)
    used = np.asarray(mesh.positions)[np.unique(np.asarray(mesh.faces))]
    spot = used[np.argmin(np.linalg.norm(used - start, axis=1))]
    way = start - spot
    close = _CLOSE * _middle(mesh)[1] / float(np.linalg.norm(way))
    return lambda t: _pose(mesh, spot + way * close**t, spot)


def flyby(mesh: Mesh) -> PoseAt:
    """Straight past the vertex that is farthest to the south-west and up, close to it, looking ahead at it and then
    back."""
    _, extent = _middle(mesh)
    out = np.array([-0.5, -0.75, 0.43])
    out /= np.linalg.norm(out)
    along = np.cross(_UP, out)
    along /= np.linalg.norm(along)
    used = np.asarray(mesh.positions)[np.unique(np.asarray(mesh.faces))]
    spot = used[np.argmax(used @ out)]
    return lambda t: _pose(mesh, spot + extent * (_PASS * out + 1.2 * (2.0 * t - 1.0) * along), spot)


AROUND: dict[str, Callable[[Mesh], PoseAt]] = {"orbit": orbit, "zoom": zoom, "flyby": flyby, "still": still}
