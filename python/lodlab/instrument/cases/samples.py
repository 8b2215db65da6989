# SPDX-License-Identifier: MIT
"""Cases over samples: bumps, steps, slopes and holes on flat fields, and what a method predicts of them.

The pinhole formula: a point at depth d (along the view axis) and u to the right or up is seen K u / d pixels
from the middle of the picture. A height field's error is vertical, so a level camera sees an error h at
depth d as K h / d; straight above a plane, a point r off the axis that rises from depth D to D - h moves
outwards by K r (1 / (D - h) - 1 / D) = K r h / (D (D - h)).
"""

from __future__ import annotations

import math

import numpy as np

from ..._core import View
from ...sources.heightfield import HeightField
from .case import SIDE, Case, Drawn, Height, K, focal, from_above, level, sheet, spike, square

PLANE = square(128.0, 32)  # 33 x 33 samples, 8 m apart
SAMPLES = 33 * 33


def _outwards(r: float, depth: float, h: float, k: float = K) -> float:
    """Pixels by which a point r off the axis moves when it rises by h towards a camera `depth` above it."""
    return k * r * h / (depth * (depth - h))


def _bump(name: str, at: tuple[float, float], h: float, view: View, pixels: float) -> Case:
    """A plane with one bump drawn without it: only that sample is wrong, by h."""
    source = square(128.0, 32, spike(at, h))
    # One error among n samples: rms = sqrt(h^2 / n).
    values = {"measured_px_max": pixels, "measured_max": abs(h), "measured_rms": abs(h) / math.sqrt(SAMPLES)}
    return Case(name, source, (PLANE,), view, values)


def _level_bumps() -> list[Case]:
    turn = math.radians(20.0)
    aside = (-200.0 * math.sin(turn), -200.0 * math.cos(turn), 2.0)
    roll = math.radians(30.0)
    rolled = level((0.0, -200.0, 2.0), up=(math.sin(roll), 0.0, math.cos(roll)))
    wide = level((0.0, -200.0, 2.0), fov=60.0, size=(320, 200))
    narrow = level((0.0, -1000.0, 0.5), fov=10.0)
    return [
        _bump("bump of 4 m, seen level, on axis", (0.0, 0.0), 4.0, level((0.0, -200.0, 2.0)), K * 4.0 / 200.0),
        _bump("pit of 4 m, seen level, on axis", (0.0, 0.0), -4.0, level((0.0, -200.0, 2.0)), K * 4.0 / 200.0),
        # 200 m away, 20 degrees to the right: its depth is the part along the axis.
        _bump("bump, off-centre 20 deg", (0.0, 0.0), 4.0, level(aside), K * 4.0 / (200.0 * math.cos(turn))),
        _bump("bump, camera rolled by 30 deg", (0.0, 0.0), 4.0, rolled, K * 4.0 / 200.0),
        _bump("bump, 60 deg across 320 pixels", (0.0, 0.0), 4.0, wide, focal(60.0, 320) * 4.0 / 200.0),
        _bump("bump, grazing: eye 0.5 m up, 1 km off", (0.0, 0.0), 0.25, narrow, focal(10.0) * 0.25 / 1000.0),
        _bump("bump of 0.02 pixel", (0.0, 0.0), 0.03125, level((0.0, -200.0, 2.0)), K * 0.03125 / 200.0),
    ]


def _placed_bumps() -> list[Case]:
    """The same bump of 4 m, 200 m ahead, on fields that lie, are spaced or are given otherwise."""

    def case(name: str, source: HeightField, drawn: HeightField, east: float = 0.0, north: float = 0.0) -> Case:
        values = {
            "measured_px_max": K * 4.0 / 200.0,
            "measured_max": 4.0,
            "measured_rms": 4.0 / math.sqrt(source.shape[0] * source.shape[1]),
        }
        return Case(name, source, (drawn,), level((east, north - 200.0, 2.0)), values)

    def far(z: Height = 0.0) -> HeightField:
        return sheet((east - 128.0, east + 128.0), (north - 128.0, north + 128.0), (33, 33), z)

    def oblong(z: Height = 0.0) -> HeightField:
        return sheet((-128.0, 128.0), (-96.0, 96.0), (9, 33), z)

    east, north = 500_000.0, 5_000_000.0
    steps = np.zeros((33, 33), np.int16)
    steps[16, 16] = 16
    scaled = HeightField(steps, spacing=8.0, origin=(-128.0, 128.0), vertical_scale=0.25)
    return [
        case("bump, 5000 km from the origin", far(spike((east, north), 4.0)), far(), east, north),
        case("bump, samples 8 x 24 m apart", oblong(spike((0.0, 0.0), 4.0)), oblong()),
        case("bump of 16 steps of a quarter metre", scaled, PLANE),
    ]


def _pitched_bump() -> Case:
    # The eye 100 m up, the axis 30 degrees down. A point t ahead, e right and z high lies
    # f = t cos + (100 - z) sin along the axis, and (t sin - (100 - z) cos) up the picture.
    down, ahead, right, h = math.radians(30.0), 150.0, 40.0, 6.0

    def seen(z: float) -> np.ndarray:
        depth = ahead * math.cos(down) + (100.0 - z) * math.sin(down)
        return K / depth * np.array([right, ahead * math.sin(down) - (100.0 - z) * math.cos(down)])

    eye = (-right, -ahead, 100.0)
    target = (-right, -ahead + math.cos(down), 100.0 - math.sin(down))
    view = View(eye, target, fov=90.0, size=(SIDE, SIDE))
    return _bump("bump, off-centre, axis 30 deg down", (0.0, 0.0), h, view, float(np.linalg.norm(seen(h) - seen(0.0))))


def _bumps_from_above() -> list[Case]:
    edge = 64.0  # K r / (D - h) pixels off the middle, of 128
    border = [
        # D - h = K r / 127.75 shows the bump a quarter pixel inside the border, K r / 128.25 outside it.
        _bump(
            f"bump, a quarter pixel {side} the border",
            (edge, 0.0),
            4.0,
            from_above((0.0, 0.0, 4.0 + K * edge / pixel)),
            _outwards(edge, 4.0 + K * edge / pixel, 4.0) if pixel < 128.0 else 0.0,
        )
        for side, pixel in (("inside", 127.75), ("outside", 128.25))
    ]
    return [
        _bump("bump from straight above", (48.0, 0.0), 4.0, from_above((0.0, 0.0, 256.0)), _outwards(48.0, 256.0, 4.0)),
        # On the axis a rise changes the depth alone.
        _bump("bump from straight above, on axis", (0.0, 0.0), 4.0, from_above((0.0, 0.0, 256.0)), 0.0),
        _bump("bump behind the camera's back", (0.0, -64.0), 4.0, level((0.0, 0.0, 20.0)), 0.0),
        *border,
    ]


def _near_plane() -> list[Case]:
    # A plane drawn with a spike that comes nearer than the near plane n = 1 m, or past the eye 100 m up. Of the
    # way up only the part to the near plane is seen: the point goes from K r / D to K r / n.
    pixels = K * 8.0 * (1.0 / 1.0 - 1.0 / 100.0)
    view = from_above((0.0, 0.0, 100.0), near=1.0)
    cases = [
        Case(
            f"spike drawn {where}",
            PLANE,
            (square(128.0, 32, spike((8.0, 0.0), h)),),
            view,
            {"measured_px_max": pixels, "measured_max": h, "measured_rms": h / math.sqrt(SAMPLES)},
        )
        for where, h in (("within the near plane", 99.5), ("past the eye", 150.0))
    ]
    # The other way about: the sample itself is nearer than the near plane, so it is not inside the frustum.
    cases.append(_bump("spike of the source past the eye", (8.0, 0.0), 150.0, view, 0.0))
    beside = from_above((-0.25, 0.0, 100.0), near=1.0)
    cases.append(_bump("spike of the source within the near plane", (0.0, 0.0), 99.5, beside, 0.0))
    return cases


def _hidden_bump() -> Case:
    def ridge(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.where(y == -64.0, 50.0, 0.0)

    with_bump = square(128.0, 32, lambda x, y: ridge(x, y) + spike((0.0, 0.0), 4.0)(x, y))
    return Case(
        "bump hidden behind a ridge",
        with_bump,
        (square(128.0, 32, ridge),),
        level((0.0, -200.0, 2.0)),
        {"measured_px_max": K * 4.0 / 200.0, "measured_max": 4.0},
    )


def _two_bumps() -> Case:
    # 2 m at depth 136 are more pixels than 2.5 m at depth 264: the two maxima come from different samples.
    near, far = spike((0.0, -64.0), 2.0), spike((0.0, 64.0), 2.5)
    return Case(
        "two bumps: the nearer one is lower",
        square(128.0, 32, lambda x, y: near(x, y) + far(x, y)),
        (PLANE,),
        level((0.0, -200.0, 2.0)),
        {
            "measured_px_max": K * 2.0 / 136.0,
            "measured_max": 2.5,
            "measured_rms": math.sqrt((2.0**2 + 2.5**2) / SAMPLES),
        },
    )


def _slopes() -> list[Case]:
    def slope(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return 0.25 * x

    def stepped(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return slope(x, y) + np.where(x >= 32.0, 5.0, 0.0)

    corner = 128.0 * math.sqrt(2.0)  # the highest sample, 32 m up, and the farthest from the axis
    step = Case(
        "tilted plane with a step of 5 m",
        square(128.0, 32, stepped),
        (square(128.0, 32, slope),),
        from_above((0.0, 0.0, 512.0)),
        {
            "measured_max": 5.0,
            "measured_rms": 5.0 * math.sqrt(13.0 / 33.0),  # columns x = 32 to 128 of 33
            "measured_px_max": K * corner * (1.0 / (512.0 - 37.0) - 1.0 / (512.0 - 32.0)),
        },
    )
    # Level drawn for tilted: 2 m a column, k = -16 to 16 columns from the middle; mean k^2 = m (m + 1) / 3.
    tilt = Case(
        "tilted plane drawn level",
        square(128.0, 32, slope),
        (PLANE,),
        level((0.0, -288.0, 16.0)),
        {
            "measured_max": 32.0,
            "measured_rms": 2.0 * math.sqrt(16.0 * 17.0 / 3.0),
            "measured_px_max": K * 32.0 / 160.0,  # the nearest row: y = -128, 160 m ahead
        },
    )
    # The same slope 3 m further east is 3/4 m lower everywhere; its samples lie beside the source's.
    moved = Case(
        "slope drawn 3 m aside",
        square(128.0, 32, slope),
        (sheet((-157.0, 163.0), (-160.0, 160.0), (41, 41), lambda x, y: 0.25 * (x - 3.0)),),
        from_above((0.0, 0.0, 256.0)),
        {"measured_max": 0.75, "measured_rms": 0.75, "hole_samples": 0, "measured_samples": SAMPLES},
    )
    return [step, tilt, moved]


def _curved() -> Case:
    # z = x^2 / 256 drawn with a quarter of the columns: within a segment of 32 m the chord is
    # u (32 - u) / 256 above it: 0, 3/4, 1, 3/4 m at the four samples from u = 0.
    def parabola(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return x * x / 256.0

    return Case(
        "parabola drawn with a quarter of the columns",
        square(128.0, 32, parabola),
        (sheet((-128.0, 128.0), (-128.0, 128.0), (33, 9), parabola),),
        from_above((0.0, 0.0, 256.0)),
        {"measured_max": 1.0, "measured_rms": math.sqrt(8.0 * (1.0 + 2.0 * 0.75**2) / 33.0)},
    )


def _layers() -> list[Case]:
    # Two surfaces over every sample, 2 m too high and 3 m too low: the worse one counts, drawn first or last.
    high, low = square(128.0, 4, 2.0), square(128.0, 4, -3.0)
    view = level((0.0, -192.0, 16.0))
    values = {"measured_max": 3.0, "measured_rms": 3.0, "measured_px_max": K * 3.0 / 64.0}
    return [
        Case("two layers, the better one last", PLANE, (low, high), view, values),
        Case("two layers, the worse one last", PLANE, (high, low), view, values),
    ]


def _half_pixel() -> Case:
    # Seen level from 64 m before its nearest row, a plane that lies a quarter metre too high is K / 256 px off.
    return Case(
        "plane translated by half a pixel",
        PLANE,
        (square(128.0, 32, 0.25),),
        level((0.0, -192.0, 16.0)),
        {"measured_px_max": 0.5, "measured_max": 0.25, "measured_rms": 0.25},
    )


def _holes() -> list[Case]:
    source = square(128.0, 8)  # 9 x 9 samples, 32 m apart
    half = sheet((-128.0, 16.0), (-128.0, 128.0), (2, 2))
    to_edge = sheet((-128.0, 32.0), (-128.0, 128.0), (2, 2))
    voids = square(128.0, 8, lambda x, y: np.where((x >= 64.0) & (y >= 0.0), np.nan, 0.0))
    above = from_above((0.0, 0.0, 512.0))
    # From 40 m above (-80, 0) the picture shows x from -120 to -40 alone.
    west = from_above((-80.0, 0.0, 40.0))
    return [
        Case(
            "half drawn: 4 of 9 columns are holes",
            source,
            (half,),
            above,
            {
                "hole_samples": 36,
                "measured_samples": 81,
                "measured_max": math.inf,
                "measured_rms": math.inf,
                "measured_px_max": math.inf,
            },
        ),
        # Columns x = 64, 96 and 128 remain: an edge covers the samples that it runs through.
        Case("drawn up to a column of samples", source, (to_edge,), above, {"hole_samples": 27}),
        Case("holes outside the frustum", source, (half,), west, {"hole_samples": 36, "measured_px_max": 0.0}),
        # 3 columns by 5 rows are void. Of the 36 holes the 15 voids are none.
        Case("voids are no holes", voids, (half,), above, {"hole_samples": 21, "measured_samples": 66}),
        Case(
            "a view that sees nothing",
            source,
            (square(128.0, 8, 2.0),),
            View((0.0, 0.0, 100.0), (0.0, 0.0, 200.0), up=(0.0, 1.0, 0.0), size=(SIDE, SIDE)),
            {
                "measured_px_max": math.nan,
                "measured_px_p99": math.nan,
                "measured_px_rms": math.nan,
                "crack_mask_share": math.nan,
                "measured_max": 2.0,
            },
        ),
    ]


def _predictions() -> list[Case]:
    """A plane with a spike of 4 m, drawn as one flat chunk: its stored bound is the spike."""
    source = square(32.0, 8, spike((8.0, 8.0), 4.0))
    s = math.sqrt(3.0)  # the longest ray to depth 1: sqrt(1 + tan^2 + tan^2), both tangents 1

    def case(name: str, view: View, projection: str, predicted: float, triangles: int = 2) -> Case:
        build = {"finest_error": 8.0, "leaf": 8}
        flat = Drawn(source, "chunked", build, {"projection": projection, "stream": False})
        values = {"measured_max": 4.0, "measured_rms": 4.0 / 9.0}
        values |= {"predicted_px": predicted, "drawn_triangles": triangles}
        return Case(f"flat chunk, {name}", source, (flat,), view, values)

    # The chunk spans [-32, 32] both ways, 0 to 4 m high.
    above, aside = from_above((0.0, 0.0, 104.0)), level((0.0, -132.0, 34.0))
    past = math.hypot(100.0, 30.0)
    # From above: the farthest corner is 32 sqrt(2) m aside, the nearest height 100 m below.
    flank = 32.0 * math.sqrt(2.0) / math.hypot(32.0 * math.sqrt(2.0), 100.0)
    return [
        # The nearest point that depth allows is D / s deep; 4 m nearer at the end of the displacement.
        case("strict, D = 100 m", above, "strict", K * 4.0 * s / (100.0 / s - 4.0)),
        case("strict, from aside", aside, "strict", K * 4.0 * s / (past / s - 4.0)),
        # D / s - 4 is nearer than the near plane: the path of the displacement ends there.
        case("strict, near plane", from_above((0.0, 0.0, 10.0), near=3.0), "strict", K * 4.0 * s / 3.0),
        # A vertical displacement shows by the cosine of the elevation at which it is seen.
        case("vertical", above, "vertical", K * 4.0 * s * flank / (100.0 / s - 4.0)),
        case("the paper's formula", above, "paper", K * 4.0 / 100.0),
        # Culled: nothing is drawn that a claim could be about.
        case("out of sight", level((0.0, 100.0, 50.0)), "strict", 0.0, triangles=0),
    ]


def _optimum() -> Case:
    """Two charts of 4 x 4 cells behind one another, the far one (y > 0) drawn at stride 2, the near one at stride 1.

    The near chart has a spike of 4 m that stride 2 leaves out. Both share a sample of 1 m at (-8, 0), which stride 2
    leaves out, too. 8 + 32 triangles are within the budget, 32 + 32 are not. So the best cut has an error of 1 m in
    the far chart, 64 m away. As drawn, the near chart's edge is stitched to the far one's: 1 m as well, 32 m away.
    """

    def z(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return spike((-8.0, 0.0), 1.0)(x, y) + spike((-8.0, -8.0), 4.0)(x, y)

    source = sheet((-16.0, 16.0), (-32.0, 32.0), (9, 5), z)
    options = {"chart": 4, "levels": 1}
    look = {"adapt": "exact", "projection": "paper", "stream": False}
    drawn = Drawn(source, "multigrain", options, look, budget={"triangles": 48})
    values = {"predicted_px": K * 1.0 / 32.0, "optimum_gap": 64.0 / 32.0 - 1.0, "measured_max": 1.0}
    return Case("stitched beyond the optimum", source, (drawn,), level((0.0, -64.0, 0.5)), values)


def sample_cases() -> list[Case]:
    return [
        *_level_bumps(),
        *_placed_bumps(),
        _pitched_bump(),
        *_bumps_from_above(),
        *_near_plane(),
        _hidden_bump(),
        _two_bumps(),
        *_slopes(),
        _curved(),
        _half_pixel(),
        *_layers(),
        *_holes(),
        *_predictions(),
        _optimum(),
    ]
