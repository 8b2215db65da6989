# SPDX-License-Identifier: MIT
"""Where the samples of a raster lie, and in which units: from its reference system, geotransform or control points.

A reference system is read as PROJJSON, in which PROJ writes out ellipsoids, axes and units of every system that
GDAL knows. Samples lie at their centres, row 0 north, column 0 west.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..errors import InvalidInput

WGS84_A = 6378137.0
WGS84_E2 = 0.0066943799901413165
_WGS84_FLATTENING = 298.257223563  # the inverse
_EARTHLY = 5000.0  # metres: how far the semi-major axes of the Earth's ellipsoids may lie from WGS84's
_SNAP = 0.01  # of a sample, over the whole raster: geotransforms carry the rounding of their decimals
_FIT = 0.1  # of a sample: how far control points may lie from a scale and a shift
_US_FOOT = 1200.0 / 3937.0
# What bands call their units, in small letters without blanks, dashes and full stops.
_LENGTHS = {
    1.0: ("m", "metre", "meter", "metres", "meters"),
    0.3048: ("ft", "foot", "feet", "internationalfoot", "internationalfeet", "footintl", "intlfoot", "ftint"),
    _US_FOOT: ("usft", "ftus", "ussurveyfoot", "ussurveyfeet", "footus", "usfoot", "usfeet", "surveyfoot", "feetus"),
    1000.0: ("km", "kilometre", "kilometer", "kilometres", "kilometers"),
    0.1: ("dm", "decimetre", "decimeter", "decimetres", "decimeters"),
    0.01: ("cm", "centimetre", "centimeter", "centimetres", "centimeters"),
    0.001: ("mm", "millimetre", "millimeter", "millimetres", "millimeters"),
    1.8288: ("fathom", "fathoms"),
    0.9144: ("yd", "yard", "yards"),
}
_METRES = {name: metres for metres, names in _LENGTHS.items() for name in names}


def metres_per_degree(latitude: float, a: float = WGS84_A, e2: float = WGS84_E2) -> tuple[float, float]:
    """Lengths, metres, of a degree of longitude and of latitude at a latitude in degrees, on the ellipsoid of
    semi-major axis `a` and squared eccentricity `e2`; WGS84's by default."""
    phi = math.radians(latitude)
    w2 = 1.0 - e2 * math.sin(phi) ** 2
    along_parallel = a / math.sqrt(w2) * math.cos(phi)
    along_meridian = a * (1.0 - e2) / (w2 * math.sqrt(w2))
    return math.radians(along_parallel), math.radians(along_meridian)


@dataclass(frozen=True)
class Reference:
    """What a reference system says: units, ellipsoid, meridian."""

    name: str = ""
    geographic: bool = False
    derived: bool = False  # longitudes and latitudes of other poles
    unit: float = 1.0  # metres; geographic systems: degrees
    unit_name: str = ""
    vertical: float | None = None  # metres upwards, below 0 for depths; None: it has no heights
    vertical_name: str = ""
    ellipsoid: str = "WGS 84"
    a: float = WGS84_A
    e2: float = WGS84_E2
    meridian: float = 0.0  # degrees east of the reference meridian

    @property
    def earthly(self) -> bool:
        """Whether the ellipsoid is one of the Earth's."""
        return abs(self.a - WGS84_A) < _EARTHLY

    @property
    def mean_radius(self) -> float:
        """(2 a + b) / 3, metres."""
        return self.a * (2.0 + math.sqrt(1.0 - self.e2)) / 3.0


@dataclass
class Placement:
    """Where the samples of a raster or of a window of it lie, in units of its reference system."""

    path: str
    known: bool = False  # False: a picture that lies nowhere
    first: tuple[float, float] = (0.0, 0.0)  # centre of the first sample read
    step: tuple[float, float] = (1.0, 1.0)  # east and south, positive
    middle_latitude: float = 0.0  # degrees, of the whole raster, so that windows agree
    row0: int = 0
    col0: int = 0
    reference: Reference = field(default_factory=Reference)
    vertical: float = 1.0  # metres upwards of a unit of height
    vertical_from: str = ""  # who says so

    def metres_per_unit(self) -> tuple[float, float]:
        """Factors for x and y."""
        reference = self.reference
        if not reference.geographic:
            return reference.unit, reference.unit
        if abs(self.middle_latitude) >= 90.0:
            raise InvalidInput(f"open {self.path}: middle latitude {self.middle_latitude} is not within +-90")
        kx, ky = metres_per_degree(self.middle_latitude, reference.a, reference.e2)
        return kx * reference.unit, ky * reference.unit

    def used(self) -> dict[str, str]:
        """What of the file was used, for people: reference system, units, ellipsoid."""
        reference, out = self.reference, {}
        if reference.name:
            out["crs"] = reference.name
        if self.known:
            out["horizontal_unit"] = reference.unit_name or "none declared, taken as metre"
            if reference.geographic:
                out["ellipsoid"] = f"{reference.ellipsoid}, semi-major axis {reference.a:.10g} m"
        else:
            out["horizontal_unit"] = "none: not georeferenced"
        out["vertical_unit"] = self.vertical_from or "none declared, taken as metre"
        return out


def _axes(system: Mapping[str, Any]) -> Iterator[Mapping[str, Any]]:
    """The axes of a PROJJSON system, horizontal ones first."""
    if "source_crs" in system:
        yield from _axes(system["source_crs"])
    for part in system.get("components", ()):
        yield from _axes(part)
    yield from system.get("coordinate_system", {}).get("axis", ())


def _find(system: Any, key: str) -> Any:
    """The first value of a key anywhere in a PROJJSON system; None without one."""
    if isinstance(system, Mapping):
        if key in system:
            return system[key]
        system = system.values()
    elif not isinstance(system, list):
        return None
    return next((found for part in system if (found := _find(part, key)) is not None), None)


def _factor(unit: Any) -> tuple[float, str]:
    """Metres or degrees of a PROJJSON unit, and its name."""
    if isinstance(unit, Mapping):
        factor, name = float(unit.get("conversion_factor", 1.0)), str(unit.get("name", ""))
        return math.degrees(factor) if unit.get("type") == "AngularUnit" else factor, name
    return 1.0, str(unit or "")


def _degrees(value: Any) -> float:
    """Degrees of a PROJJSON angle."""
    if isinstance(value, Mapping):
        return float(value["value"]) * _factor(value.get("unit"))[0]
    return float(value or 0.0)


def _ellipsoid_of(system: Mapping[str, Any]) -> dict[str, Any]:
    """Name, axis and eccentricity. What differs from WGS84 by less than 0.2 mm (GRS 1980) is computed as WGS84."""
    given = _find(system, "ellipsoid")
    if given is None:
        return {}
    metres = {key: float(v["value"] * _factor(v.get("unit"))[0]) if isinstance(v, Mapping) else float(v)
              for key, v in given.items() if key in ("radius", "semi_major_axis", "semi_minor_axis")}  # fmt: skip
    a = metres.get("radius", metres.get("semi_major_axis", WGS84_A))
    inverse = float(given.get("inverse_flattening", 0.0))
    ratio = metres["semi_minor_axis"] / a if "semi_minor_axis" in metres else 1.0 - (1.0 / inverse if inverse else 0.0)
    name = str(given.get("name", "unknown"))
    if abs(a - WGS84_A) < 1e-4 and abs(inverse - _WGS84_FLATTENING) < 1e-5:
        return {"ellipsoid": name}
    return {"ellipsoid": name, "a": a, "e2": 1.0 - ratio * ratio}


def reference_of(crs: Any) -> Reference:
    """What a rasterio CRS says; None is a system of metres."""
    import rasterio
    from rasterio.errors import CRSError

    if crs is None:
        return Reference()
    try:
        with rasterio.Env():
            system = crs.to_dict(projjson=True)
    except CRSError:
        system = {}
    system = system.get("source_crs", system)
    name = str(system.get("name") or crs.to_string())
    axes = list(_axes(system))
    flat = [axis for axis in axes if axis.get("direction") not in ("up", "down")]
    unit, unit_name = _factor(flat[0].get("unit")) if flat else (1.0, "")
    if crs.is_projected:
        unit = float(crs.linear_units_factor[1])
    if unit_name == "unknown":
        unit_name = f"unknown ({unit:g} m)"
    vertical, vertical_name = None, ""
    for axis in axes:
        if axis.get("direction") in ("up", "down"):
            vertical, vertical_name = _factor(axis.get("unit"))
            if axis["direction"] == "down":
                vertical, vertical_name = -vertical, f"{vertical_name} downwards"
    meridian = (_find(system, "prime_meridian") or {}).get("longitude")
    return Reference(
        name=name,
        geographic=bool(crs.is_geographic),
        derived="DerivedGeographicCRS" in (system.get("type"), *(p.get("type") for p in system.get("components", ()))),
        unit=unit,
        unit_name=unit_name,
        vertical=vertical,
        vertical_name=vertical_name,
        meridian=_degrees(meridian),
        **_ellipsoid_of(system),
    )


def vertical_of(unit: str | None, reference: Reference, path: str) -> tuple[float, str]:
    """Metres upwards of a unit of height, and who says so: the band, then the reference system, else nobody."""
    declared = (unit or "").strip()
    known = _METRES.get("".join(c for c in declared.lower() if c.isalnum()))
    if declared and known is None:
        warnings.warn(
            f"{path}: its band is in {declared!r}, which is no length that lodlab knows; heights are taken as metres "
            "(vertical_scale=FACTOR converts them)",
            stacklevel=5,
        )
        return 1.0, f"{declared} (band; unknown, taken as metre)"
    by_system = reference.vertical
    if known is None:
        return (1.0, "") if by_system is None else (by_system, f"{reference.vertical_name} (reference system)")
    if by_system is not None and not math.isclose(known, abs(by_system), rel_tol=1e-9):
        warnings.warn(
            f"{path}: its band is in {declared}, its reference system's heights in {reference.vertical_name}; the "
            "band's unit is used",
            stacklevel=5,
        )
    down = by_system is not None and by_system < 0
    return -known if down else known, f"{declared} (band)" + (", downwards (reference system)" if down else "")


def _by_control_points(dataset: Any, path: str) -> Any:
    """The geotransform that control points hold, without turn or skew; InvalidInput where they hold another."""
    from rasterio.transform import Affine

    points = dataset.gcps[0]
    row, col, x, y = np.array([(p.row, p.col, p.x, p.y) for p in points], np.float64).T
    off = math.inf
    if np.ptp(row) > 0 and np.ptp(col) > 0:
        (a, c), (e, f) = np.polyfit(col - col[0], x - x[0], 1), np.polyfit(row - row[0], y - y[0], 1)
        if a != 0 and e != 0:
            off_x, off_y = x - x[0] - c - a * (col - col[0]), y - y[0] - f - e * (row - row[0])
            off = max(float(np.abs(off_x / a).max()), float(np.abs(off_y / e).max()))
    if not off <= _FIT:
        raise InvalidInput(
            f"open {path}: its {len(points)} ground control points are no scale and shift (the farthest is {off:.3g} "
            f"samples off; the limit is {_FIT:g}); warp it to north-up with gdalwarp"
        )
    return Affine(a, 0.0, x[0] + c - a * col[0], 0.0, e, y[0] + f - e * row[0])


def place_of(dataset: Any, path: str, row0: int, col0: int) -> tuple[Placement, bool, bool]:
    """Placement of a window, and whether the file's rows run north and its columns west.

    The identity is what rasterio answers where a file has no geotransform.
    """
    t, crs = dataset.transform, dataset.crs
    if t.is_identity and dataset.gcps[0]:
        t, crs = _by_control_points(dataset, path), dataset.gcps[1] or crs
    reference = reference_of(crs)
    place = Placement(path, row0=row0, col0=col0, reference=reference)
    if t.is_identity:
        return place, False, False
    rows, cols = dataset.height, dataset.width
    if t.a == 0 or t.e == 0 or abs(t.b) * rows > _SNAP * abs(t.a) or abs(t.d) * cols > _SNAP * abs(t.e):
        raise InvalidInput(
            f"open {path}: its geotransform ({t.a:g}, {t.b:g}, {t.d:g}, {t.e:g}) is rotated; warp it to north-up"
        )
    south_up, mirrored = t.e > 0, t.a < 0
    east, south = abs(t.a), abs(t.e)
    west = t.c + t.a * cols if mirrored else t.c
    north = t.f + t.e * rows if south_up else t.f
    place.known = True
    place.first = (west + (col0 + 0.5) * east, north - (row0 + 0.5) * south)
    place.step = (east, south)
    if reference.geographic:
        place.middle_latitude = (north - 0.5 * rows * south) * reference.unit
    return place, south_up, mirrored
