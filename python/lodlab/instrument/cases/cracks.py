# SPDX-License-Identifier: MIT
"""Cases of cracks, silhouettes and winding.

From 128 m above the origin one metre of level ground at height 0 is one pixel of 256, x = 0 between the
columns 127 and 128, and every picture shows ground alone unless a case says so.
"""

from __future__ import annotations

import math

import numpy as np

from ..._core import View
from ...sources.heightfield import HeightField
from .case import SIDE, Case, Drawn, ball, from_above, level, pixel_offsets, sheet, spike, square

UP = 128.0
ABOVE = from_above((0.0, 0.0, UP))
GROUND = square(192.0, 6)
REACH = (-192.0, 192.0)
MARGIN = 6  # pixels round a picture that are drawn to see what ends there
FARTHEST = math.sqrt(2.0) * (0.5 * SIDE + MARGIN - 0.5)  # of a pixel's centre from the picture's, pixels


def _off(z: float) -> float:
    """By how much the farthest pixel sees level ground off that is drawn z metres too high."""
    return FARTHEST * abs(z) / (UP - z)


def _within(radius: float, ends: int | None = None) -> int:
    """Columns (or rows) of a picture, of ground as far as column `ends`, that a disc of this radius leaves."""
    return sum(
        min(c + MARGIN + 1, SIDE + MARGIN - c if ends is None else ends - c) > radius for c in range(ends or SIDE)
    )


def _halves(name: str, left: float, right: float, edges: int, pixels: int) -> Case:
    """Two halves of the ground: up to x = left, and from x = right on; samples at -64, 0, 64 are drawn."""
    drawn = (sheet((-192.0, left), REACH, (2, 2)), sheet((right, 192.0), REACH, (2, 2)))
    holes = {"hole_samples": 0, "measured_samples": 49, "crack_mask_share": 1.0}
    return Case(name, GROUND, drawn, ABOVE, {"crack_edges": edges, "crack_pixels": pixels, **holes})


def _gaps() -> list[Case]:
    # The pixel centres between the halves are those of columns 128.5 + i with left < i + 0.5 < right.
    return [
        _halves("two halves, a gap of 3 pixels", 0.0, 3.0, 2, 3 * SIDE),
        _halves("two halves, a gap of 0.3 pixel between centres", 0.0, 0.3, 2, 0),
        _halves("two halves, a gap of 0.1 pixel on centres", 0.45, 0.55, 2, SIDE),
        _halves("two halves that meet", 0.0, 0.0, 0, 0),
        # They overlap by a metre: nothing is to be seen, and no edge matches.
        _halves("two halves that overlap", 1.0, 0.0, 2, 0),
    ]


def _steps() -> list[Case]:
    # The right half stands 8 m higher. Seen from 32 m left of the edge, its foot is at pixel
    # 128 + 32 = 160 and its brink at 128 + 128 * 32 / 120 = 162.13: columns 160 and 161 are clear.
    # From the right the brink hides the foot. In both the right half fills a corner, off by more than the margin.
    drawn = (sheet((-256.0, 0.0), (-256.0, 256.0), (2, 2)), sheet((0.0, 256.0), (-256.0, 256.0), (2, 2), 8.0))
    rows = _within(1.0 + _off(8.0))
    return [
        Case(
            f"vertical step of 8 m, seen from {where}",
            square(256.0, 8),
            drawn,
            from_above((x, 0.0, UP)),
            {"crack_edges": 2, "crack_pixels": pixels, "measured_max": 8.0, "hole_samples": 0},
        )
        for where, x, pixels in (("below", -32.0, 2 * rows), ("above", 32.0, 0))
    ]


def _junctions() -> list[Case]:
    coarse = sheet((-256.0, 0.0), (-256.0, 256.0), (2, 2))
    fine = sheet((0.0, 256.0), (-256.0, 256.0), (3, 2))
    raised = sheet((0.0, 256.0), (-256.0, 256.0), (3, 2), spike((0.0, 0.0), 16.0))
    # Seen from 32 m left, the raised vertex is at pixel 128 + 128 * 32 / 112 = 164.57, the line's ends at
    # 160, rows -128 and 384: between them and the straight coarse edge lies a clear triangle. A centre u
    # right of the line is in it when its row is nearer to the middle than 256 (1 - u / 4.57).
    width = UP * 32.0 / 112.0 - 32.0
    u, v = np.meshgrid(np.arange(8) + 0.5, np.arange(SIDE) + 0.5 - 0.5 * SIDE)
    # The raised half is off by 16 (1 - (x + |y|) / 256) metres: more pixels than the margin is wide.
    right, up = pixel_offsets(SIDE + 2 * MARGIN, SIDE + 2 * MARGIN)
    deviation = np.where(right > 32.0, 16.0 * (1.0 - (right - 32.0 + np.abs(up)) / 256.0), 0.0)
    rows = _within(1.0 + float(np.max(np.hypot(right, up) * deviation / (UP - deviation))))
    clear = int(np.count_nonzero(np.abs(v) < np.minimum(256.0 * (1.0 - u / width), 0.5 * rows)))
    ground = square(256.0, 8)
    return [
        Case(
            "T-junction, one coarse edge on two fine ones",
            ground,
            (coarse, fine),
            ABOVE,
            {"crack_edges": 3, "crack_pixels": 0, "measured_max": 0.0},
        ),
        Case(
            "T-junction with its vertex 16 m too high",
            ground,
            (coarse, raised),
            from_above((-32.0, 0.0, UP)),
            {"crack_edges": 3, "crack_pixels": clear, "measured_max": 16.0},
        ),
    ]


def _doubled() -> Case:
    # 2 x 3 samples: a middle edge and two diagonals inside, each twice in each direction.
    one = sheet(REACH, REACH, (2, 3))
    return Case("drawn twice", GROUND, (one, one), ABOVE, {"crack_edges": 12, "crack_pixels": 0, "measured_max": 0.0})


def _insides() -> list[Case]:
    # Level, 16 m up: ground from y = 32 to 256 shows from row 128 + 128 * 16 / 256 = 136 to 128 + 64 = 192. In front
    # of it, where the source has no sample and not over the eye, a slope falls whose underside fills all rays.
    ground = sheet((-320.0, 320.0), (32.0, 256.0), (8, 11))
    slope = sheet((-8192.0, 8192.0), (2.0, 16.0), (2, 2), lambda x, y: 1000.0 - 143.0 * (y - 2.0))
    rows = sum(min(row - 135, 192 - row) > 1.0 for row in range(136, 192))
    inside = Case(
        "the inside of the surface, seen instead of ground",
        ground,
        (ground, slope),
        level((0.0, 0.0, 16.0)),
        {"crack_pixels": rows * SIDE, "crack_mask_share": rows / 56.0, "inverted_triangles": 0},
    )
    # From below the ground shows its inside alone: there is no outside to look for cracks in.
    gap = (sheet((-192.0, 0.0), REACH, (2, 2)), sheet((3.0, 192.0), REACH, (2, 2)))
    up = View((0.0, 0.0, -UP), (0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0), fov=90.0, size=(SIDE, SIDE))
    below = Case("a gap seen from below", GROUND, gap, up, {"crack_pixels": math.nan, "crack_mask_share": 0.0})
    return [inside, below]


def _strip(z: float) -> HeightField:
    return sheet((-192.0, 72.0), REACH, (9, 5), z)


def _silhouettes() -> list[Case]:
    # Ground that ends at x = 72, pixel 200, in every row. Drawn 16 m too low it ends 8 pixels earlier, drawn 8 m
    # too high 4.8 later: within what is not looked at, which is as wide as the farthest pixel's error.
    def case(name: str, z: float) -> Case:
        radius = 1.0 + _off(z)
        share = _within(radius, 200) * _within(radius) / (200.0 * SIDE)
        # The farthest sample in the frustum is (-126, 96).
        measured = math.hypot(126.0, 96.0) * abs(z) / (UP - z)
        cracks = 0 if share >= 0.1 else math.nan
        values = {"measured_px_max": measured, "crack_mask_share": share, "crack_pixels": cracks}
        return Case(name, _strip(0.0), (_strip(z),), ABOVE, values)

    return [
        case("silhouette, drawn as it is", 0.0),
        case("silhouette, drawn 2 m too high", 2.0),
        case("silhouette, drawn 2 m too low", -2.0),
        case("silhouette, drawn 8 m too high", 8.0),
        case("silhouette, drawn 16 m too low", -16.0),
        case("silhouette, off by so much that nothing is decided", -112.0),
    ]


def _diagonal() -> list[Case]:
    # The same strip under a camera turned by 45 degrees: a pixel u right and v up of the middle shows
    # x = (u + v) / sqrt(2), so ground ends between u + v = 101 and 102. A pixel is m = 102 - (u + v) steps from
    # the staircase; the nearest clear centre is floor(m / 2) one way and ceil(m / 2) the other.
    view = from_above((0.0, 0.0, UP), up=(1.0, 1.0, 0.0))
    right, up = pixel_offsets()
    steps = 102 - (right + up)[right + up < 102]
    away = np.floor(steps / 2.0) ** 2 + np.ceil(steps / 2.0) ** 2
    x, y = np.meshgrid(np.linspace(-192.0, 72.0, 5), np.linspace(*REACH, 9))
    seen = np.maximum(np.abs(x - y), np.abs(x + y)) < UP * math.sqrt(2.0)
    farthest = float(np.hypot(x, y)[seen].max())
    cases = []
    for name, z in (("as it is", 0.0), ("2 m too high", 2.0)):
        pixels = farthest * z / (UP - z)
        share = float(np.mean(away > (1.0 + _off(z)) ** 2))
        values = {"measured_px_max": pixels, "crack_mask_share": share, "crack_pixels": 0}
        cases.append(Case(f"diagonal silhouette, drawn {name}", _strip(0.0), (_strip(z),), view, values))
    return cases


def _unknown_voids() -> Case:
    # What is drawn leaves out the cells round its voids: a quarter of the picture. Its capture is drawn again with
    # the source's voids, and there are none: so many pixels are not what was drawn.
    drawn = square(192.0, 8, lambda x, y: np.where((x > 0.0) & (y > 0.0), np.nan, 0.0))
    values = {"capture_mismatch_pixels": (SIDE // 2) ** 2, "crack_edges": 0}
    return Case("voids that the capture does not know of", GROUND, (drawn,), ABOVE, values)


def _winding() -> list[Case]:
    # A ball is no height field seen from above: its southern half shows its inside to the sky. 7 rows of 12:
    # two bands of 24 triangles and one of 12 at the pole.
    over = Case(
        "a ball in the sky",
        GROUND,
        (GROUND, ball(50.0, 7, 12)),
        ABOVE,
        {
            "inverted_triangles": 60,
            "capture_mismatch_pixels": 0,
            "slanted_filler_triangles": 0,
            "drawn_triangles": 72 + 120,
        },
    )
    # On a ball up is away from the centre: above the north pole a level sheet shows its outside, below the
    # south pole its inside. Two triangles each.
    earth = ball(1000.0, 37, 72)
    poles = Case(
        "level sheets above both poles of a ball",
        earth,
        (earth, square(50.0, 1, 1100.0), square(50.0, 1, -1100.0)),
        View((3000.0, 0.0, 0.0), (0.0, 0.0, 0.0), fov=90.0, size=(SIDE, SIDE)),
        {"inverted_triangles": 2, "crack_edges": 8},
    )
    return [over, poles]


def _chunks(x: float, y: float, z: float, spike: float) -> Drawn:
    """Four chunks of 4 x 4 cells round (x, y), level at z but for one sample, `spike` above it.

    They meet in a cross of four arms. Round a sample that stands out every sample is drawn, so the north-western
    chunk is split down to its middle ring, and nesting splits its two arms in halves: 6 segments, each with a
    skirt of two triangles from either side. A range of 60 km makes the quantum of heights a metre and skirts a
    few, well beyond rounding.
    """

    def height(xs: np.ndarray, ys: np.ndarray) -> np.ndarray:
        out = np.full(xs.shape, z)
        out[2, 2] += spike
        return out

    field = sheet((x - 32.0, x + 32.0), (y - 32.0, y + 32.0), (9, 9), height)
    return Drawn(field, "chunked", {"leaf": 4}, {"stream": False}, nodes=(1, 2, 3, 4))


def _skirts() -> list[Case]:
    earth = ball(1000.0, 37, 72)
    flat = _chunks(0.0, 0.0, 0.0, 60000.0)
    # At latitude 0 and longitude 45 of a ball, z lies along the ground, and so do skirts, which hang along z.
    at = 1000.0 / math.sqrt(2.0)
    aside = View((3000.0, 3000.0, 0.0), (0.0, 0.0, 0.0), fov=90.0, size=(SIDE, SIDE))
    # Below its south pole they hang away from the ball: all rise above the chunks that they hang from.
    under = (earth, _chunks(0.0, 0.0, -1100.0, -60000.0))
    below = View((3000.0, 0.0, 0.0), (0.0, 0.0, 0.0), fov=90.0, size=(SIDE, SIDE))
    nothing = {"slanted_filler_triangles": 0, "raised_filler_triangles": 0, "inverted_triangles": 0}
    return [
        Case(
            "upright skirts on the flank of a ball",
            earth,
            (earth, _chunks(at, at, 0.0, 60000.0)),
            aside,
            {"slanted_filler_triangles": 24},
        ),
        Case("skirts below the south pole of a ball", earth, under, below, {"raised_filler_triangles": 24}),
        Case("upright skirts on a plane", flat.field, (flat,), from_above((0.0, 0.0, 70000.0)), nothing),
    ]


def crack_cases() -> list[Case]:
    return [
        *_gaps(),
        *_steps(),
        *_junctions(),
        _doubled(),
        *_insides(),
        *_silhouettes(),
        *_diagonal(),
        _unknown_voids(),
        *_winding(),
        *_skirts(),
    ]
