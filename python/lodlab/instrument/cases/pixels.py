# SPDX-License-Identifier: MIT
"""Cases over pixels: errors and jumps seen from straight above, and pictures of one colour.

Straight above level ground, D below the eye, a pixel r from the middle shows the point r D / K off the axis.
Drawn h higher, that point is seen r D / (D - h) from the middle: it moves by r h / (D - h) pixels.
"""

from __future__ import annotations

import math

import numpy as np

from ...sources.heightfield import HeightField
from ..metrics import METRICS
from .case import SIDE, Case, K, from_above, level, nearest_rank, pixel_offsets, rms, sheet, spike, square

UP = 128.0
ABOVE = from_above((0.0, 0.0, UP))
GROUND = square(192.0, 8)  # 48 m apart; the farthest sample in the frustum is (96, 96)
RIGHT, HIGHER = pixel_offsets()
FROM_MIDDLE = np.hypot(RIGHT, HIGHER)
FARTHEST = 96.0 * math.sqrt(2.0)


def _raised(h: float, up: float = UP) -> np.ndarray:
    """(256, 256) pixels by which ground drawn h higher moves."""
    return FROM_MIDDLE * abs(h) / (up - h)


def _errors() -> list[Case]:
    cases = []
    for name, h in (("8 m too high", 8.0), ("8 m too low", -8.0), ("1/64 m too high", 1.0 / 64.0)):
        # Mean of r^2 over a grid of n x n pixels round the middle: 2 (n^2 - 1) / 12.
        mean_square = 2.0 * (SIDE**2 - 1) / 12.0
        values = {
            "measured_px_rms": math.sqrt(mean_square) * abs(h) / (UP - h),
            "measured_px_p99": nearest_rank(_raised(h)),
            "measured_px_max": FARTHEST * abs(h) / (UP - h),
            "measured_max": abs(h),
            "measured_rms": abs(h),
        }
        cases.append(Case(f"level ground, drawn {name}", GROUND, (square(192.0, 4, h),), ABOVE, values))
    return cases


def _tilted() -> Case:
    # Drawn z = x / 16 over ground at 0: at a pixel u right of the middle, x = u metres.
    z = RIGHT / 16.0
    moved = FROM_MIDDLE * np.abs(z) / (UP - z)
    values = {"measured_px_rms": rms(moved), "measured_px_p99": nearest_rank(moved)}
    return Case("level ground, drawn tilted", GROUND, (square(192.0, 4, lambda x, y: x / 16.0),), ABOVE, values)


def _tents() -> list[Case]:
    # One sample drawn 16 m too high: 1 at the sample, 0 at its neighbours 48 m off, linear in every triangle. Cell
    # (row, column) is cut from its first corner where row + column is even: so eight triangles meet at samples
    # whose row + column is even, and the tent's level sets are squares; elsewhere four, and they are diamonds.
    def case(name: str, at: float, distance: np.ndarray) -> Case:
        z = 16.0 * np.maximum(1.0 - distance / 48.0, 0.0)
        moved = FROM_MIDDLE * z / (UP - z)
        values = {
            "measured_px_rms": rms(moved),
            "measured_px_p99": nearest_rank(moved),
            "pop_area": float(np.mean(moved > 1.0)),
        }
        return Case(name, GROUND, (square(192.0, 8, spike((at, 0.0), 16.0)),), ABOVE, values, before=(GROUND,))

    return [
        case("level ground, a tent over a square", 0.0, np.maximum(np.abs(RIGHT), np.abs(HIGHER))),
        case("level ground, a tent over a diamond", 48.0, np.abs(RIGHT - 48.0) + np.abs(HIGHER)),
    ]


def _few_pixels() -> list[Case]:
    # Of 20 x 20 pixels 99 % is 396, all but the four corners; of 18 x 18 it is 320.76: the 321st, a corner.
    cases = []
    for side, right, up in ((20, 9.5, 8.5), (18, 8.5, 8.5)):
        view = from_above((0.0, 0.0, UP), size=(side, side))
        values = {"measured_px_p99": math.hypot(right, up) * 8.0 / (UP - 8.0)}
        cases.append(Case(f"level ground, {side} x {side} pixels", GROUND, (square(192.0, 4, 8.0),), view, values))
    return cases


def _wide() -> Case:
    # 320 x 200 pixels, 60 degrees across, from 100 m above.
    right, higher = pixel_offsets(320, 200)
    moved = np.hypot(right, higher) * 4.0 / (100.0 - 4.0)
    view = from_above((0.0, 0.0, 100.0), fov=60.0, size=(320, 200))
    values = {
        "measured_px_rms": math.sqrt((320**2 - 1 + 200**2 - 1) / 12.0) * 4.0 / 96.0,
        "measured_px_p99": nearest_rank(moved),
    }
    return Case("level ground, 60 deg across 320 x 200 pixels", GROUND, (square(192.0, 4, 4.0),), view, values)


def _grazing() -> Case:
    # Level, 8 m up. The row v below the horizon shows ground K 8 / v away; h higher it rises by
    # K h / (K 8 / v) = v h / 8. Ground ends 256 m away, at v = 4: rows v = 4.5 to 127.5 are covered.
    v = np.arange(4, 128) + 0.5
    moved = np.repeat(v * 0.5 / 8.0, SIDE)
    ground = sheet((-320.0, 320.0), (-64.0, 256.0), (9, 9))
    raised = sheet((-320.0, 320.0), (-64.0, 256.0), (3, 3), 0.5)
    values = {
        "measured_px_rms": rms(moved),
        "measured_px_p99": nearest_rank(moved),
        "measured_px_max": K * 0.5 / 16.0,  # the nearest row in the frustum: y = 16
    }
    return Case("level ground, grazing from 8 m up", ground, (raised,), level((0.0, 0.0, 8.0)), values)


def _holes() -> list[Case]:
    # Columns x <= 0 and x <= 144 are drawn, x = 48 m apart. A pixel whose triangle touches a sample without
    # surface is a hole: more than 1 % of them is an infinite 99th percentile; none is in the frustum beyond 144.
    cases = []
    for name, end, value in (("half of it holes", 0.0, math.inf), ("holes out of sight", 144.0, 0.0)):
        drawn = sheet((-192.0, end), (-192.0, 192.0), (2, 2))
        values = {"measured_px_p99": value, "measured_px_rms": value, "measured_px_max": value}
        cases.append(Case(f"level ground, {name}", GROUND, (drawn,), ABOVE, values))
    # Samples 1 m apart: drawn up to x = 126.5, the triangles of the last two columns of pixels (0.8 %) touch
    # samples without surface; up to 125.5, those of the last three (1.2 %).
    fine = sheet((-192.0, 192.0), (-192.0, 192.0), (9, 385))
    for end, value in ((126.5, 0.0), (125.5, math.inf)):
        drawn = sheet((-192.0, end), (-192.0, 192.0), (2, 2))
        values = {"measured_px_p99": value, "measured_px_rms": math.inf}
        cases.append(Case(f"level ground, {128.5 - end:g} columns of pixels holes", fine, (drawn,), ABOVE, values))
    return cases


def _pops() -> list[Case]:
    low = square(192.0, 4)

    def jump(name: str, before: float, after: float) -> Case:
        # Ground at 0 seen in both cuts: from r D / (D - before) to r D / (D - after) pixels.
        per_pixel = abs(UP / (UP - after) - UP / (UP - before))
        values = {
            "pop_px_max": FARTHEST * per_pixel,
            "pop_area": float(np.mean(FROM_MIDDLE * per_pixel > 1.0)),
        }
        drawn, earlier = square(192.0, 4, after), square(192.0, 4, before)
        return Case(name, GROUND, (drawn,), ABOVE, values, before=(earlier,))

    half = sheet((-192.0, 0.0), (-192.0, 192.0), (2, 2))
    # Only the left half was there: samples and pixels with x <= 0 can jump, and all their triangles are covered.
    appears = Case(
        "half of the ground appears, the rest jumps by 2 m",
        GROUND,
        (square(192.0, 4, 2.0),),
        ABOVE,
        {
            "pop_px_max": FARTHEST * 2.0 / 126.0,
            "pop_area": float(np.mean(_raised(2.0)[RIGHT < 0.0] > 1.0)),
            "measured_px_max": FARTHEST * 2.0 / 126.0,
        },
        before=(half,),
    )
    # One sample, 48 m right of the axis, was 4 m higher.
    at = (48.0, 0.0)
    bump = Case(
        "a bump vanishes",
        GROUND,
        (low,),
        ABOVE,
        {"pop_px_max": K * 48.0 * (1.0 / (UP - 4.0) - 1.0 / UP), "measured_px_max": 0.0},
        before=(square(192.0, 8, spike(at, 4.0)),),
    )
    first = Case("the first frame of a run", GROUND, (low,), ABOVE, {"pop_px_max": math.nan, "pop_area": math.nan})
    return [
        jump("a still surface", 0.0, 0.0),
        jump("a still surface, both 4 m too high", 4.0, 4.0),
        jump("ground rises by 2 m", 0.0, 2.0),
        jump("ground rises from 2 m too low to 2 m too high", -2.0, 2.0),
        jump("ground sinks by 1/8 m, nowhere a pixel", 0.125, 0.0),
        appears,
        bump,
        first,
    ]


# Colours of level ground at the ends and the first quarter of the land's ramp: light is 1 there.
LOW, QUARTER, HIGH = ((0.40, 0.58, 0.38), (0.68, 0.75, 0.49), (0.95, 0.94, 0.93))


def _eight_bit(color: tuple[float, ...]) -> np.ndarray:
    return np.array([math.floor(255.0 * c + 0.5) for c in color], dtype=float)


def _plateau(z: float, x: tuple[float, float] = (-192.0, 192.0)) -> HeightField:
    """Ground at z whose colours span 0 to 10 m: two samples out of sight are at the ends."""

    def height(xs: np.ndarray, ys: np.ndarray) -> np.ndarray:
        out = np.full(xs.shape, z)
        out[0, 0], out[-1, 0] = 0.0, 10.0
        return out

    return sheet(x, (-256.0, 256.0), (9, 9), height)


def _psnr(a: np.ndarray, b: np.ndarray, share: float = 1.0) -> float:
    """Of two pictures of one colour each, where `share` of the pixels differ."""
    return 10.0 * math.log10(255.0**2 / (share * float(np.mean((a - b) ** 2))))


def _ssim(a: np.ndarray, b: np.ndarray) -> float:
    """Wang et al. 2004 without variance: (2 a b + C1) / (a^2 + b^2 + C1), C1 = (0.01 * 255)^2; mean of channels."""
    c1 = (0.01 * 255.0) ** 2
    return float(np.mean((2.0 * a * b + c1) / (a**2 + b**2 + c1)))


def _ssim_step(a: np.ndarray, b: np.ndarray) -> float:
    """SSIM of a picture of colour a with one whose right half is b: means over windows that the border does not cut.

    Where a window has the share w of its weight (Gaussian, sigma 1.5, 11 pixels) right of the step, the second
    picture's mean is m = a + w (b - a), its variance w (1 - w) (b - a)^2, and the covariance is 0.
    """
    c1, c2 = (0.01 * 255.0) ** 2, (0.03 * 255.0) ** 2
    weights = np.exp(-0.5 * (np.arange(-5, 6) / 1.5) ** 2)
    weights /= weights.sum()
    columns = np.arange(5, SIDE - 5)
    w = np.array([weights[c + np.arange(-5, 6) >= SIDE // 2].sum() for c in columns])[:, None]
    mean, variance = a + w * (b - a), w * (1.0 - w) * (b - a) ** 2
    return float(np.mean((2.0 * a * mean + c1) * c2 / ((a**2 + mean**2 + c1) * (variance + c2))))


def _hunt_lab(srgb: np.ndarray) -> np.ndarray:
    """L*, a*, b* of a colour, chroma scaled by L* / 100 (the Hunt effect); sRGB's primaries and white D65."""
    linear = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
    xy = np.array([[0.64, 0.33], [0.30, 0.60], [0.15, 0.06]])
    primaries = np.column_stack([xy, 1.0 - xy.sum(axis=1)]).T / xy[:, 1]  # XYZ of each, Y = 1
    white = np.array([0.3127, 0.3290, 1.0 - 0.3127 - 0.3290]) / 0.3290
    t = (primaries * np.linalg.solve(primaries, white)) @ linear / white
    f = np.where(t > (6.0 / 29.0) ** 3, np.cbrt(t), t / (3.0 * (6.0 / 29.0) ** 2) + 4.0 / 29.0)
    lightness = 116.0 * f[1] - 16.0
    chroma = 0.01 * lightness * np.array([500.0 * (f[0] - f[1]), 200.0 * (f[1] - f[2])])
    return np.array([lightness, *chroma])


def _hyab(a: np.ndarray, b: np.ndarray) -> float:
    """HyAB distance of two colours, to the power 0.7."""
    d = _hunt_lab(a) - _hunt_lab(b)
    return float((abs(d[0]) + math.hypot(d[1], d[2])) ** 0.7)


def _flip(a: np.ndarray, b: np.ndarray) -> float:
    """FLIP of two pictures of one colour each (Andersson et al. 2020): no features, and filters change nothing.

    The colour difference, redistributed: up to 0.4 of the largest one (green to blue) maps to 0 to 0.95.
    """
    largest = _hyab(np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0]))
    error, knee = _hyab(a / 255.0, b / 255.0), 0.4 * largest
    if error < knee:
        return 0.95 / knee * error
    return 0.95 + (error - knee) / (largest - knee) * 0.05


def _pictures() -> list[Case]:
    def case(name: str, z: float, a: np.ndarray, b: np.ndarray) -> Case:
        values = {"psnr_db": _psnr(a, b), "ssim": _ssim(a, b), "flip": _flip(a, b)}
        return Case(name, _plateau(0.0), (_plateau(z),), ABOVE, values)

    low, quarter, high = (_eight_bit(color) for color in (LOW, QUARTER, HIGH))
    left, right = _plateau(0.0, (-192.0, 0.0)), _plateau(10.0, (0.0, 192.0))
    return [
        Case("equal pictures", _plateau(0.0), (_plateau(0.0),), ABOVE, {"psnr_db": math.inf, "ssim": 1.0, "flip": 0.0}),
        case("valley drawn as a summit", 10.0, low, high),
        case("valley drawn as a slope's foot", 2.5, low, quarter),
        # Many pixels: sums of floats would be 1 % off.
        Case(
            "a slope's foot, 1280 x 720 pixels",
            _plateau(0.0),
            (_plateau(2.5),),
            from_above((0.0, 0.0, UP), size=(1280, 720)),
            {"psnr_db": _psnr(low, quarter), "flip": _flip(low, quarter)},
        ),
        # x = 0 is the border of columns 127 and 128.
        Case(
            "half of the picture differs",
            _plateau(0.0),
            (left, right),
            ABOVE,
            {"psnr_db": _psnr(low, high, 0.5), "ssim": _ssim_step(low, high)},
        ),
    ]


def _itself() -> list[Case]:
    hills = square(192.0, 64, lambda x, y: 8.0 * np.sin(x / 17.0) * np.cos(y / 11.0))
    nothing = {metric.name: 0.0 for metric in METRICS}
    whole = {"psnr_db": math.inf, "ssim": 1.0, "crack_mask_share": 1.0, "optimum_gap": math.nan}  # `full` knows none
    counts = {"measured_samples": 65 * 65, "drawn_triangles": 2 * 64 * 64}
    one_way = {name: math.nan for name in nothing if name.endswith(("_to_drawn", "_to_source"))}
    return [Case("hills drawn as they are", hills, (hills,), ABOVE, nothing | whole | counts | one_way, (hills,))]


def pixel_cases() -> list[Case]:
    return [
        *_itself(),
        *_errors(),
        _tilted(),
        *_tents(),
        *_few_pixels(),
        _wide(),
        _grazing(),
        *_holes(),
        *_pops(),
        *_pictures(),
    ]
