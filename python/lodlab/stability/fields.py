# SPDX-License-Identifier: MIT
"""The sources of the scenes: SOURCE texts, and sources made for one failure each, known by a name.

Those that carry real heights cut them from `jacksboro`. A name with `planet` in it stands on a sphere, one with `mesh`
is a mesh (`meshes`).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .. import _core, sources
from ..sources.base import Source
from ..sources.heightfield import HeightField
from . import meshes

RAINIER = "mt_rainier_srtm3.tif"  # of the shared data, played where it is there
SPACING = (30.0, 40.0)
ANY = "random"  # not a source of its own: the search draws one for each trial


def hills(rows: int, cols: int) -> np.ndarray:
    """(rows, cols) float64: a window of the generated terrain, the same wherever it is asked for."""
    return _core.fractal(rows, cols, 11, 7, seed=3, roughness=0.5).astype(np.float64)


def flat(rows: int, cols: int) -> np.ndarray:
    return np.full((rows, cols), 12.5)


def spike(rows: int, cols: int) -> np.ndarray:
    heights = np.zeros((rows, cols))
    heights[rows // 3, cols // 2] = 2500.0
    return heights


def cliff(rows: int, cols: int) -> np.ndarray:
    """Two plateaus, 900 m apart, that meet in a step of one sample."""
    return np.where(np.arange(cols)[None, :] < cols // 2, 0.0, 900.0) + np.zeros((rows, 1))


def checker(rows: int, cols: int) -> np.ndarray:
    """Every other sample 100 m high: nothing coarser comes near."""
    return 100.0 * (np.add.outer(np.arange(rows), np.arange(cols)) % 2)


def ramp(rows: int, cols: int) -> np.ndarray:
    """A plane that rises by 100 m a sample."""
    return 100.0 * np.add.outer(np.arange(rows), np.arange(cols)).astype(np.float64)


#: Heights (rows, cols) by name: contract, scenes and search draw from them.
SHAPES: dict[str, Callable[[int, int], np.ndarray]] = {
    "hills": hills,
    "flat": flat,
    "spike": spike,
    "cliff": cliff,
    "checker": checker,
    "ramp": ramp,
}


def holed(heights: np.ndarray) -> np.ndarray:
    """A copy with a hole at a corner, along an edge, and inside."""
    heights = heights.copy()
    rows, cols = heights.shape
    heights[: rows // 5, : cols // 5] = np.nan
    heights[rows // 2 : rows // 2 + 3, -4:] = np.nan
    heights[rows // 2, cols // 3 : cols // 2] = np.nan
    return heights


def punched(void: float) -> np.ndarray:
    """Jacksboro's whole heights with holes: a corner, along an edge, and inside."""
    heights = np.array(sources.load("jacksboro").heights)
    rows, cols = heights.shape
    heights[: rows // 6, : cols // 6] = void
    heights[rows // 2 : 3 * rows // 4, -25:] = void
    heights[rows // 3 : rows // 2, cols // 2 : 2 * cols // 3] = void
    return heights


def _thin() -> np.ndarray:
    """A piece of jacksboro small enough for a sample to be pixels wide: a slit, a single sample, a corner's sample."""
    heights = np.array(sources.load("jacksboro").heights)[100:160, 100:170]
    heights[20, 10:40] = np.nan
    heights[30:50, 50] = np.nan
    heights[40, 20] = np.nan
    heights[-1, 0] = np.nan
    return heights


def _islands() -> np.ndarray:
    """Nearly everything void: a block, a line, a pair and a single sample are left."""
    heights = np.full((130, 150), np.nan)
    heights[20:40, 30:60] = hills(20, 30)
    heights[70, 10:140] = 100.0
    heights[100, 50:52] = 120.0
    heights[110, 110] = 90.0
    return heights


def _whole(void: int) -> Callable[[], HeightField]:
    return lambda: HeightField(punched(void).astype(np.int16), spacing=(75.0, 92.0), nodata=void)


def _flat_field(make: Callable[[], np.ndarray]) -> Callable[[], HeightField]:
    return lambda: HeightField(make(), spacing=SPACING)


def sphere(height: float = 0.0, relief: float = 0.0) -> HeightField:
    """A planet of Earth's radius, 2 degrees a sample."""
    rows, cols = 91, 180
    return HeightField(height + relief * hills(rows, cols), planet=True)


#: Made for one failure each.
MADE: dict[str, Callable[[], HeightField]] = {
    "voids:nodata=-32768": _whole(-32768),
    "voids:nodata=-9999": _whole(-9999),
    "voids:nan": lambda: HeightField(punched(np.nan), spacing=(75.0, 92.0)),
    "voids:thin": _flat_field(_thin),
    "voids:nearly-all": _flat_field(_islands),
    "voids:all": _flat_field(lambda: np.full((40, 50), np.nan)),
    "size:1x1": _flat_field(lambda: np.zeros((1, 1))),
    "size:1x60": _flat_field(lambda: hills(2, 60)[:1]),
    "size:60x1": _flat_field(lambda: hills(60, 2)[:, :1]),
    "size:2x2": _flat_field(lambda: np.array([[0.0, 3.0], [1.0, 7.0]])),
    "size:2x150": _flat_field(lambda: hills(2, 150)),
    "size:150x2": _flat_field(lambda: hills(150, 2)),
    "size:128x128": _flat_field(lambda: hills(128, 128)),
    "size:131x90": _flat_field(lambda: hills(131, 90)),
    "flat": _flat_field(lambda: flat(97, 130)),
    "spike": _flat_field(lambda: spike(120, 140)),
    "cliff": _flat_field(lambda: cliff(300, 321)),
    "planet:2-degrees": lambda: sphere(relief=1.0),
}
REFUSED = ("voids:all", "size:1x1", "size:1x60", "size:60x1", *meshes.REFUSED)  # no sources, by their own rule


def load(name: str) -> Source:
    """The source of this name; InvalidInput for those of `REFUSED`."""
    if name in meshes.MADE:
        return meshes.load(name)
    return MADE[name]() if name in MADE else sources.load(name)


def kind(name: str) -> str:
    """What a method must accept to be put on it: `heightfield`, `planet` or `mesh`."""
    return next((kind for kind in ("mesh", "planet") if kind in name), "heightfield")


def at_hand(names: tuple[str, ...]) -> list[str]:
    """The sources that are there: further data may not be."""
    return [name for name in names if name != RAINIER or sources.find_file(name) is not None]
