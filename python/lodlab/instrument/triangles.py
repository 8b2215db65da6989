# SPDX-License-Identifier: MIT
"""Any triangles against any source, without a method and without a store: `lodlab.measure`."""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import _core
from ..errors import InvalidInput
from ..sources.base import Source
from ..sources.datasets import as_source
from ..sources.mesh import Mesh, is_trimesh
from .metrics import METRICS
from .yardstick import Yardstick


def measure(triangles: Any, source: Any, view: Any = None) -> dict[str, float]:
    """Every accuracy column of any triangles against a source, by name, as `fly` has them of a cut (`docs/columns.md`).

    `triangles`: (T, 3, 3) real numbers in source coordinates (x east, y north, z up), counter-clockwise from outside;
    or a pair (positions (V, 3), faces (F, 3)), a Mesh, a trimesh object, or what `store.capture` returns, whose
    fillers count as such. `source`: a HeightField, a Mesh, or what names one (SOURCE text, array, trimesh object).
    `view`: a lodlab.View, for the columns on screen: a picture of the triangles is drawn and compared with the
    source's (of a mesh without its colours, which triangles do not have).

    Distances are in source units. nan: undefined, as all that needs a picture is without a view (no GL context is
    needed then), and what only cuts have (`predicted_px`, pops, `capture_mismatch_pixels`). Meshes are measured from
    the coordinates as given; height fields, and cracks, from 32-bit floats relative to the eye, or without a view to
    the middle of the source: off by at most four float steps at the distance from there. An edge without a partner
    lies on the border of a mesh, and is no crack, where it is within `measured_max` of it.

    InvalidInput: other shapes or types, no triangles, a position that is not finite or beyond 1e30, an eye too far
    away to tell samples apart. Unsupported: a maximum that cannot be found within the work allowed.

        simple = trimesh.load("simplified.ply")
        lodlab.measure(simple, "armadillo.off")["measured_max"]
        lodlab.measure(simple, "armadillo.off", lodlab.View((0, 0, 300), (0, 0, 0)))["measured_px_max"]
    """
    if view is not None and not isinstance(view, _core.View):
        raise InvalidInput(f"measure: view {view!r} is no lodlab.View; path.view(frame) makes one of a CameraPath")
    corners, fillers = _corners(triangles)
    yardstick = Yardstick(_bare(as_source(source)), progress=False, metrics="geometry" if view is None else "all")
    reference = None if view is None else yardstick.reference(view)
    measurement = yardstick.instrument().examine_triangles(corners, fillers, view, reference)
    return {metric.name: metric.of(measurement) for metric in METRICS}


def _corners(triangles: Any) -> tuple[np.ndarray, np.ndarray | None]:
    """(T, 3, 3) float64, and (T,) uint8 that says which are fillers."""
    if isinstance(triangles, _core.Capture):
        return triangles.triangles, triangles.kind
    if isinstance(triangles, tuple) and len(triangles) == 2:
        triangles = Mesh(*triangles, name="triangles")
    elif is_trimesh(triangles):
        triangles = Mesh(triangles.vertices, triangles.faces, name="triangles")
    if isinstance(triangles, Mesh):
        return triangles.positions[triangles.faces], None
    try:
        corners = np.asarray(triangles)
    except ValueError as error:
        raise InvalidInput(f"measure: triangles are no array: {error}") from None
    if corners.dtype.kind not in "iuf" or corners.shape[1:] != (3, 3):
        raise InvalidInput(
            f"measure: triangles are {corners.dtype} of shape {corners.shape}, not real numbers (T, 3, 3), a pair "
            "(positions, faces), a Mesh, a trimesh object or a capture"
        )
    return np.asarray(corners, np.float64), None


def _bare(source: Source) -> Source:
    """The source without colours of its own."""
    return Mesh(source.positions, source.faces) if isinstance(source, Mesh) and source.colors is not None else source
