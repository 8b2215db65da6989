# SPDX-License-Identifier: MIT
"""Height fields larger than memory: read by windows, never held.

A `WindowedHeightField` knows where it lies without reading anything. Its native object reads it once, for checks,
range of heights and hash; a method that builds by rows (`by_rows` in its table) reads it again. What needs the
samples in memory says so: `loaded()` for methods that cannot build by rows, Unsupported for pictures of errors.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Callable, Iterator
from typing import Any, Protocol

import numpy as np

from .. import _core
from ..errors import InvalidInput
from .base import FieldSource
from .frames import unplaced
from .plausible import MARKS, Rounding, Slopes, check_heights, extremes, outlying
from .raster import Raster
from .samples import EXACT_IN_FLOAT32, to_float32, valid_mask

_SIDE = 256  # of the patches that are kept
_PATCHES = 64
_STRIP = 1 << 22  # samples
Look = Callable[[np.ndarray, np.ndarray, "np.ndarray | None", int], None]


class Reader(Protocol):
    """What holds the samples. Readers are pickled: workers read for themselves."""

    def window(self, row: int, col: int, rows: int, cols: int) -> tuple[np.ndarray, np.ndarray | None]:
        """Heights (rows, cols) float32, C-contiguous, voids filled, and a mask, uint8, 0 in voids; None: no voids."""

    def open(self, frame: dict[str, Any], spec: str, progress: Callable[[str, float], None]) -> Any:
        """The native field; reads every sample once."""


class WindowedHeightField(FieldSource):
    """A height field of more than `LODLAB_WINDOW_SAMPLES` samples, by `datasets.load` or `HeightField.open`.

    Voids are filled strip by strip of rows, with a membrane that sees a quarter of a strip beyond each; a strip
    without any real sample is filled with 0. So the fill, and with it the hash, is not the one in memory.
    """

    windowed = True

    def __init__(
        self,
        reader: Reader,
        frame: dict[str, Any],
        name: str,
        spec: str,
        used: dict[str, str] | None = None,
        *,
        held: type[FieldSource],
    ) -> None:
        """`held`: the class of the same field in memory."""
        self.used = used or {}
        self._reader = reader
        self._frame = frame
        self._spec = spec
        self._held = held
        self._surveyed: Any = None
        self.name = name

    @property
    def _core(self) -> Any:
        if self._surveyed is None:
            from ..progress import Progress

            with Progress(f"read {self.name}") as bar:
                self._surveyed = self._reader.open(self._frame, self._spec, bar.stage)
        return self._surveyed

    @property
    def core(self) -> Any:
        """The native windowed field; every sample is read when it is first asked for."""
        return self._core

    def loaded(self) -> FieldSource:
        """The same field in memory."""
        frame = {k: v for k, v in self._core.frame().items() if k not in ("rows", "cols", "z_min", "z_max")}
        heights, mask = self._reader.window(0, 0, *self.shape)
        state = {"arrays": (heights, mask), "frame": frame, "spec": self._spec, "name": self.name, "used": self.used}
        field = self._held.__new__(self._held)
        field.__setstate__(state)
        return field

    @property
    def grid(self) -> Windows:
        """Heights by row and column, read as they are asked for."""
        return Windows(self._reader, self.shape)

    @property
    def heights(self) -> np.ndarray:
        """(H, W) float32, metres, NaN in voids; all of it is read, every time. Read-only."""
        out, mask = self._reader.window(0, 0, *self.shape)
        if mask is not None:
            out[mask == 0] = np.nan
        out.flags.writeable = False
        return out

    @property
    def valid(self) -> np.ndarray:
        """(H, W) bool: True where the sample is real. Read-only."""
        mask = self._reader.window(0, 0, *self.shape)[1] if self.void_samples else None
        return np.broadcast_to(np.True_, self.shape) if mask is None else mask.view(bool)

    @property
    def void_samples(self) -> int:
        """Samples that are not real."""
        return self._core.voids

    @property
    def filled(self) -> np.ndarray:
        """(H, W) float32, metres, voids filled; all of it is read, every time. Read-only."""
        out, _ = self._reader.window(0, 0, *self.shape)
        out.flags.writeable = False
        return out

    def every(self, step: int) -> tuple[np.ndarray, np.ndarray]:
        """Every step-th row and column: heights, and which are real."""
        rows, cols = self.shape
        lines = [self._reader.window(row, 0, 1, cols) for row in range(0, rows, step)]
        real = [np.ones((1, cols), bool) if mask is None else mask.view(bool) for _, mask in lines]
        return np.concatenate([z[:, ::step] for z, _ in lines]), np.concatenate([r[:, ::step] for r in real])

    @property
    def frame(self) -> dict[str, Any]:
        return self._frame

    @property
    def spec(self) -> str:
        """SOURCE text that loads this field again."""
        return self._spec

    def __getstate__(self) -> dict[str, Any]:
        """What a worker process needs to read the same field."""
        state = {"reader": self._reader, "frame": self._frame, "spec": self._spec}
        return state | {"name": self.name, "used": self.used, "held": self._held}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__init__(**state)

    def __repr__(self) -> str:
        return f"<HeightField {self.name}: {self.shape[0]} x {self.shape[1]}, {self.where}, read by windows>"


class Windows:
    """The heights of a windowed field, indexed as `[row, col]`, `[rows, cols]` (slices) or `[rows, columns]`
    (a slice and an array of column numbers). Patches are kept while they are in use.
    """

    def __init__(self, reader: Reader, shape: tuple[int, int]) -> None:
        self.shape = shape
        self._reader = reader
        self._patches: OrderedDict[tuple[int, int], np.ndarray] = OrderedDict()

    def __getitem__(self, index: tuple[Any, Any]) -> Any:
        rows, cols = index
        if not isinstance(rows, slice):
            return self._patch(rows // _SIDE, cols // _SIDE)[rows % _SIDE, cols % _SIDE]
        top, bottom, _ = rows.indices(self.shape[0])
        if isinstance(cols, slice):
            left, right, _ = cols.indices(self.shape[1])
            return self._reader.window(top, left, bottom - top, right - left)[0]
        out = np.empty((bottom - top, len(cols)), np.float32)
        for j in np.unique(cols // _SIDE):
            mine = cols // _SIDE == j
            for i in range(top // _SIDE, (bottom - 1) // _SIDE + 1):
                first, last = max(top, i * _SIDE), min(bottom, (i + 1) * _SIDE)
                patch = self._patch(i, int(j))[first - i * _SIDE : last - i * _SIDE]
                out[first - top : last - top, mine] = patch[:, cols[mine] - j * _SIDE]
        return out

    def _patch(self, i: int, j: int) -> np.ndarray:
        if (i, j) not in self._patches:
            row, col = i * _SIDE, j * _SIDE
            rows, cols = min(_SIDE, self.shape[0] - row), min(_SIDE, self.shape[1] - col)
            self._patches[i, j], _ = self._reader.window(row, col, rows, cols)
            if len(self._patches) > _PATCHES:
                self._patches.popitem(last=False)
        self._patches.move_to_end((i, j))
        return self._patches[i, j]


class FractalReader:
    """The generated terrain; the native field calls its function itself."""

    def __init__(self, seed: int, roughness: float, scale: float) -> None:
        if not 0 <= seed < 2**64:
            raise InvalidInput(f"fractal: seed {seed} is not within 0 to 2^64 - 1")
        self._seed, self._roughness, self._scale = seed, float(roughness), scale

    def window(self, row: int, col: int, rows: int, cols: int) -> tuple[np.ndarray, None]:
        """As Reader.window."""
        out = _core.fractal(rows, cols, row, col, self._seed, self._roughness)
        scaled = self._scale != 1.0
        return np.multiply(out, self._scale, dtype=np.float64).astype(np.float32) if scaled else out, None

    def open(self, frame: dict[str, Any], spec: str, progress: Callable[[str, float], None]) -> Any:
        """As Reader.open."""
        return _core.WindowedField.fractal(
            seed=self._seed, roughness=self._roughness, scale=self._scale, spec=spec, progress=progress, **frame
        )


class RasterReader:
    """A raster whose samples are read by windows, as heights; `cols`: what is used of its width; `guess`: undeclared
    marks are looked for; `scaling`: factor and summand of the samples, `vertical_scale` within."""

    def __init__(
        self, raster: Raster, cols: int, guess: bool, scaling: tuple[float, float], vertical_scale: float
    ) -> None:
        self._source, self._marks, self._place = raster.samples, raster.nodata, raster.place
        self._says = raster.declares
        self._cols, self._guess, self._vertical_scale = cols, guess, vertical_scale
        self._scale, self._offset = scaling
        self._strip: tuple[int, np.ndarray] | None = None  # the last one that was filled

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_strip": None}

    def window(self, row: int, col: int, rows: int, cols: int) -> tuple[np.ndarray, np.ndarray | None]:
        """As Reader.window."""
        return self._window(row, col, rows, cols, lambda *_: None)

    def _window(self, row: int, col: int, rows: int, cols: int, look: Look) -> tuple[np.ndarray, np.ndarray | None]:
        heights, mask = self._read(row, col, rows, cols, look)
        if mask is not None:
            height = self._strip_rows()
            for k in range(row // height, (row + rows - 1) // height + 1):
                first, last = max(row, k * height), min(row + rows, (k + 1) * height)
                if not mask[first - row : last - row].all():
                    filled = self._filled(k)[first - k * height : last - k * height, col : col + cols]
                    heights[first - row : last - row] = filled
        return heights, mask

    def _read(
        self, row: int, col: int, rows: int, cols: int, look: Look = lambda *_: None
    ) -> tuple[np.ndarray, np.ndarray | None]:
        """Heights, anything in voids, and the mask, None without voids. `look` sees samples, heights, mask, row."""
        samples, given = self._source.read(row, col, rows, cols)
        valid = valid_mask(samples, self._marks, given)
        heights = to_float32(samples, self._scale, self._offset)
        look(samples, heights, valid, row)
        return heights, None if valid is None else np.ascontiguousarray(valid).view(np.uint8)

    def _strip_rows(self) -> int:
        """The same whatever is read: about 4 M samples."""
        return min(max(_STRIP // self._cols, 64), 1024)

    def _filled(self, k: int) -> np.ndarray:
        """Rows of strip `k`, voids filled."""
        if self._strip is None or self._strip[0] != k:
            height = self._strip_rows()
            first, last = max(0, k * height - height // 4), min(self._source.shape[0], (k + 1) * height + height // 4)
            heights, mask = self._read(first, 0, last - first, self._cols)
            if mask is not None and mask.any():
                _core.fill_voids(heights, mask)
            elif mask is not None:
                heights[:] = 0.0
            self._strip = (k, heights[k * height - first : (k + 1) * height - first].copy())
        return self._strip[1]

    def open(self, frame: dict[str, Any], spec: str, progress: Callable[[str, float], None]) -> Any:
        """As Reader.open."""
        keys = {k: v for k, v in frame.items() if k not in ("rows", "cols")}
        rows, cols = frame["rows"], frame["cols"]
        rounding, slopes = Rounding(), Slopes(frame["dx"], self._vertical_scale)

        def look(samples: np.ndarray, heights: np.ndarray, valid: np.ndarray | None, row: int) -> None:
            check_heights(heights, valid, samples, self._source.path, self._says, row)
            rounding.add(samples, heights, valid, self._scale, self._offset)
            slopes.add(heights, valid)

        looks = [look]  # while the field is surveyed

        def read(row: int, count: int) -> tuple[np.ndarray, np.ndarray | None]:
            return self._window(row, 0, count, cols, looks[0])

        if self._source.dtype.kind in "iu" and self._offset == 0.0 and self._exact():
            keys["height_step"] = abs(self._scale)
        field = _core.WindowedField(rows, cols, read, spec=spec, progress=progress, at_once=_STRIP, **keys)
        looks[0] = lambda *_: None
        ends = [(z - self._offset) / self._scale for z in (field.z_min, field.z_max)]
        if self._guess and any(math.isclose(end, mark, rel_tol=1e-6) for end in ends for mark in MARKS):
            self._ask()
        rounding.warn(self._source.path, self._vertical_scale)
        if not frame["planet"]:
            slopes.warn(self._source.path, unplaced(self._place))
        return field

    def _ask(self) -> None:
        """InvalidInput where the file uses a mark that it does not declare."""

        def among(marks: tuple[float, ...]) -> tuple[float, float]:
            pieces = [extremes(samples, valid, marks) for samples, valid in self._pieces()]
            return min(low for low, _ in pieces), max(high for _, high in pieces)

        if found := outlying(*among(()), among):
            mark = "/".join(f"{v:.17g}" for v in found)
            raise InvalidInput(
                f"open {self._source.path}: it holds {mark}, a customary mark of voids that it does not declare; "
                f"nodata={mark} takes it as void, nodata=none as a height"
            )

    def _pieces(self) -> Iterator[tuple[np.ndarray, np.ndarray | None]]:
        """All samples as stored, and which are real by mask and declaration."""
        step = max(1, _STRIP // self._cols)
        for row in range(0, self._source.shape[0], step):
            samples, given = self._source.read(row, 0, min(step, self._source.shape[0] - row), self._cols)
            yield samples, valid_mask(samples, self._marks, given)

    def _exact(self) -> bool:
        """Whether 32-bit floats hold all its integers; reads them all where their type does not say it."""
        if self._source.dtype.itemsize <= 2:
            return True
        for samples, valid in self._pieces():
            real = samples if valid is None else samples[valid]
            if real.size and max(-int(real.min()), int(real.max())) > EXACT_IN_FLOAT32:
                return False
        return True
