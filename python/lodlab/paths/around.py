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

_AWAY = 3.3  # radii, of the orbit: the ball round the vertices fits into a picture of 16 to 9, 60 degrees wide
_ELEVATION = math.radians(20.0)
_CLOSE = 0.02  # where zoom ends
_PASS = 0.05  # how near flyby comes
_UP = np.array([0.0, 0.0, 1.0])


class _Round:
    """What paths know of a mesh: the vertices of its triangles, its extent, and the ball about the middle of its box
    that holds them."""

    def __init__(self, mesh: Mesh) -> None:
        self.vertices = np.asarray(mesh.positions)[np.unique(np.asarray(mesh.faces))]
        self.extent = mesh.extent
        self.middle: Vec = np.asarray(mesh.bounds).mean(axis=0)
        self.radius = float(np.linalg.norm(self.vertices - self.middle, axis=1).max())

    def pose(self, eye: Vec, target: Vec) -> Pose:
        """A view whose near plane leaves the nearest part of the ball, or of what it looks at, in sight."""
        outside = float(np.linalg.norm(eye - self.middle)) - self.radius
        free = max(outside, 0.25 * _CLOSE * float(np.linalg.norm(target - eye)))
        return Pose(eye, target, _UP, near=NEAR_SHARE * free)

    def ring(self, azimuth: float) -> Vec:
        """A place on the orbit."""
        flat = math.cos(_ELEVATION)
        way = np.array([flat * math.cos(azimuth), flat * math.sin(azimuth), math.sin(_ELEVATION)])
        return self.middle + _AWAY * self.radius * way


def orbit(mesh: Mesh) -> PoseAt:
    """Once round, looking at the middle."""
    it = _Round(mesh)
    return lambda t: it.pose(it.ring(2.0 * math.pi * t - 0.5 * math.pi), it.middle)


def still(mesh: Mesh) -> PoseAt:
    """One view, that of the orbit after an eighth of the way."""
    pose = orbit(mesh)(0.125)
    return lambda t: pose


def zoom(mesh: Mesh) -> PoseAt:
    """From the whole mesh straight to the vertex that is nearest; the distance left falls by equal factors in equal
    times."""
    it = _Round(mesh)
    start = it.ring(-0.25 * math.pi)
    spot = it.vertices[np.argmin(np.linalg.norm(it.vertices - start, axis=1))]
    way = start - spot
    close = _CLOSE * it.extent / float(np.linalg.norm(way))
    return lambda t: it.pose(spot + way * close**t, spot)


def flyby(mesh: Mesh) -> PoseAt:
    """Straight past the vertex that is farthest to the south-west and up, close to it, looking ahead at it and then
    back."""
    it = _Round(mesh)
    out = np.array([-0.5, -0.75, 0.43])
    out /= np.linalg.norm(out)
    along = np.cross(_UP, out)
    along /= np.linalg.norm(along)
    spot = it.vertices[np.argmax(it.vertices @ out)]
    return lambda t: it.pose(spot + it.extent * (_PASS * out + 1.2 * (2.0 * t - 1.0) * along), spot)


AROUND: dict[str, Callable[[Mesh], PoseAt]] = {"orbit": orbit, "zoom": zoom, "flyby": flyby, "still": still}
