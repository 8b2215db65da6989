# SPDX-License-Identifier: MIT
"""The table of scenes: the failures of level-of-detail methods that were published or reported, a row each."""

from __future__ import annotations

from . import extremes, fields, meshes, motion, structure, workers
from .stage import Scene

_HOME = ("jacksboro",)
_MESH = ("mesh:two with many levels",)
_MESHES = ("mesh:fractal", *_MESH)
_REAL = (*_HOME, fields.RAINIER, "fractal:size=1025")
_AROUND = (*_REAL, *_MESHES)
_MOVING = (*_AROUND, "earth:vertical_scale=20")
_NEAR = (*_HOME, *_MESH)
_BOUND = (*_AROUND, "planet:2-degrees")
_STEEP = (*_HOME, "cliff")
_ROUND = (*_HOME, "planet:2-degrees")
_LARGE = ("fractal:size=2049",)
_VOIDS = tuple(name for name in fields.MADE if name.startswith("voids:"))
_ANY_MESH = tuple(name for name in meshes.MADE if name not in ("mesh:fine", *_MESH, *meshes.FOLDED))
_FOLDED = tuple(meshes.FOLDED)
_FEW_FOLDED = ("mesh:folds", "mesh:nested shells")
_SIZES = (*(name for name in fields.MADE if name.startswith("size:")), "flat", "spike", "cliff")

SCENES: tuple[Scene, ...] = (
    Scene("s01", "A still camera settles", motion.still_camera, _MOVING, _NEAR),
    Scene("s02", "Budgets at a threshold settle", motion.budget_thresholds, _AROUND, _NEAR),
    Scene("s03", "History does not matter", motion.history, _AROUND, _NEAR),
    Scene("s04", "Trembling is not seen twice", motion.jitter, _AROUND, _NEAR, variants=True),
    Scene("s05", "Not everything pops at once", motion.everything_pops, _MOVING, _NEAR, variants=True),
    Scene("s06", "Triangles respond to the budget", motion.triangles_respond, (*_LARGE, "mesh:fine"), _LARGE),
    Scene("s07", "Errors nest", structure.errors_nest, (*_NEAR, "fractal:size=1025"), _NEAR),
    Scene("s08", "Neighbours many levels apart", structure.neighbours, (*_REAL, "cliff"), _STEEP, variants=True),
    Scene("s09", "Corners of several levels", structure.corners, (*_REAL, "cliff"), _STEEP, variants=True),
    Scene("s10", "Bounds are bounds", structure.bounds_hold, _BOUND, (*_ROUND, *_MESHES), variants=True),
    Scene("s11", "Voids stay holes", structure.voids, _VOIDS, _VOIDS),
    Scene("s12", "Any size; flat, spike, cliff", structure.sizes, _SIZES, _SIZES),
    Scene("s13", "Large coordinates", extremes.large_coordinates, (*_ROUND, *_MESH), (*_ROUND, *_MESH)),
    Scene("s14", "Views nobody tried", extremes.extreme_views, (*_STEEP, *_MESHES), _NEAR),
    Scene("s15", "Budgets nobody tried", extremes.extreme_budgets, (*_NEAR, "flat"), (*_NEAR, "flat")),
    Scene("s16", "Meshes of every kind", structure.any_mesh, _ANY_MESH, _ANY_MESH),
    Scene("s18", "Folded displacement", structure.folded, _FOLDED, _FEW_FOLDED, variants=True),
    Scene("s20", "Random search", workers.random_search, (fields.ANY,), (fields.ANY,)),
)
