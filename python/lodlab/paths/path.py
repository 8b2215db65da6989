# SPDX-License-Identifier: MIT
"""Camera paths: deterministic sequences of views. Frame f of N is the path at t = f / (N - 1)."""

from __future__ import annotations

import hashlib
import math
import operator
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from .. import _core
from ..errors import InvalidInput, Unsupported, close_to
from ..sources.base import FieldSource, Source
from ..sources.mesh import Mesh
from .around import AROUND
from .deform import NAMES as DEFORMS
from .deform import Deformation
from .ground import Ground
from .keyframes import poses_of_array, poses_of_keys, read_file
from .terrain import BUILT_IN, Pose, PoseAt

NAMES = tuple(dict.fromkeys([*BUILT_IN, *AROUND]))  # of built-in paths, over terrain and around meshes
DEFAULT_FRAMES = 120
DEFAULT_FOV = 60.0
MAX_FRAMES = 1_000_000
_KEYS = (".toml", ".json")
POSE_BITS = 32  # of positions and axes: built-in paths differ in the last bits from one libm to another


def _whole(what: str, value: Any, low: int, high: int) -> int:
    try:
        number = operator.index(value)
    except TypeError:
        raise InvalidInput(f"camera path: {what} {value!r} is not a whole number") from None
    if not low <= number <= high:
        raise InvalidInput(f"camera path: {what} {number} is not within {low} to {high}")
    return number


class CameraPath:
    """A sequence of `len(path)` views; `path.view(f)` is the camera of frame f.

    Make one with `flyover`, `orbit`, `walk`, `zoom`, `still` (of a height field), `orbit`, `zoom`, `flyby`, `still`
    (of a mesh), `from_keys`, `from_array`, `load` (a file), or `named` (what the command line takes). `with_deform`
    makes one along which a mesh is deformed: `deform`, else None.
    """

    def __init__(
        self, name: str, pose_at: PoseAt, frames: int, fov: float | None = None, deform: Deformation | None = None
    ) -> None:
        self.name = name
        self.fov = fov
        self.deform = deform
        self._frames = _whole("frames", frames, 1, MAX_FRAMES)
        self._pose_at = pose_at
        if fov is not None and not (isinstance(fov, (int, float)) and 1.0 <= fov <= 170.0):
            raise InvalidInput(f"camera path: fov {fov!r} is not within 1 to 170 degrees")

    def __len__(self) -> int:
        return self._frames

    def __repr__(self) -> str:
        return f"<CameraPath {self.name}: {self._frames} frames>"

    def at(self, t: float) -> Pose:
        """The camera at path time t, 0 to 1: eye, target, up (3,) float64, fov and near or None."""
        if not (isinstance(t, (int, float)) and math.isfinite(t) and 0.0 <= t <= 1.0):
            raise InvalidInput(f"camera path: t {t!r} is not within 0 to 1")
        return self._pose_at(float(t))

    def time(self, frame: int) -> float:
        """Path time of a frame: f / (N - 1), 0 for a path of one frame."""
        frame = _whole("frame", frame, 0, self._frames - 1)
        return frame / (self._frames - 1) if self._frames > 1 else 0.0

    def view(self, frame: int, size: tuple[int, int] = (1280, 720), fov: float | None = None) -> _core.View:
        """The view of a frame. `fov` (horizontal, degrees) overrides the path's; the default is 60."""
        return self.view_at(self.time(frame), size, fov)

    def view_at(self, t: float, size: tuple[int, int] = (1280, 720), fov: float | None = None) -> _core.View:
        """The view at path time t, 0 to 1."""
        pose = self.at(t)
        wide = next(f for f in (fov, pose.fov, self.fov, DEFAULT_FOV) if f is not None)
        return _core.View(
            tuple(pose.eye.tolist()),
            tuple(pose.target.tolist()),
            up=tuple(pose.up.tolist()),
            fov=float(wide),
            size=size,
            near=pose.near,
        )

    def views(self, size: tuple[int, int] = (1280, 720), fov: float | None = None) -> Iterator[_core.View]:
        """The views of all frames, in order."""
        return (self.view(f, size, fov) for f in range(self._frames))

    def dense(self, factor: int) -> CameraPath:
        """The same path with `factor` times as many steps; every factor-th frame is one of this path's."""
        steps = (self._frames - 1) * _whole("factor", factor, 1, MAX_FRAMES)
        return CameraPath(self.name, self._pose_at, steps + 1, self.fov, self.deform)

    def with_deform(self, deform: Any) -> CameraPath:
        """The same path, on which a mesh is deformed: bend, twist, wave, a .npy file or an array of control positions,
        (F, V, 3) or (V, 3), or a function of t and those at rest (`lodlab.deform`); None: it stays at rest. Its name
        says so: `orbit+bend`."""
        made = None if deform is None else Deformation.of(deform)
        base = self.name if self.deform is None else self.name.removesuffix(f"+{self.deform.name}")
        name = base if made is None else f"{base}+{made.name}"
        return CameraPath(name, self._pose_at, self._frames, self.fov, made)

    def control_positions(self, t: float, rest: np.ndarray) -> np.ndarray | None:
        """(V, 3) float64: where the control points are at path time t; None where they are at rest."""
        return None if self.deform is None else self.deform.at(t, rest)

    @classmethod
    def _built_in(cls, name: str, source: Source, frames: int, fov: float | None) -> CameraPath:
        frames = _whole("frames", frames, 1, MAX_FRAMES)
        known = AROUND if isinstance(source, Mesh) else BUILT_IN
        if not isinstance(source, (FieldSource, Mesh)):
            raise InvalidInput(f"camera path {name}: {type(source).__name__} is no height field and no mesh")
        if name not in known:
            raise Unsupported(f"camera path {name}: a {source.kind} has none; it has {', '.join(known)}")
        pose_at = AROUND[name](source) if isinstance(source, Mesh) else BUILT_IN[name](Ground(source))
        return cls(name, pose_at, frames, fov)

    @classmethod
    def flyover(cls, source: Source, frames: int = DEFAULT_FRAMES, fov: float | None = None) -> CameraPath:
        """High and oblique, down to low over the highest relief; planets: from space to low orbit. No meshes."""
        return cls._built_in("flyover", source, frames, fov)

    @classmethod
    def orbit(cls, source: Source, frames: int = DEFAULT_FRAMES, fov: float | None = None) -> CameraPath:
        """Once round the source, looking at it."""
        return cls._built_in("orbit", source, frames, fov)

    @classmethod
    def walk(cls, source: Source, frames: int = DEFAULT_FRAMES, fov: float | None = None) -> CameraPath:
        """At eye height, 1.7 m above the surface and following it. No meshes."""
        return cls._built_in("walk", source, frames, fov)

    @classmethod
    def zoom(cls, source: Source, frames: int = DEFAULT_FRAMES, fov: float | None = None) -> CameraPath:
        """From the whole source to one spot."""
        return cls._built_in("zoom", source, frames, fov)

    @classmethod
    def flyby(cls, source: Source, frames: int = DEFAULT_FRAMES, fov: float | None = None) -> CameraPath:
        """Close past a mesh, looking at where it is passed. No height fields."""
        return cls._built_in("flyby", source, frames, fov)

    @classmethod
    def still(cls, source: Source, frames: int = DEFAULT_FRAMES, fov: float | None = None) -> CameraPath:
        """One view, again and again."""
        return cls._built_in("still", source, frames, fov)

    @classmethod
    def from_keys(
        cls,
        keys: Sequence[Mapping[str, Any]],
        frames: int = DEFAULT_FRAMES,
        fov: float | None = None,
        name: str = "keys",
    ) -> CameraPath:
        """Catmull-Rom in t through keys with t, eye, target and perhaps up, fov, near.

        Points are in source coordinates: x east, y north, z up, metres; y falls down the rows, so that an array
        with the default origin lies at y <= 0 (`repr` of a field gives its extent; a planet's axis is z). The first
        key is the first frame, the last key the last. InvalidInput names the key that is wrong.
        """
        return cls(name, poses_of_keys(keys), frames, fov)

    @classmethod
    def from_array(
        cls,
        poses: Any,
        frames: int | None = None,
        fov: float | None = None,
        near: float | None = 0.1,
        name: str = "array",
    ) -> CameraPath:
        """(N, 4, 4) float64 camera-to-world matrices, -z forward: one frame each, unless `frames` says else."""
        pose_at = poses_of_array(poses, fov, near)
        return cls(name, pose_at, len(np.asarray(poses)) if frames is None else frames, fov)

    @classmethod
    def load(cls, path: str | os.PathLike[str], frames: int | None = None, fov: float | None = None) -> CameraPath:
        """A .toml or .json file with `key` tables (as `from_keys`) or `poses` (as `from_array`).

        `frames` defaults to 120 for keys and to the number of poses.
        """
        data = read_file(path)
        wide = data.get("fov") if fov is None else fov
        name = os.path.splitext(os.path.basename(os.fspath(path)))[0]
        if "key" in data:
            return cls.from_keys(data["key"], DEFAULT_FRAMES if frames is None else frames, wide, name)
        try:
            poses = np.asarray(data["poses"], np.float64)
        except (TypeError, ValueError):
            raise InvalidInput(f"camera path: {os.fspath(path)}: poses are not (N, 4, 4) numbers") from None
        return cls.from_array(poses, frames, wide, data.get("near", 0.1), name)

    @classmethod
    def named(
        cls, name: str, source: Source | None, frames: int = DEFAULT_FRAMES, fov: float | None = None
    ) -> CameraPath:
        """What `path` takes by name: one of NAMES, or a .toml or .json file; with `+bend` (twist, wave, a .npy file)
        behind it what deforms the mesh."""
        if not isinstance(name, (str, os.PathLike)):
            raise InvalidInput(
                f"camera path: {name!r} is no CameraPath, no name ({', '.join(NAMES)}) and no .toml or .json file"
            )
        text, deform = parts_of(os.fspath(name))
        if deform:
            return cls.named(text, source, frames, fov).with_deform(deform)
        if text in NAMES:
            if source is None:
                raise InvalidInput(f"camera path {text}: it needs the source to fly over")
            return cls._built_in(text, source, frames, fov)
        if of_keys(text):
            return cls.load(text, frames, fov)
        known, close = ", ".join(NAMES), close_to(text, NAMES)
        meant = f" (close to it: {', '.join(close)})" if close else ""
        raise InvalidInput(f"camera path '{text}': neither one of {known} nor a .toml or .json file{meant}")


def default_path(kind: str) -> str:
    """The built-in path where none is named, by the source's kind."""
    return "orbit" if kind == "mesh" else "flyover"


def named_or_default(path: Any, kind: str) -> Any:
    """A path as it was given; where that is the empty text, the name of the default one."""
    return default_path(kind) if isinstance(path, str) and not path else path


def make_path(path: Any, source: Source | None, frames: int, fov: float | None) -> CameraPath:
    """A CameraPath from itself, a built-in name, or a key-frame file (.toml, .json)."""
    return path if isinstance(path, CameraPath) else CameraPath.named(path, source, frames=frames, fov=fov)


def parts_of(text: str) -> tuple[str, str]:
    """The text of a path in two: of the camera's, and of what deforms the mesh, empty where nothing does."""
    plus = [at for at, sign in enumerate(text) if sign == "+"]
    found = [(text[:at], text[at + 1 :]) for at in plus]
    found = [(path, deform) for path, deform in found if deform in DEFORMS or deform.lower().endswith(".npy")]
    known = (parts for parts in found if parts[0] in NAMES or parts[0].lower().endswith(_KEYS))
    return next(known, found[0] if found else (text, ""))  # names of files may have a + of their own


def joined(path: str, deform: str) -> str:
    """The text that `parts_of` takes apart."""
    return f"{path}+{deform}" if deform else path


def of_keys(text: str) -> bool:
    """Whether the text of a path names a file of key frames."""
    return parts_of(text)[0].lower().endswith(_KEYS)


def label_of(text: str) -> tuple[str, str]:
    """What names of runs say of a path: of the camera's and of what deforms the mesh."""
    path, deform = parts_of(text)
    return os.path.splitext(os.path.basename(path))[0], os.path.splitext(os.path.basename(deform))[0]


def over_source(path: Any) -> bool:
    """Whether a path is made from what it flies over: a built-in one, by its name."""
    return isinstance(path, (str, os.PathLike)) and not of_keys(os.fspath(path))


def path_text(path: Any) -> str:
    """A path as configurations name it: a built-in name, an absolute file, or the name of one in memory."""
    if isinstance(path, CameraPath):
        return path.name
    text, deform = parts_of(os.fspath(path))
    text = os.path.abspath(text) if of_keys(text) else text
    return joined(text, os.path.abspath(deform) if deform and deform not in DEFORMS else deform)


def poses_hash(views: Iterable[Any], deform: Deformation | None = None) -> str:
    """32 hex digits of eye, target, up, fov, near plane and size of every view, and of what deforms the mesh.

    Rounded to 2^-32 of the largest number of its kind, so that the last bits of a sine do not count.
    """
    rows = [[*v.eye, *v.target, *(v.up / np.linalg.norm(v.up)), v.fov, v.near, *v.size] for v in views]
    table = np.array(rows, dtype=np.float64)
    out = hashlib.blake2b(digest_size=16)
    for part in (table[:, :6], table[:, 6:9], table[:, 9:10], table[:, 10:11], table[:, 11:]):
        _, exponent = np.frexp(np.abs(part).max())
        out.update(np.rint(np.ldexp(part, POSE_BITS - int(exponent))).astype(np.int64).tobytes())
        out.update(int(exponent).to_bytes(4, "little", signed=True))
    if deform is not None:
        out.update(deform.hash().encode())
    return out.hexdigest()
