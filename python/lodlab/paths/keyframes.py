# SPDX-License-Identifier: MIT
"""Paths from key frames (TOML, JSON) and from arrays of poses."""

from __future__ import annotations

import json
import math
import os
import tomllib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..errors import InvalidInput
from .terrain import Pose, PoseAt

_FIELDS = ("t", "eye", "target", "up", "fov", "near")
_RIGID = 1e-3  # how far from a rotation a pose may be


def _number(value: Any, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float, np.integer, np.floating)):
        raise InvalidInput(f"camera path: {where} = {value!r} is not a number")
    if not math.isfinite(value):
        raise InvalidInput(f"camera path: {where} = {value!r} is not finite")
    return float(value)


def _vector(value: Any, where: str) -> list[float]:
    if isinstance(value, (str, Mapping)) or not isinstance(value, (Sequence, np.ndarray)) or len(value) != 3:
        raise InvalidInput(f"camera path: {where} = {value!r} is not three numbers")
    return [_number(v, where) for v in value]


def _row(key: Any, index: int) -> list[float]:
    """t, eye, target, up, fov, near of one key; nan where not given."""
    where = f"key {index + 1}"
    if not isinstance(key, Mapping):
        raise InvalidInput(f"camera path: {where} is no table of {', '.join(_FIELDS)}")
    if unknown := [name for name in key if name not in _FIELDS]:
        raise InvalidInput(f"camera path: {where} has unknown '{unknown[0]}'; known are {', '.join(_FIELDS)}")
    for name in ("t", "eye", "target"):
        if name not in key:
            raise InvalidInput(f"camera path: {where} has no {name}")
    row = [_number(key["t"], f"{where}: t")]
    row += _vector(key["eye"], f"{where}: eye") + _vector(key["target"], f"{where}: target")
    row += _vector(key.get("up", (0.0, 0.0, 1.0)), f"{where}: up")
    for name, low, high in (("fov", 1.0, 170.0), ("near", 0.0, math.inf)):
        value = _number(key[name], f"{where}: {name}") if name in key else math.nan
        if value < low or value > high or (name == "near" and value == 0.0):
            limits = "within 1 to 170 degrees" if name == "fov" else "positive"
            raise InvalidInput(f"camera path: {where}: {name} = {value:g} is not {limits}")
        row.append(value)
    return row


def poses_of_keys(keys: Sequence[Mapping[str, Any]]) -> PoseAt:
    """Catmull-Rom through the keys: the first stands at path time 0, the last at 1.

    InvalidInput names the key: unknown or missing values, times that do not rise, fov or near given by
    some keys only, eye and target in one place, up zero.
    """
    if isinstance(keys, (str, Mapping)) or not isinstance(keys, Sequence) or not keys:
        raise InvalidInput("camera path: no keys; at least one [[key]] with t, eye, target is needed")
    table = np.array([_row(key, i) for i, key in enumerate(keys)])
    times, values = table[:, 0], table[:, 1:]
    for i in range(1, len(times)):
        if not times[i] > times[i - 1]:
            raise InvalidInput(f"camera path: key {i + 1}: t = {times[i]:g} does not come after {times[i - 1]:g}")
    for i, v in enumerate(values):
        if np.array_equal(v[0:3], v[3:6]):
            raise InvalidInput(f"camera path: key {i + 1}: eye and target are the same point")
        if not v[6:9].any():
            raise InvalidInput(f"camera path: key {i + 1}: up is zero")
    for column, name in ((9, "fov"), (10, "near")):
        given = ~np.isnan(values[:, column])
        if given.any() and not given.all():
            raise InvalidInput(f"camera path: key {int(np.argmin(given)) + 1} has no {name}, others have")
    tangents = _tangents(times, values)

    def at(t: float) -> Pose:
        v = _hermite(times, values, tangents, times[0] + t * (times[-1] - times[0]))
        fov = None if math.isnan(v[9]) else float(np.clip(v[9], 1.0, 170.0))
        near = None if math.isnan(v[10]) else float(max(v[10], values[:, 10].min()))
        return Pose(v[0:3], v[3:6], v[6:9], fov, near)

    return at


def _tangents(times: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Catmull-Rom over uneven times: the slope between the neighbours, one-sided at the ends."""
    if len(times) == 1:
        return np.zeros_like(values)
    ahead = np.minimum(np.arange(len(times)) + 1, len(times) - 1)
    behind = np.maximum(np.arange(len(times)) - 1, 0)
    return (values[ahead] - values[behind]) / (times[ahead] - times[behind])[:, None]


def _hermite(times: np.ndarray, values: np.ndarray, tangents: np.ndarray, time: float) -> np.ndarray:
    """The cubic between two keys. By hand, because kept paths come back bit for bit: it is exact at the keys, where
    scipy's CubicHermiteSpline is a bit or two off; and it lets pass the nan of what no key gives."""
    if len(times) == 1:
        return values[0].copy()
    i = int(np.clip(np.searchsorted(times, time, side="right") - 1, 0, len(times) - 2))
    width = times[i + 1] - times[i]
    s = (time - times[i]) / width
    a, b = (2 * s**3 - 3 * s**2 + 1), (s**3 - 2 * s**2 + s) * width
    c, d = (3 * s**2 - 2 * s**3), (s**3 - s**2) * width
    return a * values[i] + b * tangents[i] + c * values[i + 1] + d * tangents[i + 1]


def poses_of_array(array: Any, fov: float | None, near: float | None) -> PoseAt:
    """Camera-to-world matrices, (N, 4, 4), -z forward; between two poses eye and axes are blended."""
    matrices = np.asarray(array)
    if matrices.dtype.kind not in "iuf":
        raise InvalidInput(f"camera path: poses have dtype {matrices.dtype}; real numbers are needed")
    matrices = matrices.astype(np.float64)
    if matrices.ndim != 3 or matrices.shape[1:] != (4, 4) or len(matrices) == 0:
        raise InvalidInput(f"camera path: poses have shape {matrices.shape}, not (N, 4, 4)")
    for i, m in enumerate(matrices):
        rotation = m[:3, :3]
        if not np.isfinite(m).all():
            raise InvalidInput(f"camera path: pose {i} holds numbers that are not finite")
        if np.abs(m[3] - (0, 0, 0, 1)).max() > _RIGID:
            raise InvalidInput(f"camera path: pose {i}: last row {m[3].tolist()} is not (0, 0, 0, 1)")
        if np.abs(rotation.T @ rotation - np.eye(3)).max() > _RIGID or np.linalg.det(rotation) < 0:
            raise InvalidInput(f"camera path: pose {i}: its upper 3 x 3 part is no rotation")
    if fov is not None:
        _row({"t": 0, "eye": (0, 0, 0), "target": (0, 0, 1), "fov": fov}, 0)
    if near is not None and not (isinstance(near, (int, float)) and math.isfinite(near) and near > 0):
        raise InvalidInput(f"camera path: near = {near!r} is not positive")

    def at(t: float) -> Pose:
        place = min(max(t, 0.0), 1.0) * (len(matrices) - 1)
        nearest = round(place)
        if abs(place - nearest) < 1e-9:  # a given pose, exactly
            m = matrices[nearest]
        else:
            i = int(place)
            m = matrices[i] + (matrices[i + 1] - matrices[i]) * (place - i)
        eye, up, forward = m[:3, 3], m[:3, 1], -m[:3, 2]
        if float(np.linalg.norm(forward)) < 1e-6:
            raise InvalidInput(f"camera path: poses {int(place)} and {int(place) + 1} look opposite ways")
        return Pose(eye.copy(), eye + forward * max(1.0, float(np.abs(eye).max()) * 1e-6), up.copy(), fov, near)

    return at


def read_file(path: str | os.PathLike[str]) -> dict[str, Any]:
    """The table of a .toml or .json file. InvalidInput names the path and the reason."""
    text = os.fspath(path)
    try:
        with open(text, "rb") as file:
            data = tomllib.load(file) if text.lower().endswith(".toml") else json.load(file)
    except OSError as error:
        raise InvalidInput(f"camera path: cannot read {text}: {error.strerror}") from None
    except (ValueError, RecursionError) as error:  # both decoders' errors are ValueErrors
        raise InvalidInput(f"camera path: {text} is not well-formed: {error}") from None
    if not isinstance(data, dict):
        raise InvalidInput(f"camera path: {text} holds no table with 'key' or 'poses'")
    known = ("key", "poses", "fov", "near")
    if unknown := [name for name in data if name not in known]:
        raise InvalidInput(f"camera path: {text} has unknown '{unknown[0]}'; known are {', '.join(known)}")
    if ("key" in data) == ("poses" in data):
        raise InvalidInput(f"camera path: {text} needs either 'key' or 'poses'")
    return data
