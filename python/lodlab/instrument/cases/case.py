# SPDX-License-Identifier: MIT
"""What a calibration case is made of, and the sheets, balls and cameras that cases are told in.

A case names a source, what is drawn in its place (stores of other fields, each with its own grid), a view, and
what the metrics must return, computed on paper: from the pinhole formula and plane geometry, never from the
instrument or from the cameras of this package.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..._core import View
from ...sources.base import Source
from ...sources.heightfield import HeightField

SIDE = 256  # pixels of a picture's side, where a case does not say otherwise
FOV = 90.0  # degrees, likewise


def focal(fov: float = FOV, width: int = SIDE) -> float:
    """Pixels per unit at distance 1: half the width over the tangent of half the field of view."""
    return 0.5 * width / math.tan(math.radians(0.5 * fov))


K = focal()  # 128


@dataclass(frozen=True)
class Drawn:
    """One store that is drawn: its field, method, options, and which of its cuts.

    `nodes`: the cut by hand; None: what `select` picks under `budget`; empty: when every error is allowed.
    """

    field: Source
    method: str = "full"
    build: Mapping[str, Any] = field(default_factory=dict)
    draw: Mapping[str, Any] = field(default_factory=dict)
    nodes: tuple[int, ...] | None = None
    budget: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Case:
    """`drawn` in place of `source` under `view`; metric names and their values on paper.

    `before`: what the frame before drew. The value may be nan (undefined) or inf.
    """

    name: str
    source: Source
    drawn: tuple[Source | Drawn, ...]
    view: View
    expected: Mapping[str, float]
    before: tuple[Source | Drawn, ...] = ()


Height = float | Callable[[np.ndarray, np.ndarray], np.ndarray]


def sheet(x: tuple[float, float], y: tuple[float, float], shape: tuple[int, int], z: Height = 0.0) -> HeightField:
    """A field of `shape` (rows, columns) over the ranges x and y, metres; z is a height or z(x, y)."""
    rows, cols = shape
    xs, ys = np.meshgrid(np.linspace(*x, cols), np.linspace(y[1], y[0], rows))
    heights = z(xs, ys) if callable(z) else np.full(shape, z)
    spacing = ((x[1] - x[0]) / (cols - 1), (y[1] - y[0]) / (rows - 1))
    return HeightField(heights.astype(np.float32), spacing=spacing, origin=(x[0], y[1]))


def square(half: float, cells: int, z: Height = 0.0) -> HeightField:
    """A sheet of cells x cells over [-half, half] both ways."""
    return sheet((-half, half), (-half, half), (cells + 1, cells + 1), z)


def spike(at: tuple[float, float], height: float, base: float = 0.0) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    """z(x, y): `base`, but `height` above it at the one sample `at`."""

    def z(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return base + np.where((x == at[0]) & (y == at[1]), height, 0.0)

    return z


def ball(radius: float, rows: int, cols: int, bump: tuple[int, int, float] | None = None) -> HeightField:
    """A whole planet without relief, but for a bump (row, col, height); at a pole it stands in every column."""
    heights = np.zeros((rows, cols), np.float32)
    if bump is not None:
        row, col, height = bump
        heights[row, slice(None) if row in (0, rows - 1) else col] = height
    return HeightField(heights, planet=True, radius=radius)


def from_above(eye: tuple[float, float, float], **more: Any) -> View:
    """Straight down, x to the right and y up in the picture."""
    return View(eye, (eye[0], eye[1], 0.0), **({"up": (0.0, 1.0, 0.0), "fov": FOV, "size": (SIDE, SIDE)} | more))


def level(eye: tuple[float, float, float], **more: Any) -> View:
    """Along +y, the horizon across the middle of the picture."""
    return View(eye, (eye[0], eye[1] + 100.0, eye[2]), **({"fov": FOV, "size": (SIDE, SIDE)} | more))


def pixel_offsets(width: int = SIDE, height: int = SIDE) -> tuple[np.ndarray, np.ndarray]:
    """(height, width) right and up: pixel centres from the middle of the picture, in pixels."""
    return np.meshgrid(np.arange(width) + 0.5 - 0.5 * width, 0.5 * height - 0.5 - np.arange(height))


def nearest_rank(values: np.ndarray, share: float = 0.99) -> float:
    """The smallest of the values that this share of them does not exceed."""
    ordered = np.sort(values, axis=None)
    return float(ordered[math.ceil(round(share * ordered.size, 6)) - 1])


def rms(values: np.ndarray) -> float:
    return math.sqrt(float(np.mean(np.square(values))))
