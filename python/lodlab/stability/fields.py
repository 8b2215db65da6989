# SPDX-License-Identifier: MIT
"""The sources of the scenes: SOURCE texts, and fields made for one failure each, known by a name.

Those that carry real heights cut them from `jacksboro`. A name with `planet` in it stands on a sphere.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .. import _core, sources
from ..heightfield import HeightField

RAINIER = "mt_rainier_srtm3.tif"  # of the shared data, played where it is there
SPACING = (30.0, 40.0)


def _hills(rows: int, cols: int) -> np.ndarray:
    return _core.fractal(rows, cols, 11, 7, seed=3, roughness=0.5).astype(np.float64)


def _flat() -> np.ndarray:
    return np.full((97, 130), 12.5)


def _spike() -> np.ndarray:
    heights = np.zeros((120, 140))
    heights[41, 77] = 2500.0
    return heights


def _cliff() -> np.ndarray:
    """Two plateaus, 900 m apart, that meet in a step of one sample."""
    return np.where(np.arange(321)[None, :] < 150, 0.0, 900.0) + np.zeros((300, 1))


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
    heights[20:40, 30:60] = _hills(20, 30)
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
    return HeightField(height + relief * _hills(rows, cols), planet=True)


#: Made for one failure each.
MADE: dict[str, Callable[[], HeightField]] = {
    "voids:nodata=-32768": _whole(-32768),
    "voids:nodata=-9999": _whole(-9999),
    "voids:nan": lambda: HeightField(punched(np.nan), spacing=(75.0, 92.0)),
    "voids:thin": _flat_field(_thin),
    "voids:nearly-all": _flat_field(_islands),
    "voids:all": _flat_field(lambda: np.full((40, 50), np.nan)),
    "size:1x1": _flat_field(lambda: np.zeros((1, 1))),
    "size:1x60": _flat_field(lambda: _hills(2, 60)[:1]),
    "size:60x1": _flat_field(lambda: _hills(60, 2)[:, :1]),
    "size:2x2": _flat_field(lambda: np.array([[0.0, 3.0], [1.0, 7.0]])),
    "size:2x150": _flat_field(lambda: _hills(2, 150)),
    "size:150x2": _flat_field(lambda: _hills(150, 2)),
    "size:128x128": _flat_field(lambda: _hills(128, 128)),
    "size:131x90": _flat_field(lambda: _hills(131, 90)),
    "flat": _flat_field(_flat),
    "spike": _flat_field(_spike),
    "cliff": _flat_field(_cliff),
    "planet:2-degrees": lambda: sphere(relief=1.0),
}
REFUSED = ("voids:all", "size:1x1", "size:1x60", "size:60x1")  # no height fields, by HeightField's own rule


def load(name: str) -> HeightField:
    """The source of this name; InvalidInput for those of `REFUSED`."""
    return MADE[name]() if name in MADE else sources.load(name)


def kind(name: str) -> str:
    """What a method must accept to be put on it: `heightfield` or `planet`."""
    return "planet" if "planet" in name else "heightfield"


def at_hand(names: tuple[str, ...]) -> list[str]:
    """The sources that are there: further data may not be."""
    return [name for name in names if name != RAINIER or sources.find_file(name) is not None]
