# SPDX-License-Identifier: MIT
"""The surface below a camera: heights between samples, and places given by metres east and north.

Flat fields and planets look alike from here: a place is an anchor (row, column) plus metres east and north
of it (on a planet: distance and azimuth along a great circle) plus an altitude above the datum (z = 0, or
the sphere). The surface between samples is the one that is drawn, with the diagonals of the 4-8 mesh.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..sources.base import FieldSource

Vec = np.ndarray  # (3,) float64
_BAND = 256  # rows that are looked at together
_NARROW = 7  # samples: what is narrower, and stands out of all others, is an outlier
_TAIL = 2.0  # per cent of the samples at either end, beside which outliers are looked for
_GLANCE = 1 << 17  # samples that make the percentiles


@dataclass(frozen=True)
class _Relief:
    """Highest and lowest sample of each of up to 24 x 24 blocks, outliers left out, and between which heights there
    is none: the percentiles 2 and 98, widened by as much as they are apart."""

    row_cuts: np.ndarray
    col_cuts: np.ndarray
    tops: np.ndarray
    lows: np.ndarray
    fence: tuple[float, float]


class Ground:
    """Heights, places and directions on a height field; voids count as filled."""

    def __init__(self, field: FieldSource) -> None:
        core = field._core
        self.core = core
        self.heights = field.grid
        self.rows, self.cols = core.rows, core.cols
        self.planet, self.radius = core.planet, core.radius
        if self.planet:
            middle = math.radians(core.lat0 - 0.5 * (self.rows - 1) * core.dlat)
            width = (self.cols - (0 if core.wraps else 1)) * math.radians(core.dlon) * self.radius
            self.width, self.height = width * max(math.cos(middle), 0.1), (self.rows - 1) * core.dy
            self.spacing = min(core.dx * max(math.cos(middle), 0.1), core.dy)
        else:
            self.width, self.height = (self.cols - 1) * core.dx, (self.rows - 1) * core.dy
            self.spacing = min(core.dx, core.dy)
        longest = 3.3 * self.radius if self.planet else math.inf
        self.extent = min(max(self.width, self.height), longest)
        self.centre = (0.5 * (self.rows - 1), 0.5 * (self.cols - 1))

    def cell_of(self, point: Vec) -> tuple[float, float]:
        """Fractional (row, column) below a point; outside the field that of the nearest edge."""
        core = self.core
        if self.planet:
            lat = math.degrees(math.atan2(point[2], math.hypot(point[0], point[1])))
            lon = math.degrees(math.atan2(point[1], point[0]))
            row = (core.lat0 - lat) / core.dlat
            span = 360.0 / core.dlon
            col = (lon - core.lon0) / core.dlon % span
            if not core.wraps and col > 0.5 * (self.cols - 1 + span):
                col -= span  # nearer to the western edge
        else:
            row, col = (core.y0 - point[1]) / core.dy, (point[0] - core.x0) / core.dx
        last = self.cols if core.wraps else self.cols - 1
        return min(max(row, 0.0), self.rows - 1.0), min(max(col, 0.0), float(last))

    def surface(self, row: float, col: float) -> float:
        """Height of the full-resolution surface at a fractional sample."""
        r = min(int(row), self.rows - 2)
        c = min(int(col), (self.cols if self.core.wraps else self.cols - 1) - 1)
        east = (c + 1) % self.cols
        v, u = row - r, col - c
        h = self.heights
        a, b, d, e = float(h[r, c]), float(h[r, east]), float(h[r + 1, c]), float(h[r + 1, east])
        if (r + c) % 2 == 0:  # cut from (r, c) to (r + 1, c + 1)
            return a + (b - a) * u + (e - b) * v if u >= v else a + (e - d) * u + (d - a) * v
        return a + (b - a) * u + (d - a) * v if u + v <= 1 else e + (d - e) * (1 - u) + (b - e) * (1 - v)

    def height_below(self, point: Vec) -> float:
        """Height of the surface below a point, above the datum."""
        return self.surface(*self.cell_of(point))

    def altitude(self, point: Vec) -> float:
        """Height of a point above the datum."""
        return float(np.linalg.norm(point)) - self.radius if self.planet else float(point[2])

    def clearance(self, point: Vec) -> float:
        """Height of a point above the surface below it."""
        return self.altitude(point) - self.height_below(point)

    def samples_near(self, point: Vec, reach: float) -> np.ndarray:
        """The samples within `reach` metres east, west, north and south of a point, at most 64 samples away;
        outliers as what they stand on."""
        row, col = self.cell_of(point)
        dx = self.core.dx
        if self.planet:
            dx *= max(math.hypot(point[0], point[1]) / float(np.linalg.norm(point)), 0.05)
        n_row = min(max(math.ceil(reach / self.core.dy), 1), 64)
        n_col = min(max(math.ceil(reach / dx), 1), 64)
        rows = slice(max(int(row) - n_row, 0), int(row) + n_row + 2)
        cols = np.arange(int(col) - n_col, int(col) + n_col + 2)
        return self._calm(rows.start, min(rows.stop, self.rows), cols)

    def up(self, point: Vec) -> Vec:
        """Unit vector away from the ground."""
        return point / np.linalg.norm(point) if self.planet else np.array([0.0, 0.0, 1.0])

    def place(self, anchor: tuple[float, float], east: float, north: float, altitude: float) -> Vec:
        """The point `east`, `north` metres from an anchor (row, column), `altitude` metres above the datum."""
        core = self.core
        row, col = anchor
        if not self.planet:
            return np.array([core.x0 + col * core.dx + east, core.y0 - row * core.dy + north, altitude])
        lat, lon = math.radians(core.lat0 - row * core.dlat), math.radians(core.lon0 + col * core.dlon)
        up = np.array([math.cos(lat) * math.cos(lon), math.cos(lat) * math.sin(lon), math.sin(lat)])
        to_east = np.array([-math.sin(lon), math.cos(lon), 0.0])
        to_north = np.cross(up, to_east)
        distance = math.hypot(east, north)
        if distance > 0.0:
            along = (to_east * east + to_north * north) / distance
            up = up * math.cos(distance / self.radius) + along * math.sin(distance / self.radius)
        return up * (self.radius + altitude)

    def offset(self, start: tuple[float, float], end: tuple[float, float]) -> tuple[float, float]:
        """Metres east and north from one sample to another; on a planet at the first one's latitude."""
        core = self.core
        dx = core.dx
        cols = end[1] - start[1]
        if self.planet:
            dx *= max(math.cos(math.radians(core.lat0 - start[0] * core.dlat)), 0.05)
            if core.wraps:
                cols = (cols + 0.5 * self.cols) % self.cols - 0.5 * self.cols
        return cols * dx, (start[0] - end[0]) * core.dy

    @property
    def low(self) -> float:
        """The lowest sample, outliers left out."""
        return float(self._relief.lows.min())

    @property
    def high(self) -> float:
        """The highest sample, outliers left out."""
        return float(self._relief.tops.max())

    @cached_property
    def _relief(self) -> _Relief:
        row_cuts, col_cuts = _cuts(self.rows), _cuts(self.cols)
        tops = np.full((len(row_cuts) - 1, len(col_cuts) - 1), -np.inf, np.float32)
        lows = -tops
        step = max(1, math.isqrt(self.rows * self.cols // _GLANCE))
        glance = []
        for i, (begin, end) in enumerate(itertools.pairwise(row_cuts.tolist())):
            for row in range(begin, end, _BAND):
                band = self.heights[row : min(row + _BAND, end), :]
                tops[i] = np.maximum(tops[i], np.maximum.reduceat(band.max(axis=0), col_cuts[:-1]))
                lows[i] = np.minimum(lows[i], np.minimum.reduceat(band.min(axis=0), col_cuts[:-1]))
                glance.append(band[-row % step :: step, ::step].ravel())
        below, above = np.percentile(np.concatenate(glance), (_TAIL, 100.0 - _TAIL))
        fence = (float(2.0 * below - above), float(2.0 * above - below))
        for i, j in np.argwhere((lows < fence[0]) | (tops > fence[1])):
            cols = np.arange(col_cuts[j], col_cuts[j + 1])
            block = self._calm(row_cuts[i], row_cuts[i + 1], cols, fence)
            tops[i, j], lows[i, j] = block.max(), block.min()
        return _Relief(row_cuts, col_cuts, tops, lows, fence)

    def highest_relief(self) -> tuple[float, float]:
        """(row, column) of the highest sample of the block with the greatest relief, of 24 x 24 blocks.

        Blocks at the edge are left out where there are others, and so are a planet's polar ones; and so are outliers,
        which stand out of all ground by more than it is high, and are narrower than 7 samples.
        """
        found = self._relief
        relief = (found.tops - found.lows).astype(np.float64)
        edge_r = max(1, relief.shape[0] // 8) if relief.shape[0] > 2 else 0
        edge_c = max(1, relief.shape[1] // 8) if relief.shape[1] > 2 else 0
        if self.core.wraps:
            edge_c = 0
            edge_r = max(edge_r, relief.shape[0] // 6)
        inner = relief[edge_r : relief.shape[0] - edge_r, edge_c : relief.shape[1] - edge_c]
        r, c = np.unravel_index(int(np.argmax(inner)), inner.shape)
        r, c = r + edge_r, c + edge_c
        if not relief.any():  # flat: the middle
            return self.centre
        rows, cols = found.row_cuts[r : r + 2], found.col_cuts[c : c + 2]
        block = self._calm(rows[0], rows[1], np.arange(*cols))
        i, j = np.unravel_index(int(np.argmax(block)), block.shape)
        return float(rows[0] + i), float(cols[0] + j)

    def _calm(self, first: int, last: int, cols: np.ndarray, fence: tuple[float, float] | None = None) -> np.ndarray:
        """Samples of rows `first` to `last` (without it) and consecutive columns, which may leave the field; what
        stands out alone is cut down (filled up) to what is `_NARROW` samples wide (morphological opening, closing)."""
        inside = cols % self.cols if self.core.wraps else np.clip(cols, 0, self.cols - 1)
        samples = np.ascontiguousarray(self.heights[first:last, inside])  # sums do not depend on what holds them
        low, high = fence or self._relief.fence
        if samples.min() >= low and samples.max() <= high:
            return samples
        from scipy.ndimage import grey_closing, grey_opening

        top, rim = max(first - _NARROW, 0), np.arange(_NARROW)
        wide = np.concatenate([cols[0] - _NARROW + rim, cols, cols[-1] + 1 + rim])
        wide = wide % self.cols if self.core.wraps else np.clip(wide, 0, self.cols - 1)
        around = np.asarray(self.heights[top : min(last + _NARROW, self.rows), wide], np.float64)
        part = np.s_[first - top : first - top + len(samples), _NARROW:-_NARROW]
        opened = grey_opening(around, (_NARROW, _NARROW), mode="nearest")[part]
        closed = grey_closing(around, (_NARROW, _NARROW), mode="nearest")[part]
        most = (high - low) / 3.0
        calm = np.where((samples > high) & (samples - opened > most), opened, samples)
        return np.where((samples < low) & (closed - samples > most), closed, calm).astype(samples.dtype)


def _cuts(count: int) -> np.ndarray:
    """Where up to 24 blocks of `count` samples start, and the end."""
    blocks = min(24, count)
    return np.arange(blocks + 1) * count // blocks
