# SPDX-License-Identifier: MIT
"""The built-in paths as functions of t in 0 to 1: flyover, orbit, walk, zoom, still.

All are made from the field alone, deterministic, and stay above the drawn surface. Planets: local up.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .ground import Ground, Vec

EYE_HEIGHT = 1.7  # metres
NEAR_SHARE = 0.1  # of the clearance, or of the distance to the target where that is less
NEAR_MINIMUM = 0.1  # metres
_KNOTS = 1024
_PITCH = math.radians(25.0)


@dataclass(frozen=True)
class Pose:
    """Camera of one moment: points in source coordinates, degrees, near plane in source units."""

    eye: Vec
    target: Vec
    up: Vec
    fov: float | None = None
    near: float | None = None


PoseAt = Callable[[float], Pose]


def _pose(ground: Ground, eye: Vec, target: Vec) -> Pose:
    open_space = min(ground.clearance(eye), float(np.linalg.norm(target - eye)))
    near = max(NEAR_MINIMUM, NEAR_SHARE * open_space)
    return Pose(eye, target, ground.up(eye), near=near)


def _lifted(ground: Ground, eye: Vec, least: float) -> Vec:
    """The eye, raised where it is less than `least` above the surface below."""
    short = least - ground.clearance(eye)
    return eye + ground.up(eye) * short if short > 0.0 else eye


def _smooth_ceiling(values: np.ndarray, half: int) -> np.ndarray:
    """A smooth curve nowhere below the values: running maximum, then running mean of the same width."""
    padded = np.pad(values, 2 * half, mode="edge")
    top = np.lib.stride_tricks.sliding_window_view(padded, 2 * half + 1).max(axis=1)
    kernel = np.ones(2 * half + 1) / (2 * half + 1)
    return np.convolve(top, kernel, mode="valid")


def flyover(ground: Ground) -> PoseAt:
    """High and oblique, down in a curve to low over the highest relief; planets: from space to low orbit.

    Distance left and clearance shrink together, by the same factor in equal times.
    """
    goal = ground.highest_relief()
    extent = ground.extent
    high = 0.45 * extent
    low = 0.03 * ground.radius if ground.planet and extent > ground.radius else 0.008 * extent
    low = min(max(low, 2.0 * ground.spacing), 0.15 * extent)
    east, north = ground.offset(goal, ground.centre)
    azimuth = math.atan2(north, east) if math.hypot(east, north) > 0.05 * extent else -0.5 * math.pi
    length = min(0.62 * extent, 1.05 * ground.radius) if ground.planet else 0.62 * extent
    rate = math.log(high / low)

    def left(t: float) -> float:  # metres from the goal; ends at three times the clearance
        share = (math.exp(-rate * t) - math.exp(-rate)) / (1.0 - math.exp(-rate))
        return 3.0 * low + (length - 3.0 * low) * share

    def bearing(t: float) -> float:
        return azimuth + 0.9 * (t - 0.5) * (1.0 - 0.3 * t)

    def over(t: float, altitude: float) -> Vec:
        turn = bearing(t)
        return ground.place(goal, left(t) * math.cos(turn), left(t) * math.sin(turn), altitude)

    ts = np.linspace(0.0, 1.0, _KNOTS + 1)
    reach = [low + left(t) - left(min(1.0, t + 1.0 / _KNOTS)) for t in ts]
    tops = [float(ground.samples_near(over(t, 0.0), r).max()) for t, r in zip(ts, reach, strict=True)]
    base = _smooth_ceiling(np.array(tops), _KNOTS // 24)
    land = ground.samples_near(ground.place(goal, 0.0, 0.0, 0.0), 4.0 * low)
    surface = 0.5 * (float(land.mean()) + ground.surface(*goal))

    def target(t: float) -> Vec:
        """The goal, at the height of the land about its peak.

        Over a planet's horizon it is not seen: there a point on the way to it.
        """
        if not ground.planet:
            return ground.place(goal, 0.0, 0.0, surface)
        ahead, turn = 0.6 * (left(t) - left(1.0)), bearing(t)
        return ground.place(goal, ahead * math.cos(turn), ahead * math.sin(turn), surface)

    def at(t: float) -> Pose:
        altitude = float(np.interp(t, ts, base)) + high * math.exp(-rate * t)
        return _pose(ground, _lifted(ground, over(t, altitude), 0.5 * low), target(t))

    return at


def orbit(ground: Ground) -> PoseAt:
    """Once round: flat fields and patches on a circle above, looking at the middle; a planet on an
    inclined great circle, looking ahead and down."""
    whole = ground.planet and ground.core.wraps
    if not whole:
        middle = 0.5 * (ground.low + ground.high)
        target = ground.place(ground.centre, 0.0, 0.0, middle)
        ring, altitude = 0.65 * ground.extent, ground.high + 0.35 * ground.extent

        def round_the_middle(t: float) -> Pose:
            a = 2.0 * math.pi * t - 0.5 * math.pi
            eye = ground.place(ground.centre, ring * math.cos(a), ring * math.sin(a), altitude)
            return _pose(ground, _lifted(ground, eye, 0.05 * ground.extent), target)  # above an outlier

        return round_the_middle

    tilt = math.radians(30.0)
    away = ground.radius + ground.high + 0.3 * ground.radius
    ahead = math.radians(16.0)

    def direction(a: float) -> Vec:
        return np.array([math.cos(a), math.sin(a) * math.cos(tilt), math.sin(a) * math.sin(tilt)])

    def round_the_planet(t: float) -> Pose:
        a = 2.0 * math.pi * t
        return _pose(ground, direction(a) * away, direction(a + ahead) * ground.radius)

    return round_the_planet


def walk(ground: Ground) -> PoseAt:
    """At eye height, following the surface on a winding way towards the highest relief, looking ahead."""
    goal = ground.highest_relief()
    east, north = ground.offset(ground.centre, goal)
    heading = math.atan2(north, east) if math.hypot(east, north) > 0.02 * ground.extent else 0.5 * math.pi
    length = min(0.5 * ground.extent, 600.0 * ground.spacing, 0.3 * ground.radius if ground.planet else math.inf)
    away = math.hypot(east, north)
    begin = max(away - length, -0.5 * length) if away > length else -0.5 * length
    sway = 0.06 * length

    def over(s: float) -> Vec:
        along, aside = begin + s * length, sway * math.sin(4.0 * math.pi * s)
        c, n = math.cos(heading), math.sin(heading)
        return ground.place(ground.centre, along * c - aside * n, along * n + aside * c, 0.0)

    def at_eye_height(s: float) -> Vec:
        point = over(s)
        up = ground.up(point)
        for _ in range(2):  # once more: raised eyes of a planet round differently
            point = point + up * (EYE_HEIGHT - ground.clearance(point))
        return point

    def at(t: float) -> Pose:
        """Looks along the way, up and down with the ground 10 to 30 samples ahead, by 25 degrees at most."""
        eye = at_eye_height(t)
        up = ground.up(eye)
        forward = over(t + 1e-3) - over(t - 1e-3)
        forward -= up * float(forward @ up)
        forward /= np.linalg.norm(forward)
        slopes = []
        for samples in (10.0, 20.0, 30.0):
            ahead = at_eye_height(t + samples * ground.spacing / length) - eye
            slopes.append(float(ahead @ up) / max(float(np.linalg.norm(ahead)), 1e-9))
        pitch = min(max(math.asin(min(max(sum(slopes) / 3.0, -1.0), 1.0)) - 0.06, -_PITCH), _PITCH)
        return _pose(ground, eye, eye + (math.cos(pitch) * forward + math.sin(pitch) * up) * (10.0 * ground.spacing))

    return at


def zoom(ground: Ground) -> PoseAt:
    """From the whole source (at 60 degrees and 16:9) to one spot, by the same factor in equal times."""
    spot = ground.highest_relief()
    whole = ground.planet and ground.core.wraps
    far = 3.7 * (ground.radius + ground.high) if whole else 1.75 * ground.extent
    close = min(max(4.0 * ground.spacing, 3.0 * EYE_HEIGHT), 0.5 * far)
    rate = math.log(far / close)
    east, north = ground.offset(spot, ground.centre)
    elevation = math.radians(50.0)
    surface = ground.height_below(ground.place(spot, 0.0, 0.0, 0.0))
    on_spot = ground.place(spot, 0.0, 0.0, surface)

    def at(t: float) -> Pose:
        distance = far * math.exp(-rate * t)
        share = (distance - close) / (far - close)
        if whole:  # from the planet's centre up to the spot
            target, up = on_spot * (1.0 - share), ground.up(on_spot)
        else:
            target = ground.place(spot, east * share, north * share, surface)
            up = ground.up(target)
        eye = target + distance * (math.sin(elevation) * up + math.cos(elevation) * _south(ground, up))
        return _pose(ground, _lifted(ground, eye, 0.25 * min(distance, ground.extent)), target)

    return at


def _south(ground: Ground, up: Vec) -> Vec:
    if not ground.planet:
        return np.array([0.0, -1.0, 0.0])
    south = up * float(up[2]) - np.array([0.0, 0.0, 1.0])
    norm = float(np.linalg.norm(south))
    return south / norm if norm > 1e-9 else np.array([1.0, 0.0, 0.0])


def still(ground: Ground) -> PoseAt:
    """One view, on the way of the flyover."""
    pose = flyover(ground)(0.45)
    return lambda t: pose


BUILT_IN: dict[str, Callable[[Ground], PoseAt]] = {
    "flyover": flyover,
    "orbit": orbit,
    "walk": walk,
    "zoom": zoom,
    "still": still,
}
