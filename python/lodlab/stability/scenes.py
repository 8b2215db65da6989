# SPDX-License-Identifier: MIT
"""The table of scenes: the failures of level-of-detail methods that were published or reported, a row each."""

from __future__ import annotations

from . import extremes, fields, motion, structure, workers
from .stage import Scene

_HOME = ("jacksboro",)
_REAL = (*_HOME, fields.RAINIER, "fractal:size=1025")
_WIDE = (*_REAL, "earth:vertical_scale=20")
_STEEP = (*_HOME, "cliff")
_ROUND = (*_HOME, "planet:2-degrees")
_LARGE = ("fractal:size=2049",)
_VOIDS = tuple(name for name in fields.MADE if name.startswith("voids:"))
_SIZES = (*(name for name in fields.MADE if name.startswith("size:")), "flat", "spike", "cliff")

SCENES: tuple[Scene, ...] = (
    Scene("s01", "A still camera settles", motion.still_camera, _WIDE, _HOME),
    Scene("s02", "Budgets at a threshold settle", motion.budget_thresholds, _REAL, _HOME),
    Scene("s03", "History does not matter", motion.history, _REAL, _HOME),
    Scene("s04", "Trembling is not seen twice", motion.jitter, _REAL, _HOME, variants=True),
    Scene("s05", "Not everything pops at once", motion.everything_pops, _WIDE, _HOME, variants=True),
    Scene("s06", "Triangles respond to the budget", motion.triangles_respond, _LARGE, _LARGE),
    Scene("s07", "Errors nest", structure.errors_nest, (*_HOME, "fractal:size=1025"), _HOME),
    Scene("s08", "Neighbours many levels apart", structure.neighbours, (*_REAL, "cliff"), _STEEP, variants=True),
    Scene("s09", "Corners of several levels", structure.corners, (*_REAL, "cliff"), _STEEP, variants=True),
    Scene("s10", "Bounds are bounds", structure.bounds_hold, (*_REAL, "planet:2-degrees"), _ROUND, variants=True),
    Scene("s11", "Voids stay holes", structure.voids, _VOIDS, _VOIDS),
    Scene("s12", "Any size; flat, spike, cliff", structure.sizes, _SIZES, _SIZES),
    Scene("s13", "Large coordinates", extremes.large_coordinates, _ROUND, _ROUND),
    Scene("s14", "Views nobody tried", extremes.extreme_views, _STEEP, _HOME),
    Scene("s15", "Budgets nobody tried", extremes.extreme_budgets, (*_HOME, "flat"), (*_HOME, "flat")),
    Scene("s20", "Random search", workers.random_search, (fields.ANY,), (fields.ANY,)),
)
