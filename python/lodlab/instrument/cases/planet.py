# SPDX-License-Identifier: MIT
"""Cases on planets: bumps on either side of the horizon, and the sagitta of known tessellations.

The eye is on the x axis, `EYE` from the centre, and looks at the centre. A point at distance r from the
centre, an angle t off the x axis, is K r sin t / (EYE - r cos t) pixels from the middle of the picture.
"""

from __future__ import annotations

import math

import numpy as np

from ..._core import View
from ...sources.heightfield import HeightField
from .case import FOV, SIDE, Case, K, ball, focal, nearest_rank, pixel_offsets, rms

RADIUS, EYE = 1000.0, 3000.0
ROWS, COLS = 37, 72  # 5 degrees a sample
VIEW = View((EYE, 0.0, 0.0), (0.0, 0.0, 0.0), fov=FOV, size=(SIDE, SIDE))


def _seen(r: float, degrees: float) -> float:
    """Pixels from the middle at which a point of the meridian or the equator is seen."""
    t = math.radians(degrees)
    return K * r * math.sin(t) / (EYE - r * math.cos(t))


def _horizon(r: float) -> float:
    """Degrees off the axis at which a point that far from the centre goes behind the sphere without bumps."""
    return math.degrees(math.acos(RADIUS / EYE) + math.acos(RADIUS / r))


def _moves(h: float, degrees: float) -> float:
    return abs(_seen(RADIUS + h, degrees) - _seen(RADIUS, degrees))


def _direction(latitude: float, longitude: float) -> np.ndarray:
    lat, lon = math.radians(latitude), math.radians(longitude)
    return np.array([math.cos(lat) * math.cos(lon), math.cos(lat) * math.sin(lon), math.sin(lat)])


def _on_plane(a: np.ndarray, b: np.ndarray, c: np.ndarray, ray: np.ndarray) -> float:
    """How far out the ray from the centre meets the plane through three points: n . a / n . ray."""
    normal = np.cross(b - a, c - a)
    return float(normal @ a / (normal @ ray))


def _bump(name: str, row: int, col: int, degrees: float, samples: int = 1) -> Case:
    # A bump of 10 m, `degrees` off the axis, drawn without it. A pole's bump is that of its whole row.
    h = 10.0
    return Case(
        name,
        ball(RADIUS, ROWS, COLS, (row, col, h)),
        (ball(RADIUS, ROWS, COLS),),
        VIEW,
        {
            "measured_max": h,
            "measured_rms": h * math.sqrt(samples / (ROWS * COLS)),
            "measured_px_max": _moves(h, degrees) if degrees < _horizon(RADIUS + h) else 0.0,
            "measured_samples": ROWS * COLS,
            "hole_samples": 0,
            "crack_edges": 0,
        },
    )


def _bumps() -> list[Case]:
    return [
        _bump("planet, bump 20 deg off the axis", 18, 4, 20.0),  # longitude 20
        _bump("planet, bump north of the axis", 15, 0, 15.0),
        _bump("planet, bump in the first column, from the west", 18, 71, 5.0),  # longitude -5: across the seam
        # The horizon is acos(RADIUS / EYE) = 70.5 degrees off the axis, of a bump's top acos(RADIUS / 1010) = 8.1
        # more. At 75 degrees it counts, though drawn without it nothing is seen there; at 80 degrees it does not.
        _bump("planet, bump just before the horizon", 18, 15, 75.0),
        _bump("planet, bump just beyond the horizon", 18, 16, 80.0),
        _bump("planet, bump 20 deg behind the horizon", 18, 18, 90.0),
        _bump("planet, bump on the far side", 18, 32, 160.0),
        _bump("planet, bump at the pole", 0, 0, 90.0, samples=COLS),
    ]


def _sphere() -> Case:
    # Every other sample drawn, 10 degrees apart. The worst sample is the middle of the cells beside the
    # equator, (5, 5) degrees: it lies under the triangle (0, 0), (0, 10), (10, 10) of its cell, as the
    # diagonal's arc runs north of it; seen from the axis it is not the worst.
    corners = [RADIUS * _direction(*at) for at in ((0.0, 0.0), (0.0, 10.0), (10.0, 10.0))]
    drawn = _on_plane(*corners, _direction(5.0, 5.0))
    return Case(
        "sphere drawn at half the resolution",
        ball(RADIUS, ROWS, COLS),
        (ball(RADIUS, (ROWS + 1) // 2, COLS // 2),),
        VIEW,
        {"measured_max": RADIUS - drawn, "hole_samples": 0, "crack_edges": 0, "inverted_triangles": 0},
    )


def _patch(half: float, samples: int, middle: tuple[float, float] = (0.0, 0.0)) -> HeightField:
    """A patch of the planet, `half` degrees round its middle (latitude, longitude)."""
    step = 2.0 * half / (samples - 1)
    place = (middle[1] - half, middle[0] + half, step, step)
    return HeightField(np.zeros((samples, samples)), planet=True, radius=RADIUS, degrees=place)


def _cell() -> Case:
    # One cell of 10 x 10 degrees round (0, 0), drawn as two triangles, against 3 x 3 samples.
    # Middle: the diagonal's own midpoint, R cos^2 5. West and east: midpoints of a meridian's chord, R cos 5.
    # North and south: the arc between the corners bends polewards, so the ray meets the triangle beside it.
    cos5 = math.cos(math.radians(5.0))
    nw, ne, se = (RADIUS * _direction(*at) for at in ((5.0, -5.0), (5.0, 5.0), (-5.0, 5.0)))
    north = _on_plane(nw, se, ne, _direction(5.0, 0.0))
    errors = [RADIUS * (1.0 - cos5**2), *2 * [RADIUS * (1.0 - cos5)], *2 * [RADIUS - north]]
    aside = [abs(_seen(RADIUS, 5.0) - _seen(r, 5.0)) for r in (RADIUS * cos5, north)]  # the middle is on the axis
    return Case(
        "planet's cell: chords, diagonal and arcs",
        _patch(5.0, 3),
        (_patch(5.0, 2),),
        VIEW,
        {
            "measured_max": max(errors),
            "measured_rms": math.sqrt(sum(e * e for e in errors) / 9.0),
            "measured_px_max": max(aside),
            "hole_samples": 0,
            "measured_samples": 9,
        },
    )


def _raised() -> Case:
    # A smaller sphere drawn for the larger: every sample moves along its own ray. The most pixels are lost
    # where K r sin t / (EYE - r cos t) differs most, over the samples' angles off the axis, up to the horizon.
    angles = np.degrees(np.arccos(_directions_x()))
    pixels = max(_moves(-50.0, t) for t in angles if t < _horizon(RADIUS))
    return Case(
        "planet drawn 50 m too small",
        ball(RADIUS, ROWS, COLS),
        (ball(RADIUS - 50.0, ROWS, COLS),),
        VIEW,
        {
            "measured_max": 50.0,
            "measured_rms": 50.0,
            "measured_px_max": pixels,
            "pop_px_max": pixels,
            "crack_edges": 0,
        },
        before=(ball(RADIUS, ROWS, COLS),),
    )


def _directions_x() -> np.ndarray:
    """x of the samples' directions: cosines of their angles off the axis."""
    lat, lon = np.radians(90.0 - 5.0 * np.arange(ROWS)), np.radians(5.0 * np.arange(COLS))
    return np.unique(np.clip(np.outer(np.cos(lat), np.cos(lon)), -1.0, 1.0))


def _disc() -> Case:
    # Seen through 10 degrees: the ray a off the axis meets the sphere where R sin(t + a) = EYE sin a. A sphere 50 m
    # smaller is drawn there, as seen on the same ray from the centre. Cells of 1 degree are flat to 0.08 m.
    k = focal(10.0)
    a = np.arctan(np.hypot(*pixel_offsets()) / k)
    t = np.arcsin(EYE * np.sin(a) / RADIUS) - a
    small = RADIUS - 50.0
    before, after = (k * r * np.sin(t) / (EYE - r * np.cos(t)) for r in (RADIUS, small))
    moved = before - after
    return Case(
        "middle of a planet drawn 50 m too small",
        ball(RADIUS, 181, 360),
        (ball(small, 181, 360),),
        View((EYE, 0.0, 0.0), (0.0, 0.0, 0.0), fov=10.0, size=(SIDE, SIDE)),
        {
            "measured_px_rms": rms(moved),
            "measured_px_p99": nearest_rank(moved),
            "pop_area": float(np.mean(moved > 1.0)),
            "capture_mismatch_pixels": 0,
        },
        before=(ball(RADIUS, 181, 360),),
    )


def _half(west: float, step: float) -> HeightField:
    """Half of the sphere: 180 degrees east from `west`, `step` degrees a sample."""
    shape = (round(180.0 / step) + 1, round(180.0 / step) + 1)
    return HeightField(np.zeros(shape), planet=True, radius=RADIUS, degrees=(west, 90.0, step, step))


def _halves() -> list[Case]:
    source = ball(RADIUS, ROWS, COLS)
    east, west, coarse = _half(0.0, 5.0), _half(180.0, 5.0), _half(180.0, 10.0)
    return [
        Case(
            "planet, two halves that meet",
            source,
            (east, west),
            VIEW,
            {"crack_edges": 0, "hole_samples": 0, "measured_max": 0.0, "crack_pixels": 0},
        ),
        # Two meridians, each with 36 fine edges on one side and 18 coarse ones on the other.
        Case("planet, a coarse half beside a fine one", source, (east, coarse), VIEW, {"crack_edges": 108}),
        # Columns 0 to 36 are covered, and the poles: 35 columns of 35 rows are not. The free edges: two meridians.
        Case(
            "planet, one half",
            source,
            (east,),
            VIEW,
            {"hole_samples": 35 * 35, "measured_max": math.inf, "measured_px_max": math.inf, "crack_edges": 72},
        ),
    ]


def planet_cases() -> list[Case]:
    return [*_bumps(), _cell(), _sphere(), _raised(), _disc(), *_halves()]
