# SPDX-License-Identifier: MIT
"""Where the control points of a mesh are at path time t: what deforms it while it is flown round.

`bend`, `twist` and `wave` are functions of t, 0 to 1, and of the control points at rest, (V, 3) float64 in source units
(`Store.control_positions`), and return where they go, (V, 3). They are smooth in both, scale with the box round the
points, and are at rest at t = 0. A function of one's own has the same arguments.
"""

from __future__ import annotations

import hashlib
import math
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InvalidInput

DeformAt = Callable[[float, np.ndarray], Any]

__all__ = ["NAMES", "Deformation", "bend", "twist", "wave"]


def _axes(rest: np.ndarray) -> tuple[np.ndarray, float, int, int, int]:
    """(points about the middle of their box, its longest side, the axes of its longest, middle and shortest sides)."""
    low, high = rest.min(axis=0), rest.max(axis=0)
    short, middle, long = np.argsort(high - low, kind="stable").tolist()
    return rest - 0.5 * (low + high), float((high - low)[long]), long, middle, short


def bend(t: float, rest: np.ndarray) -> np.ndarray:
    """The longest side bends towards the shortest, at t = 1 to a quarter of a circle as long as it was."""
    points, length, long, _, short = _axes(rest)
    along, aside = points[:, long], points[:, short]
    angle = (0.5 * math.pi * t / length) * along
    out = rest.copy()
    out[:, long] += along * (np.sinc(angle / math.pi) - 1.0) - aside * np.sin(angle)
    half = 0.5 * angle
    out[:, short] += aside * (np.cos(angle) - 1.0) + along * np.sin(half) * np.sinc(half / math.pi)
    return out


def twist(t: float, rest: np.ndarray) -> np.ndarray:
    """About the longest side, at t = 1 by a quarter turn from end to end."""
    points, length, long, middle, short = _axes(rest)
    angle = (0.5 * math.pi * t / length) * points[:, long]
    sine, less = np.sin(angle), np.cos(angle) - 1.0
    out = rest.copy()
    out[:, middle] += points[:, middle] * less - points[:, short] * sine
    out[:, short] += points[:, short] * less + points[:, middle] * sine
    return out


def wave(t: float, rest: np.ndarray) -> np.ndarray:
    """Two waves run along the longest side, across the shortest, and grow to a twentieth of the former."""
    points, length, long, _, short = _axes(rest)
    out = rest.copy()
    out[:, short] += 0.05 * t * length * np.sin(2.0 * math.pi * (2.0 * points[:, long] / length - 2.0 * t))
    return out


_BUILT_IN: dict[str, DeformAt] = {"bend": bend, "twist": twist, "wave": wave}
NAMES = tuple(_BUILT_IN)


class Deformation:
    """What deforms a mesh along a path: `at(t, rest)` is where its control points are."""

    def __init__(self, name: str, at: DeformAt, poses: np.ndarray | None = None) -> None:
        self.name = re.sub(r"[^A-Za-z0-9._-]+", "_", name).strip("._") or "deform"
        self.poses = poses  # (F, V, 3) where it is an array, else None
        self._at = at

    @classmethod
    def of(cls, value: Any) -> Deformation:
        """From itself; `bend`, `twist`, `wave`; a .npy file or an array, (F, V, 3) for equal steps of t, straight
        between them, or (V, 3) for one pose; or a function of t and the points at rest. InvalidInput for others."""
        if isinstance(value, Deformation):
            return value
        if isinstance(value, (str, os.PathLike)):
            text = os.fspath(value)
            if text in _BUILT_IN:
                return cls(text, _BUILT_IN[text])
            if not text.lower().endswith(".npy"):
                raise InvalidInput(f"deform: '{text}' is none of {', '.join(NAMES)} and no .npy file")
            return cls._of_array(Path(text).stem, _load(text), text)
        if callable(value):
            return cls(getattr(value, "__name__", "deform"), value)
        return cls._of_array("poses", value, "array")

    @classmethod
    def _of_array(cls, name: str, value: Any, what: str) -> Deformation:
        try:
            poses = np.asarray(value, dtype=np.float64)
        except (TypeError, ValueError):
            raise InvalidInput(f"deform: {what} is {type(value).__name__}, no array of numbers") from None
        if poses.ndim == 2:
            poses = poses[None]
        if poses.ndim != 3 or poses.shape[2] != 3 or not poses.size:
            raise InvalidInput(f"deform: {what} is {np.shape(value)}, not (F, V, 3) or (V, 3)")
        if not np.isfinite(poses).all():
            frame, vertex = np.argwhere(~np.isfinite(poses).all(axis=2))[0].tolist()
            raise InvalidInput(f"deform: {what} is not finite at pose {frame}, control point {vertex}")

        def at(t: float, rest: np.ndarray) -> np.ndarray:
            whole, part = divmod(t * (len(poses) - 1), 1.0)
            first = poses[int(whole)]
            return first if part == 0.0 else (1.0 - part) * first + part * poses[int(whole) + 1]

        return cls(name, at, poses)

    def at(self, t: float, rest: np.ndarray) -> np.ndarray:
        """(V, 3) float64: the control points at t. InvalidInput for another shape, and for what is not finite."""
        found = self._at(t, rest)
        try:
            points = np.asarray(found, dtype=np.float64)
        except (TypeError, ValueError):
            raise InvalidInput(f"deform {self.name}: at t = {t:g} it is {type(found).__name__}, no array") from None
        if points.shape != rest.shape:
            raise InvalidInput(f"deform {self.name}: at t = {t:g} it is {points.shape}, not {rest.shape}")
        if not np.isfinite(points).all():
            bad = int(np.argmin(np.isfinite(points).all(axis=1)))
            raise InvalidInput(f"deform {self.name}: at t = {t:g} control point {bad} is not finite")
        return points

    def sampled(self, rest: np.ndarray, frames: int) -> Deformation:
        """The same as an array of its frames, where it is a function that no other process could know."""
        if self.name in _BUILT_IN or self.poses is not None:
            return self
        poses = [self.at(f / (frames - 1) if frames > 1 else 0.0, rest) for f in range(frames)]
        return self._of_array(self.name, np.stack(poses), self.name)

    def hash(self) -> str:
        """32 hex digits of its name or array. InvalidInput for a function: `sampled` makes an array of it."""
        if self.name not in _BUILT_IN and self.poses is None:
            raise InvalidInput(f"deform {self.name}: a function has no hash; give its poses as an array, (F, V, 3)")
        data = self.name.encode() if self.poses is None else self.poses.tobytes()
        return hashlib.blake2b(data, digest_size=16).hexdigest()

    def __repr__(self) -> str:
        return f"<lodlab deformation {self.name}>"


def _load(file: str) -> np.ndarray:
    try:
        return np.load(file, allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise InvalidInput(f"deform: cannot read {file}: {error}") from None
