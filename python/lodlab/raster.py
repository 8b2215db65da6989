# SPDX-License-Identifier: MIT
"""Raster files as arrays that lie somewhere: row 0 north, column 0 west, whole or by windows.

rasterio reads what it can; OpenImageIO, where the core has it, the rest (EXR).
"""

from __future__ import annotations

import math
import os
import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np

from . import _core
from .errors import InvalidInput

WGS84_A = 6378137.0
WGS84_E2 = 0.0066943799901413165
_BLOCK_CACHE = 64_000_000  # bytes of GDAL's cache, which would grow with the machine's memory
# What undeclared voids are customarily marked with.
MARKS = (-32768.0, -32767.0, -9999.0, -99999.0, -999999.0)


def metres_per_degree(latitude: float) -> tuple[float, float]:
    """WGS84 lengths, metres, of a degree of longitude and of latitude at a latitude in degrees."""
    phi = math.radians(latitude)
    w2 = 1.0 - WGS84_E2 * math.sin(phi) ** 2
    along_parallel = WGS84_A / math.sqrt(w2) * math.cos(phi)
    along_meridian = WGS84_A * (1.0 - WGS84_E2) / (w2 * math.sqrt(w2))
    return math.radians(along_parallel), math.radians(along_meridian)


@dataclass
class Placement:
    """Where the samples of a raster or of a window of it lie, in units of its reference system."""

    path: str
    known: bool = False  # False: a picture that lies nowhere
    geographic: bool = False
    first: tuple[float, float] = (0.0, 0.0)  # centre of the first sample read
    step: tuple[float, float] = (1.0, 1.0)  # east and south, positive
    unit: float = 1.0  # metres, of projected systems
    middle_latitude: float = 0.0  # of the whole raster, so that windows agree
    row0: int = 0
    col0: int = 0

    def metres_per_unit(self) -> tuple[float, float]:
        """Factors for x and y."""
        if not self.geographic:
            return self.unit, self.unit
        if abs(self.middle_latitude) >= 90.0:
            raise InvalidInput(f"open {self.path}: middle latitude {self.middle_latitude} is not within +-90")
        return metres_per_degree(self.middle_latitude)


class RasterWindows:
    """A band of a raster that is read window by window; row 0 north, column 0 west, whatever the file's order."""

    def __init__(self, path: str, band: int, window: tuple[int, int, int, int], flips: tuple[bool, bool]) -> None:
        self.path = path
        self.shape = window[2:]
        self._band, self._first, self._flips = band, window[:2], flips
        self._dataset: Any = None

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_dataset": None}

    def _open(self) -> Any:
        import rasterio

        if self._dataset is None:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
                self._dataset = rasterio.open(self.path)
        return self._dataset

    @property
    def dtype(self) -> np.dtype:
        """Of the samples as stored."""
        return np.dtype(self._open().dtypes[self._band - 1])

    def read(self, row: int, col: int, rows: int, cols: int) -> tuple[np.ndarray, np.ndarray | None]:
        """(rows, cols) as stored, and where they are real by the file's own mask (None: everywhere)."""
        import rasterio
        from rasterio.errors import RasterioError

        window = (self._first[0] + row, self._first[1] + col, rows, cols)
        try:
            with rasterio.Env(GDAL_CACHEMAX=_BLOCK_CACHE):
                samples = _read_window(self._open(), self._band, window, self._flips)
        except RasterioError as error:
            why = str(error.__cause__ or error)
            raise InvalidInput(f"open {self.path}: it is damaged or cut short: {why}") from None
        if isinstance(samples, np.ma.MaskedArray):
            return samples.data, ~np.ma.getmaskarray(samples)
        return samples, None


@dataclass
class Raster:
    """Samples as stored (row 0 north), how to read them as heights, and where they lie."""

    samples: np.ndarray | RasterWindows
    place: Placement
    whole: tuple[int, int]  # rows and columns of the file
    nodata: float | None = None
    guessed: float | None = None  # nodata that the file does not declare
    scale: float = 1.0
    offset: float = 0.0


def _check_window(
    window: tuple[int, int, int, int] | None, rows: int, cols: int, path: str
) -> tuple[int, int, int, int]:
    if window is None:
        return 0, 0, rows, cols
    try:
        row0, col0, height, width = (int(v) for v in window)
    except (TypeError, ValueError):
        raise InvalidInput(f"open {path}: window {window!r} is not (row0, col0, rows, cols)") from None
    if min(row0, col0) < 0 or min(height, width) < 1 or row0 + height > rows or col0 + width > cols:
        raise InvalidInput(f"open {path}: window {window} leaves its {rows} x {cols} samples")
    return row0, col0, height, width


def _check_size(rows: int, cols: int, path: str) -> None:
    if rows * cols > 2**31:
        raise InvalidInput(f"open {path}: {rows} x {cols} samples are more than 2^31")


def open_raster(
    path: str | os.PathLike[str],
    *,
    band: int | None = None,
    window: tuple[int, int, int, int] | None = None,
    nodata: float | str | None = None,
    most: int = 2**31,
) -> Raster:
    """Reads one band. `nodata` overrides the file's; "none" ignores it. InvalidInput names path and reason.

    Above `most` samples nothing is read yet where rasterio can read windows: `samples` is a RasterWindows.
    """
    import rasterio
    from rasterio.errors import RasterioError, RasterioIOError

    text = os.fspath(path)
    if not os.path.exists(text):
        raise InvalidInput(f"open {text}: there is no such file")
    if os.path.isdir(text):
        raise InvalidInput(f"open {text}: it is a directory, not a raster")
    if not os.access(text, os.R_OK):
        raise InvalidInput(f"open {text}: permission denied")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
            dataset = rasterio.open(text)
    except RasterioError as error:
        raster = _read_picture(text, str(error), band, window)
    else:
        with dataset:
            try:
                raster = _read_dataset(dataset, text, band, window, most)
            except RasterioIOError as error:
                why = str(error.__cause__ or error)
                raise InvalidInput(f"open {text}: it is damaged or cut short: {why}") from None
    if nodata == "none":
        raster.nodata = None
    elif nodata is not None:
        raster.nodata = float(nodata)
    elif raster.nodata is None and type(raster.samples) is np.ndarray:
        raster.nodata = raster.guessed = _guess_nodata(raster.samples, text)
    return raster


def _choose_band(band: int | None, count: int, names: list[str], path: str) -> int:
    if band is None:
        if count > 1:
            raise InvalidInput(f"open {path}: it has {count} bands ({', '.join(names)}); choose with band=1..{count}")
        return 1
    if not 1 <= band <= count:
        raise InvalidInput(f"open {path}: band {band} is not within 1 to {count}")
    return band


def _read_window(
    dataset: Any, band: int, window: tuple[int, int, int, int], flips: tuple[bool, bool]
) -> np.ndarray | np.ma.MaskedArray:
    """The samples of (row0, col0, rows, cols), row 0 north; masked where the file has a mask that says so."""
    from rasterio.enums import MaskFlags
    from rasterio.windows import Window

    row0, col0, height, width = window
    south_up, mirrored = flips
    file_row = dataset.height - row0 - height if south_up else row0
    file_col = dataset.width - col0 - width if mirrored else col0
    part = Window(file_col, file_row, width, height)
    samples = dataset.read(band, window=part)
    if MaskFlags.per_dataset in dataset.mask_flag_enums[band - 1]:
        real = dataset.read_masks(band, window=part) != 0
        if not real.all():
            samples = np.ma.MaskedArray(samples, ~real)
    return samples[:: -1 if south_up else 1, :: -1 if mirrored else 1]


def _read_dataset(
    dataset: Any, path: str, band: int | None, window: tuple[int, int, int, int] | None, most: int
) -> Raster:
    if dataset.count == 0:
        raise InvalidInput(f"open {path}: a container without a raster of its own")
    names = [d or c.name for d, c in zip(dataset.descriptions, dataset.colorinterp, strict=True)]
    index = _choose_band(band, dataset.count, names, path)
    rows, cols = dataset.height, dataset.width
    row0, col0, height, width = _check_window(window, rows, cols, path)
    _check_size(height, width, path)
    place, south_up, mirrored = _place_of(dataset, path, row0, col0)
    if np.dtype(dataset.dtypes[index - 1]).kind == "c":
        raise InvalidInput(f"open {path}: its samples are complex ({dataset.dtypes[index - 1]})")
    flips, part = (south_up, mirrored), (row0, col0, height, width)
    if height * width > most:
        samples: Any = RasterWindows(path, index, part, flips)
    else:
        samples = _read_window(dataset, index, part, flips)
    return Raster(
        samples,
        place,
        (rows, cols),
        nodata=dataset.nodatavals[index - 1],
        scale=float(dataset.scales[index - 1]),
        offset=float(dataset.offsets[index - 1]),
    )


def _place_of(dataset, path: str, row0: int, col0: int) -> tuple[Placement, bool, bool]:
    """Placement of a window, and whether the file's rows run north and its columns west."""
    t = dataset.transform
    place = Placement(path, row0=row0, col0=col0)
    if t.is_identity and dataset.crs is None:
        return place, False, False
    if abs(t.b) > 1e-9 * abs(t.a) or abs(t.d) > 1e-9 * abs(t.e) or t.a == 0 or t.e == 0:
        raise InvalidInput(
            f"open {path}: its geotransform ({t.a:g}, {t.b:g}, {t.d:g}, {t.e:g}) is rotated; warp it to north-up"
        )
    rows, cols = dataset.height, dataset.width
    south_up, mirrored = t.e > 0, t.a < 0
    east, south = abs(t.a), abs(t.e)
    west = t.c + t.a * cols if mirrored else t.c
    north = t.f + t.e * rows if south_up else t.f
    place.known = True
    place.first = (west + (col0 + 0.5) * east, north - (row0 + 0.5) * south)
    place.step = (east, south)
    if dataset.crs is not None:
        place.geographic = bool(dataset.crs.is_geographic)
        if dataset.crs.is_projected:
            place.unit = float(dataset.crs.linear_units_factor[1])
    if place.geographic:
        place.middle_latitude = north - 0.5 * rows * south
    return place, south_up, mirrored


def _read_picture(path: str, why: str, band: int | None, window: tuple[int, int, int, int] | None) -> Raster:
    """By OpenImageIO; `why` is what rasterio said."""
    if not hasattr(_core, "read_image"):
        raise InvalidInput(f"open {path}: not a raster that rasterio reads ({why})")
    try:
        image = _core.read_image(path)
    except InvalidInput as error:
        raise InvalidInput(f"open {path}: not a raster ({why}; {error})") from None
    rows, cols, count = image.shape
    index = _choose_band(band, count, [str(k + 1) for k in range(count)], path)
    row0, col0, height, width = _check_window(window, rows, cols, path)
    samples = image[row0 : row0 + height, col0 : col0 + width, index - 1]
    return Raster(samples, Placement(path, row0=row0, col0=col0), (rows, cols))


def _guess_nodata(samples: np.ndarray, path: str) -> float | None:
    """The customary mark that a raster uses without declaring it: its lowest value, and farther below the
    others than they are apart."""
    if samples.dtype.kind not in "if" or samples.size == 0:
        return None
    lowest = float(np.nanmin(samples)) if not np.isnan(samples).all() else math.nan
    if lowest not in MARKS and not lowest < -1e30:
        return None
    rest = samples[samples > lowest]
    if rest.size == 0 or not float(rest.min()) - lowest > float(rest.max()) - float(rest.min()):
        return None
    count = samples.size - int(rest.size) - int(np.isnan(samples).sum())
    warnings.warn(
        f"{path}: {count} samples hold {lowest:g}, which it does not declare as nodata; they are taken as void "
        "(nodata=none keeps them)",
        stacklevel=4,
    )
    return lowest
