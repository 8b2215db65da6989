# SPDX-License-Identifier: MIT
"""What a flight sees of its source: a path that looks elsewhere leaves a table of figures that say nothing.

Measured frames tell by the instrument's samples in view and by the reference pictures; without any, the box round
the source tells when no view can see it.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from ..sources.frames import extent_of

LEAST_COVERED = 0.1  # of the measured pictures, below which their figures are of a few pixels


def _corners(frame: Mapping[str, Any]) -> np.ndarray:
    """(8, 4): the corners of a box that holds the source, homogeneous."""
    if frame["kind"] == "mesh":
        box = list(zip(frame["lo"], frame["hi"], strict=True))
    elif frame["planet"]:
        reach = frame["radius"] + max(frame["z_max"], 0.0)
        box = [(-reach, reach)] * 3
    else:
        x0, y0 = frame["x0"], frame["y0"]
        east, south = (frame["cols"] - 1) * frame["dx"], (frame["rows"] - 1) * frame["dy"]
        box = [(x0, x0 + east), (y0 - south, y0), (frame["z_min"], frame["z_max"])]
    return np.array([(*corner, 1.0) for corner in itertools.product(*box)])


def misses(view: Any, frame: Mapping[str, Any]) -> bool:
    """Whether the box round a source lies beyond one side of a view's frustum."""
    x, y, _, w = (_corners(frame) @ np.asarray(view.matrix).T).T
    return any(side.all() for side in (x > w, x < -w, y > w, y < -w, w <= 0.0))


def complaint(
    path: str,
    frame: Mapping[str, Any],
    views: Sequence[Any],
    measured: Iterable[Mapping[str, Any]],
    pictures: Iterable[np.ndarray],
) -> str | None:
    """What is wrong with what a path sees, or None.

    `frame`: where the source lies; `measured`: the accuracy columns of the measured frames; `pictures`: the depths
    of their reference pictures, (H, W), inf where nothing is.
    """
    rows = list(measured)
    if frame["kind"] == "mesh":
        spans = (f"{axis} {lo:.6g} to {hi:.6g}" for axis, lo, hi in zip("xyz", frame["lo"], frame["hi"], strict=True))
        lies = f"the source lies at {', '.join(spans)}"
    else:
        lies = f"the source lies at {extent_of(frame)}, heights {frame['z_min']:g} to {frame['z_max']:g} m"
    blind = all(math.isnan(r["measured_px_max"]) for r in rows) if rows else all(misses(v, frame) for v in views)
    if blind:
        which = f"in any of {len(rows)} measured frames" if rows else "in any frame"
        return f"path {path}: it does not see the source {which}; {lies}"
    shares = [float(np.isfinite(depth).mean()) for depth in pictures]
    if shares and np.mean(shares) < LEAST_COVERED:
        return (
            f"path {path}: the surface covers {np.mean(shares):.1%} of the measured pictures (less than "
            f"{LEAST_COVERED:.0%}), and figures of empty frames say little; {lies}"
        )
    return None
