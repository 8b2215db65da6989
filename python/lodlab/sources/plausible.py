# SPDX-License-Identifier: MIT
"""What a raster's heights are looked at for: undeclared marks of voids, values that no height has, rounding to
32-bit floats, and slopes that spacing and relief cannot have together. Piece by piece, for sources read by windows.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable

import numpy as np

from ..errors import InvalidInput

# What undeclared voids are customarily marked with; and so is whatever is farther than HUGE from 0.
MARKS = (-32768.0, -32767.0, -9999.0, -99999.0, -999999.0, -(2.0**31))
MARKS += (9999.0, 32767.0, 65535.0, 99999.0, 999999.0, 2.0**31 - 1)
HUGE = 1e30
MOST = 1e9  # metres: no height of any planet's, whatever its unit
STEEP = 20.0  # 87 degrees
ROUNDED = 2.0**-16  # of the relief
_PIECE = 1 << 22  # samples looked at together
_LINES = 64  # rows whose slopes are looked at, of each piece


# ---- marks of voids -------------------------------------------------------------------------------


def marked(array: np.ndarray, mark: float) -> np.ndarray | None:
    """Where an array holds a mark; None where its type has no such value.

    Of floats the last two bits may differ, as GDAL's masks have it: marks near the end of 32-bit floats are
    declared and stored with their decimals cut differently.
    """
    if array.dtype.kind != "f":
        limits = np.iinfo(array.dtype)
        held = float(mark).is_integer() and limits.min <= int(mark) <= limits.max
        return array == array.dtype.type(int(mark)) if held else None
    if math.isnan(mark):
        return None
    ends = np.finfo(array.dtype)
    single = array.dtype.itemsize <= 4 or abs(mark) > HUGE
    slack = abs(mark) * (4.0 * float(np.finfo(np.float32 if single else np.float64).eps))
    low, high = max(mark - slack, float(ends.min)), min(mark + slack, float(ends.max))
    if math.isinf(mark):
        low = high = mark
    kind = array.dtype.type
    return (array >= kind(low)) & (array <= kind(high))


def outlying(low: float, high: float, rest: Callable[[tuple[float, ...]], tuple[float, float]]) -> tuple[float, ...]:
    """The customary marks among the lowest and highest sample: farther from all others than these are apart.

    `rest` gives the lowest and highest sample without some values; inf and -inf where nothing is left.
    """
    ends = tuple(dict.fromkeys(v for v in (low, high) if v in MARKS or HUGE < abs(v) < math.inf))
    if not ends:
        return ()
    below, above = rest(ends)
    return tuple(v for v in ends if max(below - v, v - above) > above - below >= 0.0)


def extremes(array: np.ndarray, valid: np.ndarray | None, marks: tuple[float, ...]) -> tuple[float, float]:
    """Lowest and highest of the real samples that are none of the marks; inf and -inf where there are none."""
    real = array if valid is None else array[valid]
    for mark in marks:
        here = marked(real, mark)
        real = real if here is None else real[~here]
    if real.dtype.kind == "f":
        real = real[~np.isnan(real)]
    return (float(real.min()), float(real.max())) if real.size else (math.inf, -math.inf)


def guess_nodata(samples: np.ndarray, path: str) -> tuple[float, ...]:
    """The marks that a raster uses without declaring them, with a warning; none where a mask says what is void."""
    if isinstance(samples, np.ma.MaskedArray) or samples.dtype.kind not in "iuf" or samples.size == 0:
        return ()
    found = outlying(*extremes(samples, None, ()), lambda marks: extremes(samples, None, marks))
    for mark in found:
        here = marked(samples, mark)
        warnings.warn(
            f"{path}: {np.count_nonzero(here)} samples hold {mark:g}, which it does not declare as nodata; they are "
            "taken as void (nodata=none keeps them)",
            stacklevel=4,
        )
    return found


# ---- heights --------------------------------------------------------------------------------------


class Rounding:
    """How far heights move when they become 32-bit floats, beside their relief."""

    def __init__(self) -> None:
        self._worst = 0.0
        self._low, self._high = math.inf, -math.inf

    def add(self, stored: np.ndarray, heights: np.ndarray, valid: np.ndarray | None, scale: float, offset: float):
        """Samples as stored, (h, w), and the heights that were made of them: stored * scale + offset."""
        if stored.dtype.itemsize < 4 or stored.dtype == np.float32:
            return
        step = max(1, _PIECE // stored.shape[1])
        for row in range(0, stored.shape[0], step):
            part = np.s_[row : row + step]
            exact = stored[part].astype(np.float64) * scale + offset
            real = np.isfinite(exact) if valid is None else valid[part] & np.isfinite(exact)
            moved = np.abs(heights[part] - exact, where=real, out=np.zeros(exact.shape))
            self._worst = max(self._worst, float(moved.max()))
            self._low = min(self._low, float(exact.min(where=real, initial=math.inf)))
            self._high = max(self._high, float(exact.max(where=real, initial=-math.inf)))

    def warn(self, name: str, vertical_scale: float) -> None:
        """A warning where more than ROUNDED of the relief is lost, with the offset (before `vertical_scale`) that
        brings the heights near 0."""
        relief = self._high - self._low
        if not self._worst > ROUNDED * relief > 0.0:
            return
        middle = -0.5 * (self._low + self._high) / vertical_scale
        step = 10.0 ** math.floor(math.log10(relief / vertical_scale))
        warnings.warn(
            f"{name}: its heights are rounded by up to {self._worst:.3g} m to fit 32-bit floats, "
            f"{self._worst / relief:.2g} of their relief; offset={round(middle / step) * step:.15g} (on top of any "
            "given) shifts the whole field so that they keep their last digits",
            stacklevel=4,
        )


class Slopes:
    """How steep the ground is on average, along some of its rows. A vertical scale above 1 is meant to exaggerate,
    one below to convert: the first is left out."""

    def __init__(self, spacing: float, vertical_scale: float) -> None:
        self._spacing = spacing
        self._exaggeration = max(1.0, vertical_scale)
        self._rise, self._steps = 0.0, 0

    def add(self, heights: np.ndarray, valid: np.ndarray | None) -> None:
        """(h, w) heights, metres; some rows are looked at."""
        rows = np.s_[:: max(1, heights.shape[0] // _LINES)]
        steps = np.abs(np.diff(heights[rows].astype(np.float64), axis=1))
        if valid is not None:
            steps = steps[valid[rows, 1:] & valid[rows, :-1]]
        self._rise += float(steps.sum())
        self._steps += steps.size

    def warn(self, path: str, why: str) -> None:
        """A warning where the ground is steeper than STEEP."""
        slope = self._rise / (max(self._steps, 1) * self._spacing * self._exaggeration)
        if slope > STEEP:
            warnings.warn(
                f"{path}: its ground rises {slope:.3g} m a metre on average: its heights and its spacing of "
                f"{self._spacing:.6g} m cannot belong together{why}",
                stacklevel=4,
            )


def check_heights(
    heights: np.ndarray, valid: np.ndarray | None, stored: np.ndarray, name: str, says: str, row0: int = 0
) -> None:
    """InvalidInput for a height of a raster file that no height is; `says` is what the file says of its voids."""
    step = max(1, _PIECE // heights.shape[1])
    for first in range(0, heights.shape[0], step):
        with np.errstate(invalid="ignore"):
            bad = ~(np.abs(heights[first : first + step]) <= MOST)
        if valid is not None:
            bad &= valid[first : first + step]
        if bad.any():
            row, col = (int(v) for v in np.unravel_index(int(np.argmax(bad)), bad.shape))
            value = stored[first + row, col].item()
            raise InvalidInput(
                f"open {name}: sample at row {row0 + first + row}, column {col} is {value!r}, which cannot be a "
                f"height; {says}; nodata={value!r} takes it as void (several marks: nodata=A/B)"
            )
