# SPDX-License-Identifier: MIT
"""Raster files as arrays that lie somewhere: row 0 north, column 0 west, whole or by windows.

rasterio reads what it can, virtual paths and subdatasets among it; numpy reads `.npy` and `.npz`; OpenImageIO,
where the core has it, the rest (EXR).
"""

from __future__ import annotations

import os
import re
import warnings
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from .. import _core
from ..disk import is_store
from ..errors import InvalidInput
from .placement import Placement, place_of, vertical_of
from .plausible import guess_nodata

_BLOCK_CACHE = 64_000_000  # bytes of GDAL's cache, which would grow with the machine's memory
# Heights that red, green and blue hold together: metres of the lowest bit of blue, and of 0.
ENCODINGS = {"terrarium": (1.0 / 256.0, -32768.0), "mapbox": (0.1, -10000.0)}
_VIRTUAL = re.compile(r"(/vsi[a-z0-9_]+/|[a-z][a-z0-9+]+://|[A-Z][A-Z0-9_]+:).", re.DOTALL)
Mask = np.ndarray | None  # True where a sample is real; None: everywhere


# ---- names ----------------------------------------------------------------------------------------


def _a_file(name: str) -> str | None:
    return name if os.path.isfile(name) else None


def _member(text: str) -> tuple[str, str] | None:
    """File and array of `FILE.npz:NAME`."""
    head, colon, name = text.rpartition(":")
    return (head, name) if colon and name and head.lower().endswith(".npz") else None


def absolute(text: str, find: Callable[[str], str | None] = _a_file) -> str | None:
    """The name of a raster that is no plain file, its file made absolute: `FILE.npz:NAME`, one of GDAL's virtual
    paths (`/vsizip/F/x`, `zip://F!x`) or subdatasets (`NETCDF:F:x`). None for another text.

    `find` gives the path of an existing file, or None.
    """
    if (member := _member(text)) and (file := find(member[0])):
        return f"{os.path.abspath(file)}:{member[1]}"
    if not _VIRTUAL.match(text):
        return None
    starts = [m.end() for m in re.finditer(r'/vsi[a-z0-9_]+/|://|[:"]', text)]
    ends = [len(text), *(m.start() for m in reversed(list(re.finditer(r'[!:"/]', text))))]
    for start in starts:
        for end in ends:
            if end > start and (file := find(text[start:end])) and os.path.isfile(file):
                return text[:start] + os.path.abspath(file) + text[end:]
    return text


def title(text: str) -> str:
    """A short name for a raster: of its file, or of what is chosen inside."""
    last = os.path.basename(text) if os.path.exists(text) else re.split(r'[/!:"]', text.rstrip('"'))[-1]
    return os.path.splitext(last.removesuffix(".gz"))[0]


# ---- reading --------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Pick:
    """What is read of a dataset: one band, or three that encode heights; turned where its rows run north or its
    columns west."""

    bands: tuple[int, ...]
    masked: bool
    flips: tuple[bool, bool]

    def read(self, dataset: Any, window: tuple[int, int, int, int]) -> tuple[np.ndarray, Mask]:
        """The samples of (row0, col0, rows, cols), row 0 north, and where the file's mask says that they are real."""
        from rasterio.windows import Window

        row0, col0, height, width = window
        south_up, mirrored = self.flips
        file_row = dataset.height - row0 - height if south_up else row0
        file_col = dataset.width - col0 - width if mirrored else col0
        part = Window(file_col, file_row, width, height)
        turn = np.s_[:: -1 if south_up else 1, :: -1 if mirrored else 1]
        samples = dataset.read(self.bands[0], window=part)
        if len(self.bands) == 3:
            samples = samples.astype(np.int32)
            for band in self.bands[1:]:
                samples = samples * 256 + dataset.read(band, window=part)
        real = dataset.read_masks(self.bands[0], window=part) != 0 if self.masked else None
        return samples[turn], None if real is None or real.all() else real[turn]


class RasterWindows:
    """A band of a raster that is read window by window; row 0 north, column 0 west, whatever the file's order."""

    def __init__(self, path: str, pick: _Pick, window: tuple[int, int, int, int]) -> None:
        self.path = path
        self.shape = window[2:]
        self._pick, self._first = pick, window[:2]
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
        """Of the samples as `read` gives them."""
        bands = self._pick.bands
        return np.dtype(np.int32 if len(bands) == 3 else self._open().dtypes[bands[0] - 1])

    def read(self, row: int, col: int, rows: int, cols: int) -> tuple[np.ndarray, Mask]:
        """(rows, cols) as stored, and where they are real by the file's own mask (None: everywhere)."""
        import rasterio
        from rasterio.errors import RasterioError

        window = (self._first[0] + row, self._first[1] + col, rows, cols)
        try:
            with rasterio.Env(GDAL_CACHEMAX=_BLOCK_CACHE):
                return self._pick.read(self._open(), window)
        except RasterioError as error:
            why = str(error.__cause__ or error)
            raise InvalidInput(f"open {self.path}: it is damaged or cut short: {why}") from None


class ArrayWindows:
    """A `.npy` file that is read window by window, as RasterWindows."""

    def __init__(self, path: str, window: tuple[int, int, int, int]) -> None:
        self.path = path
        self.shape = window[2:]
        self._first = window[:2]
        self._array: Any = None

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_array": None}

    def _open(self) -> np.ndarray:
        if self._array is None:
            self._array = _load_array(self.path)
        return self._array

    @property
    def dtype(self) -> np.dtype:
        """Of the samples as stored."""
        return self._open().dtype

    def read(self, row: int, col: int, rows: int, cols: int) -> tuple[np.ndarray, Mask]:
        """(rows, cols) as stored; no mask."""
        row, col = row + self._first[0], col + self._first[1]
        return np.array(self._open()[row : row + rows, col : col + cols]), None


@dataclass
class Raster:
    """Samples as stored (row 0 north), how to read them as heights, and where they lie."""

    samples: np.ndarray | RasterWindows | ArrayWindows
    place: Placement
    whole: tuple[int, int]  # rows and columns of the file
    nodata: tuple[float, ...] = ()
    guessed: tuple[float, ...] = ()  # nodata that the file does not declare
    declared: float | None = None  # the file's own
    scale: float = 1.0
    offset: float = 0.0

    @property
    def declares(self) -> str:
        """The file's own nodata, for messages."""
        return "it declares no nodata" if self.declared is None else f"it declares nodata {self.declared!r}"


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
    nodata: tuple[float, ...] | str | None = None,
    encoding: str | None = None,
    most: int = 2**31,
) -> Raster:
    """Reads one band. `nodata` overrides the file's; "none" ignores it. InvalidInput names path and reason.

    `encoding`: three bands that hold heights, "terrarium" or "mapbox"; `nodata` is then in metres. Above `most`
    samples nothing is read yet where windows can be read: `samples` is a RasterWindows or ArrayWindows.
    """
    import rasterio
    from rasterio.errors import RasterioError, RasterioIOError

    text = os.fspath(path)
    if encoding is not None and encoding not in ENCODINGS:
        raise InvalidInput(f"open {text}: encoding {encoding!r} is not one of {', '.join(ENCODINGS)}")
    plain = absolute(text) is None
    if plain:
        _check_file(text)
        _refuse_store(text)
    if text.lower().endswith((".npy", ".npz")) or _member(text):
        raster = _read_array(text, band, window, most)
    else:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
                dataset = rasterio.open(text)
        except RasterioError as error:
            if not plain:
                raise InvalidInput(f"open {text}: not a raster that rasterio reads ({error})") from None
            raster = _read_picture(text, str(error), band, window)
        else:
            with dataset:
                try:
                    raster = _read_dataset(dataset, text, band, window, encoding, nodata is None, most)
                except RasterioIOError as error:
                    why = str(error.__cause__ or error)
                    raise InvalidInput(f"open {text}: it is damaged or cut short: {why}") from None
    if nodata == "none":
        raster.nodata = ()
    elif nodata is not None:
        raster.nodata = tuple(round((v - raster.offset) / raster.scale) for v in nodata) if encoding else nodata
    elif raster.declared is not None:
        raster.nodata = (raster.declared,)
    elif encoding is None and isinstance(raster.samples, np.ndarray):
        raster.nodata = raster.guessed = guess_nodata(raster.samples, text)
    return raster


def _refuse_store(path: str) -> None:
    if is_store(path):
        raise InvalidInput(f"open {path}: it is a store, not a source; lodlab info {path} says which it was built from")


def _check_file(path: str) -> None:
    if not os.path.exists(path):
        raise InvalidInput(f"open {path}: there is no such file")
    if os.path.isdir(path):
        raise InvalidInput(f"open {path}: it is a directory, not a raster")
    if not os.access(path, os.R_OK):
        raise InvalidInput(f"open {path}: permission denied")


def _choose_band(band: int | None, count: int, names: list[str], path: str) -> int:
    """`band`, or the only one beside a mask of opacity."""
    if band is None:
        if count == 2 and names[1] == "alpha":
            return 1
        if count > 1:
            raise InvalidInput(f"open {path}: it has {count} bands ({', '.join(names)}); choose with band=1..{count}")
        return 1
    if not 1 <= band <= count:
        raise InvalidInput(f"open {path}: band {band} is not within 1 to {count}")
    return band


def _check_dataset(dataset: Any, path: str) -> None:
    if dataset.count == 0:
        parts = dataset.subdatasets
        which = f"it holds {len(parts)} rasters; name one of {', '.join(parts[:8])}" if parts else "it holds none"
        raise InvalidInput(f"open {path}: a container without a raster of its own: {which}")


def _pick_of(dataset: Any, path: str, band: int | None, encoding: str | None) -> tuple[int, ...]:
    """The bands that are read. InvalidInput for what is no height."""
    from rasterio.enums import ColorInterp

    names = [d or c.name for d, c in zip(dataset.descriptions, dataset.colorinterp, strict=True)]
    if encoding is not None:
        kinds = [c.name for c in dataset.colorinterp]
        if band is not None or dataset.count not in (3, 4) or set(dataset.dtypes) != {"uint8"}:
            raise InvalidInput(
                f"open {path}: encoding={encoding} takes red, green and blue of 8 bits together; it has "
                f"{dataset.count} bands ({', '.join(kinds)}) of {dataset.dtypes[0]}"
                + ("" if band is None else f", and band={band} takes one")
            )
        return (1, 2, 3)
    index = _choose_band(band, dataset.count, names, path)
    if dataset.colorinterp[index - 1] == ColorInterp.palette:
        raise InvalidInput(
            f"open {path}: its samples are numbers of a palette's colours, not heights; gdal_translate -expand gray "
            "writes their brightness"
        )
    if np.dtype(dataset.dtypes[index - 1]).kind == "c":
        raise InvalidInput(f"open {path}: its samples are complex ({dataset.dtypes[index - 1]})")
    return (index,)


def _read_dataset(
    dataset: Any,
    path: str,
    band: int | None,
    window: tuple[int, int, int, int] | None,
    encoding: str | None,
    by_nodata: bool,
    most: int,
) -> Raster:
    """`by_nodata`: the file's own nodata is meant."""
    from rasterio.enums import MaskFlags

    _check_dataset(dataset, path)
    bands = _pick_of(dataset, path, band, encoding)
    first = bands[0] - 1
    rows, cols = dataset.height, dataset.width
    row0, col0, height, width = _check_window(window, rows, cols, path)
    _check_size(height, width, path)
    place, *flips = place_of(dataset, path, row0, col0)
    flags = dataset.mask_flag_enums[first]
    by_nodata = by_nodata and encoding is None and MaskFlags.nodata in flags
    pick = _Pick(bands, by_nodata or MaskFlags.per_dataset in flags, (flips[0], flips[1]))
    part = (row0, col0, height, width)
    if encoding is not None:
        scale, offset = ENCODINGS[encoding]
        place.vertical_from = f"metre ({encoding})"
    else:
        scale, offset = float(dataset.scales[first]), float(dataset.offsets[first])
        place.vertical, place.vertical_from = vertical_of(dataset.units[first], place.reference, path)
    if height * width > most:
        samples: Any = RasterWindows(path, pick, part)
    else:
        samples, real = pick.read(dataset, part)
        if real is not None:
            samples = np.ma.MaskedArray(samples, ~real)
    declared = None if encoding is not None else dataset.nodatavals[first]
    return Raster(samples, place, (rows, cols), declared=declared, scale=scale, offset=offset)


def _load_array(path: str) -> np.ndarray:
    """The array of a `.npy` file, mapped into memory, or of `FILE.npz:NAME`."""
    file, name = _member(path) or (path, None)
    try:
        if file.lower().endswith(".npy"):
            return np.load(file, mmap_mode="r", allow_pickle=False)
        with np.load(file, allow_pickle=False) as arrays:
            if name is None:
                members = ", ".join(f"{file}:{found}" for found in arrays.files)
                raise InvalidInput(f"open {path}: it holds {len(arrays.files)} arrays; name one: {members}")
            if name not in arrays.files:
                raise InvalidInput(f"open {path}: it holds no array {name!r}; there are {', '.join(arrays.files)}")
            return arrays[name]
    except (OSError, ValueError, EOFError, KeyError, zipfile.BadZipFile) as error:
        raise InvalidInput(f"open {path}: not an array that numpy reads ({error})") from None


def _read_array(path: str, band: int | None, window: tuple[int, int, int, int] | None, most: int) -> Raster:
    array = _load_array(path)
    if array.ndim != 2 or array.dtype.kind not in "iuf":
        raise InvalidInput(
            f"open {path}: an array of shape {array.shape} and dtype {array.dtype}; two dimensions of real numbers "
            "are needed"
        )
    _choose_band(band, 1, ["1"], path)
    row0, col0, height, width = part = _check_window(window, *array.shape, path)
    _check_size(height, width, path)
    samples: Any = array[row0 : row0 + height, col0 : col0 + width]
    if height * width > most and _member(path) is None:
        samples = ArrayWindows(path, part)
    return Raster(samples, Placement(path, row0=row0, col0=col0), array.shape)


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
