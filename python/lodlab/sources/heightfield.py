# SPDX-License-Identifier: MIT
"""Height fields: a grid of heights from an array or a raster file, flat or on a planet.

Sample (row, column) lies at x = x0 + column dx, y = y0 - row dy; row 0 is north. Voids are filled smoothly
for the core and stay NaN at this face. The native object (`_core`) is immutable.

Longer than other files: one class, and a typed refusal for every kind of array that is no height field.
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from typing import Any

import numpy as np

from .. import _core
from ..errors import InvalidInput
from .base import FieldSource
from .frames import EARTH_RADIUS, finite, flat_place, make_frame, planet_place, positive, unplaced
from .plausible import Rounding, Slopes, check_heights
from .raster import Raster, absolute, open_raster, title
from .samples import as_array, check_array, check_finite, height_step, to_float32, valid_mask
from .spec import format_spec
from .windowed import RasterReader, WindowedHeightField

WINDOW_SAMPLES = 64_000_000


def window_samples() -> int:
    """Sources with more samples than this are read by windows: LODLAB_WINDOW_SAMPLES, else 64 million (256 MB)."""
    text = os.environ.get("LODLAB_WINDOW_SAMPLES", "")
    if text and not text.isdecimal():
        raise InvalidInput(f"LODLAB_WINDOW_SAMPLES: {text!r} is not a whole number of samples")
    return int(text) if text else WINDOW_SAMPLES


def _nodata(value: Any) -> tuple[float, ...]:
    """The marks of voids."""
    several = isinstance(value, (Sequence, np.ndarray)) and not isinstance(value, str)
    try:
        return () if value is None else tuple(map(float, value if several else (value,)))
    except (TypeError, ValueError):
        raise InvalidInput(f"height field: nodata {value!r} is not a number") from None


class HeightField(FieldSource):
    """A grid of heights in memory, flat (metres, z up) or on a planet (radius over longitude and latitude).

    Axes: x runs east along the columns, y north, so that y falls down the rows: sample (row, column) lies at
    x = x0 + column dx, y = y0 - row dy, and of an array with the default origin all y are 0 or below. A planet's
    axis is z, longitude 0 on +x.

    Parameters
    ----------
    array: (H, W) real numbers of any integer or floating dtype, at least 2 x 2, at most 2^31 samples; need
        not be contiguous. Stored as float32: float64 and wide integers are rounded, with a warning where more
        than 1/65536 of their relief is lost. NaN is void, and so are the masked samples of a masked array.
    spacing: metres between samples, one number or (dx, dy). Default 30. Not for planets.
    vertical_scale: factor on the heights.
    nodata: one more value that means void, or several, before scaling; of floats the last two bits may differ.
    planet: heights above a sphere of `radius` metres. Without `degrees`, the array covers the sphere:
        columns from 0 degrees east round to 360, rows from 90 north to 90 south.
    origin: (x0, y0), metres: the centre of the first sample. Not for planets.
    degrees: (lon0, lat0, dlon, dlat) of a planet's samples. A last column that repeats the first, 360
        degrees further, is dropped.
    offset: added to the heights before vertical_scale.
    raster: what the array are the samples of, with their scale, offset and unit; `HeightField.open` gives it.

    Raises
    ------
    InvalidInput: dtype, shape, all void, infinite heights (the first is named), values out of range.
    """

    def __init__(
        self,
        array: Any,
        spacing: float | tuple[float, float] | None = None,
        vertical_scale: float = 1.0,
        nodata: float | Sequence[float] | None = None,
        planet: bool = False,
        radius: float = EARTH_RADIUS,
        origin: tuple[float, float] = (0.0, 0.0),
        *,
        degrees: tuple[float, float, float, float] | None = None,
        name: str = "array",
        spec: str = "",
        offset: float = 0.0,
        raster: Raster | None = None,
    ) -> None:
        given = None
        if isinstance(array, np.ma.MaskedArray):
            given = ~np.ma.getmaskarray(array)
            array = array.data
        array = as_array(array, name)
        marks = _nodata(nodata)
        check_array(array, name)
        scale = vertical_scale = positive("vertical_scale", vertical_scale)
        offset = finite("offset", offset) * scale
        if raster is not None:
            scale, offset = _scaling(raster, vertical_scale, offset)
        frame, columns = make_frame(array.shape, spacing, planet, radius, origin, degrees)
        array = array[:, :columns]
        given = None if given is None else given[:, :columns]
        valid = valid_mask(array, marks, given)
        if valid is not None and not valid.any():
            raise InvalidInput(f"height field: all {array.size} samples of {name} are void")
        heights = to_float32(array, scale, offset)
        if raster is not None:
            check_heights(heights, valid, array, raster.place.path, raster.declares)
        check_finite(heights, valid, array, name, "" if scale == 1.0 else f" times vertical_scale {scale:g}")
        rounding = Rounding()
        rounding.add(array, heights, valid, scale, offset)
        rounding.warn(name, vertical_scale)
        frame["height_step"] = height_step(array, valid, scale, offset)
        mask = None
        if valid is not None:
            mask = np.ascontiguousarray(valid).view(np.uint8)
            _core.fill_voids(heights, mask)
        del frame["rows"], frame["cols"]
        self._core = _core.HeightField(heights, mask, **frame, spec=spec)
        self.name = name
        self.used = {} if raster is None else raster.place.used()

    @classmethod
    def open(
        cls,
        path: str | os.PathLike[str],
        spacing: float | tuple[float, float] | None = None,
        vertical_scale: float = 1.0,
        nodata: float | Sequence[float] | str | None = None,
        planet: bool = False,
        radius: float | None = None,
        *,
        band: int | None = None,
        window: tuple[int, int, int, int] | None = None,
        encoding: str | None = None,
        offset: float = 0.0,
        name: str | None = None,
        dataset: str | None = None,
    ) -> HeightField:
        """Reads a raster: GeoTIFF and what else rasterio opens (virtual paths and subdatasets as
        `zip://f.zip!x.tif`, `/vsigzip/f.tif.gz`, `NETCDF:f.nc:var`, `GPKG:f.gpkg:T` among it), `.npy`,
        `f.npz:NAME`, or what OpenImageIO reads (EXR).

        The geotransform gives the axes, or ground control points that hold a scale and a shift: south-up and
        mirrored rasters are turned, rotated ones refused. Units are those that the file declares: of x and y by
        its reference system, of heights by its band, else by its reference system; degrees become metres by the
        lengths of a degree on its ellipsoid at the raster's middle latitude. What declares nothing is in metres.
        `spacing` overrides the geotransform; without either it is 30. `used` says what was used.

        nodata: overrides the raster's; several are possible; "none": every sample is real. Where a raster
            declares none and its lowest or highest value is a customary mark (-9999, 32767, ...) far from all
            others, a warning says so and those samples are void.
        radius: of a planet, metres. Default 6371000, and for other bodies the mean radius of the ellipsoid.
        band: from 1; needed where there are several, but for grey with opacity.
        window: (row0, col0, rows, cols), row 0 north: only these samples are read.
        encoding: "terrarium" or "mapbox": heights that red, green and blue hold together.
        offset: metres, added to the heights before vertical_scale.

        Raises InvalidInput naming the path: missing, a directory, unreadable, not a raster, damaged,
        several bands, a palette, rotated, a height that cannot be, planet without degrees; and as the
        constructor does.
        """
        if isinstance(nodata, str) and nodata != "none":
            raise InvalidInput(f"height field: nodata {nodata!r} is neither a number nor 'none'")
        marks = nodata if nodata is None or isinstance(nodata, str) else _nodata(nodata)
        text = os.fspath(path)
        text = absolute(text) or text
        raster = open_raster(text, band=band, window=window, nodata=marks, encoding=encoding, most=window_samples())
        vertical_scale, offset = positive("vertical_scale", vertical_scale), finite("offset", offset)
        place = raster.place
        usual = EARTH_RADIUS if place.reference.earthly or not planet else place.reference.mean_radius
        keys: dict[str, Any] = {
            "spacing": spacing,
            "vertical_scale": None if vertical_scale == 1.0 else vertical_scale,
            "nodata": raster.guessed or nodata,
            "planet": True if planet else None,
            "radius": None if radius is None or radius == usual else radius,
            "band": band,
            "window": window,
            "encoding": encoding,
            "offset": None if offset == 0.0 else offset,
        }
        radius = usual if radius is None else radius
        placed = planet_place(place, raster.whole) if planet else flat_place(place, spacing)
        if planet:
            placed["spacing"] = spacing  # refused by the constructor when given
        name = name or title(text)
        spec = format_spec(dataset or (text if absolute(text) else os.path.abspath(text)), keys)
        if not isinstance(raster.samples, np.ndarray):
            frame, cols = make_frame(raster.samples.shape, planet=planet, radius=radius, **placed)
            scaling = _scaling(raster, vertical_scale, offset * vertical_scale)
            reader = RasterReader(raster, cols, nodata is None and encoding is None, scaling, vertical_scale)
            return WindowedHeightField(reader, frame, name, spec, place.used(), held=cls)
        field = cls(
            raster.samples,
            vertical_scale=vertical_scale,
            nodata=raster.nodata,
            planet=planet,
            radius=radius,
            name=name,
            spec=spec,
            offset=offset,
            raster=raster,
            **placed,
        )
        if not planet:
            slopes = Slopes(field.spacing[0], vertical_scale)
            slopes.add(field.filled, None if field._core.valid is None else field.valid)
            slopes.warn(text, unplaced(place))
        return field

    @property
    def core(self) -> Any:
        """The native height field."""
        return self._core

    @property
    def grid(self) -> Any:
        """Filled heights by row and column."""
        return self._core.heights

    def every(self, step: int) -> tuple[np.ndarray, np.ndarray]:
        """Every step-th row and column: filled heights, and which are real."""
        return self.filled[::step, ::step], self.valid[::step, ::step]

    @property
    def heights(self) -> np.ndarray:
        """(H, W) float32, metres; voids are NaN. Read-only."""
        filled = self._core.heights
        if self._core.valid is None:
            return filled
        out = np.where(self.valid, filled, np.float32(np.nan))
        out.flags.writeable = False
        return out

    @property
    def valid(self) -> np.ndarray:
        """(H, W) bool: True where the sample is real. Read-only."""
        mask = self._core.valid
        return np.broadcast_to(np.True_, self.shape) if mask is None else mask.view(bool)

    @property
    def void_samples(self) -> int:
        """Samples that are not real."""
        return 0 if self._core.valid is None else int(self._core.valid.size - np.count_nonzero(self._core.valid))

    @property
    def filled(self) -> np.ndarray:
        """(H, W) float32, metres; voids hold the membrane that was put there. Read-only."""
        return self._core.heights

    def __getstate__(self) -> dict[str, Any]:
        """What a worker process needs to have the same field."""
        core = self._core
        frame = {k: v for k, v in core.frame().items() if k not in ("rows", "cols", "z_min", "z_max")}
        kept = {"spec": core.spec, "name": self.name, "used": self.used}
        return {"arrays": (core.heights, core.valid), "frame": frame, **kept}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self._core = _core.HeightField(*state["arrays"], **state["frame"], spec=state["spec"])
        self.name = state["name"]
        self.used = state.get("used", {})

    @property
    def frame(self) -> dict[str, Any]:
        return self._core.frame()

    def __repr__(self) -> str:
        core = self._core
        voids = self.void_samples
        parts = [f"{core.rows} x {core.cols}", self.where, f"heights {core.z_min:g} to {core.z_max:g} m"]
        return f"<HeightField {self.name}: {', '.join(parts)}{f', {voids} voids' if voids else ''}>"


def _scaling(raster: Raster, vertical_scale: float, offset: float) -> tuple[float, float]:
    """Factor and summand that make heights of a raster's samples; `offset` is added, metres."""
    if not (math.isfinite(raster.scale) and raster.scale != 0 and math.isfinite(raster.offset)):
        raise InvalidInput(
            f"open {raster.place.path}: its band has scale {raster.scale:g} and offset {raster.offset:g}; a scale that "
            "is not 0 and a finite offset are needed"
        )
    scale = vertical_scale * (raster.scale * raster.place.vertical)
    return scale, raster.offset / raster.scale * scale + offset
