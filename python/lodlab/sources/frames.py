# SPDX-License-Identifier: MIT
"""Where the samples of a height field lie, as keywords of the core: from numbers that a user gives, or from the
placement of a raster. Flat fields in metres, planets in degrees.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..errors import InvalidInput
from .placement import Placement

EARTH_RADIUS = 6371000.0
DEFAULT_SPACING = 30.0
_SNAP = 0.01  # of a sample: geotransforms carry the rounding of their decimals


def positive(what: str, value: Any) -> float:
    """A number above 0; InvalidInput names it otherwise."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise InvalidInput(f"height field: {what} {value!r} is not a number") from None
    if not (math.isfinite(number) and number > 0):
        raise InvalidInput(f"height field: {what} {value!r} is not positive and finite")
    return number


def pair(what: str, value: Any) -> tuple[float, float]:
    """(dx, dy) from one number or two."""
    values = tuple(value) if isinstance(value, (Sequence, np.ndarray)) and not isinstance(value, str) else None
    if values is None:
        values = (value, value)
    if len(values) != 2:
        raise InvalidInput(f"height field: {what} {value!r} is neither one number nor (dx, dy)")
    return positive(what, values[0]), positive(what, values[1])


def origin_of(value: Any) -> tuple[float, float]:
    """(x0, y0) from a pair of numbers; the core checks that they are finite."""
    try:
        x0, y0 = value
        return float(x0), float(y0)
    except (TypeError, ValueError):
        raise InvalidInput(f"height field: origin {value!r} is not (x0, y0)") from None


def finite(what: str, value: Any) -> float:
    """A finite number; InvalidInput names it otherwise."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise InvalidInput(f"height field: {what} {value!r} is not a number") from None
    if not math.isfinite(number):
        raise InvalidInput(f"height field: {what} {value!r} is not finite")
    return number


def extent_of(frame: Mapping[str, Any]) -> str:
    """Where a source lies, in words, by its frame; y falls down the rows."""
    if frame["planet"]:
        return f"planet of radius {frame['radius']:g} m"
    x, y = frame.get("x0", 0.0), frame.get("y0", 0.0)
    east, south = x + (frame["cols"] - 1) * frame["dx"], y - (frame["rows"] - 1) * frame["dy"]
    return f"x {x:.10g} to {east:.10g}, y {y:.10g} down to {south:.10g} m"


def _planet_frame(
    shape: tuple[int, int], degrees: tuple[float, float, float, float] | None, radius: float
) -> tuple[dict[str, Any], int]:
    """Frame of a planet's grid, and how many columns to keep. Steps are snapped to whole circles."""
    rows, cols = shape
    if degrees is None:
        degrees = (0.0, 90.0, 360.0 / cols, 180.0 / (rows - 1))
    lon0, lat0, dlon, dlat = (float(v) for v in degrees)
    if not all(map(math.isfinite, (lon0, lat0))):
        raise InvalidInput(f"height field: planet starts at ({lon0}, {lat0}) degrees; finite numbers are needed")
    dlon, dlat = positive("planet column step", dlon), positive("planet row step", dlat)
    if abs((cols - 1) * dlon - 360.0) < _SNAP * dlon:
        cols -= 1
    wraps = abs(cols * dlon - 360.0) < _SNAP * dlon
    if wraps:
        dlon = 360.0 / cols
    south = lat0 - (rows - 1) * dlat
    lat0 = 90.0 if abs(lat0 - 90.0) < _SNAP * dlat else lat0
    south = -90.0 if abs(south + 90.0) < _SNAP * dlat else south
    dlat = (lat0 - south) / (rows - 1)
    metres = math.radians(1.0) * radius
    frame = {"lon0": lon0, "lat0": lat0, "dlon": dlon, "dlat": dlat, "wraps": wraps}
    return frame | {"dx": dlon * metres, "dy": dlat * metres}, cols


def make_frame(
    shape: tuple[int, int],
    spacing: float | tuple[float, float] | None = None,
    planet: bool = False,
    radius: float = EARTH_RADIUS,
    origin: tuple[float, float] = (0.0, 0.0),
    degrees: tuple[float, float, float, float] | None = None,
) -> tuple[dict[str, Any], int]:
    """Where the samples of an array lie, as keywords of the core, and how many of its columns are kept."""
    frame: dict[str, Any] = {"planet": bool(planet), "radius": positive("radius", radius)}
    columns = shape[1]
    if planet:
        if spacing is not None:
            raise InvalidInput("height field: spacing is for flat fields; a planet's follows from its degrees")
        placed, columns = _planet_frame(shape, degrees, frame["radius"])
        frame |= placed
    else:
        dx, dy = pair("spacing", DEFAULT_SPACING if spacing is None else spacing)
        x0, y0 = origin_of(origin)
        frame |= {"dx": dx, "dy": dy, "x0": x0, "y0": y0}
    return frame | {"rows": shape[0], "cols": columns}, columns


def unplaced(place: Placement) -> str:
    """What may be wrong where spacing and heights cannot belong together."""
    if place.known and not place.reference.name:
        return "; it has no reference system: are these degrees? Give spacing=METRES, or assign the system"
    return "; give spacing=METRES or vertical_scale=FACTOR"


def flat_place(place: Placement, spacing: float | tuple[float, float] | None) -> dict[str, Any]:
    """spacing and origin of a raster, metres."""
    if spacing is None and not place.known and place.reference.name:
        warnings.warn(
            f"{place.path}: it has a reference system ({place.reference.name}), but nothing says where its samples "
            f"lie; they are taken as {DEFAULT_SPACING:g} m apart (spacing=METRES says otherwise)",
            stacklevel=3,
        )
    if spacing is not None or not place.known:
        dx, dy = pair("spacing", DEFAULT_SPACING if spacing is None else spacing)
        return {"spacing": (dx, dy), "origin": (place.col0 * dx, -place.row0 * dy)}
    kx, ky = place.metres_per_unit()
    x, y = place.first
    return {"spacing": (place.step[0] * kx, place.step[1] * ky), "origin": (x * kx, y * ky)}


def planet_place(place: Placement, whole: tuple[int, int]) -> dict[str, Any]:
    """degrees of a raster's samples; a raster that lies nowhere covers the sphere."""
    if not place.known:
        dlon, dlat = 360.0 / whole[1], 180.0 / (whole[0] - 1)
        return {"degrees": (place.col0 * dlon, 90.0 - place.row0 * dlat, dlon, dlat)}
    reference = place.reference
    if not reference.geographic or reference.derived:
        kind = "has rotated poles" if reference.derived else "is projected"
        raise InvalidInput(f"height field: planet=true needs longitude and latitude; {place.path} {kind}")
    lon, lat = (v * reference.unit for v in place.first)
    return {"degrees": (lon + reference.meridian, lat, *(v * reference.unit for v in place.step))}
