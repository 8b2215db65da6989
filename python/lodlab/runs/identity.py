# SPDX-License-Identifier: MIT
"""What a run's rows rest on beside its configuration, as lists of hashes: the heights, the poses of every frame, the
raster of colours. And what a run directory keeps so that it can be flown again: paths and arrays that lay in memory.

Invariant: a name is never believed. Rows under one name in one directory have the same three hashes.
"""

from __future__ import annotations

import io
import json
import os
import zipfile
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from .. import _core
from ..disk import write_atomic
from ..errors import InvalidInput, StoreError
from ..paths.deform import NAMES as DEFORMS
from ..paths.deform import Deformation
from ..paths.path import NAMES, CameraPath, joined, of_keys, parts_of, poses_hash
from ..sources.base import Source
from ..sources.datasets import as_source
from ..sources.heightfield import HeightField
from ..sources.mesh import Mesh
from .directory import RunDirectory
from .toml import toml_text

KEPT_MB = 256  # arrays up to this size are kept in a run directory


# ---- hashes ---------------------------------------------------------------------------------------


def hash_list(found: Mapping[tuple[str, str], str]) -> list[dict[str, str]]:
    """Hashes by (what, name) as configurations hold them."""
    return [{"what": what, "name": name, "value": value} for (what, name), value in found.items()]


def check_hashes(where: str, known: Iterable[Mapping[str, str]], now: Iterable[Mapping[str, str]]) -> None:
    """InvalidInput names the first thing that both lists name and that has another hash now."""
    before = {(entry["what"], entry["name"]): entry["value"] for entry in known}
    for entry in now:
        old = before.get((entry["what"], entry["name"]), entry["value"])
        if old != entry["value"]:
            raise InvalidInput(
                f"{where}: {entry['what']} {entry['name']} has changed since its runs were made (hash {old} there, "
                f"{entry['value']} now); their rows do not compare. Choose another directory, or bring back what was"
            )


def merged(known: Iterable[Mapping[str, str]], now: Iterable[Mapping[str, str]]) -> list[dict[str, str]]:
    """Both lists as one, each name once."""
    return hash_list({(entry["what"], entry["name"]): entry["value"] for entry in (*known, *now)})


# ---- what is kept ---------------------------------------------------------------------------------


def take_path(
    directory: RunDirectory, path: CameraPath, fields: Iterable[Source], size: tuple[int, int], fov: float | None
) -> str:  # fmt: skip
    """The name under which a path that lies in memory is flown again: a built-in one's where it is that, over every
    field; else that of the key frames that the directory now keeps."""
    fresh = directory.config is None
    deform = keep_deform(directory.path, path.deform, fresh)
    path = path.with_deform(None)
    views, fields = list(path.views(size, fov)), list(fields)
    if path.name in NAMES and fields:
        own = (CameraPath.named(path.name, f, frames=len(path), fov=fov).views(size, fov) for f in fields)
        if all(poses_hash(v) == poses_hash(views) for v in own):
            return joined(path.name, deform)
    return joined(keep_path(directory.path, path, views, fresh), deform)


def keep_deform(folder: Path, deform: Deformation | None, fresh: bool) -> str:
    """Writes what deforms a mesh along a path, as an array; its name from `folder`: a built-in one by its own, none an
    empty text. InvalidInput as `keep_path`, and for a function."""
    if deform is None or deform.name in DEFORMS:
        return "" if deform is None else deform.name
    deform.hash()  # refuses a function
    data = io.BytesIO()
    np.save(data, deform.poses)
    return _kept(folder, f"{_safe(deform.name)}.npy", data.getvalue(), fresh)


def keep_parts(directory: RunDirectory, text: str, beside: Path | None) -> str:
    """The text of a path by what the directory now keeps: copies of its files, which lie `beside` a configuration, or
    where they say."""
    path, deform = parts_of(text)

    def lies(name: str) -> Path:
        inside = None if beside is None else beside / name
        return inside if inside is not None and inside.is_file() else Path(name)

    fresh = directory.config is None
    if of_keys(path):
        path = keep_file(directory.path, lies(path), fresh)
    made = None if not deform else Deformation.of(deform if deform in DEFORMS else lies(deform))
    return joined(path, keep_deform(directory.path, made, fresh))


def keep_path(folder: Path, path: CameraPath, views: list[Any], fresh: bool) -> str:
    """Writes a path that lies in memory as key frames, a key a frame; its name from `folder`. InvalidInput where
    another path has that name in a directory that is not `fresh`: that has finished runs."""
    keys = [
        {"t": path.time(f), "eye": v.eye.tolist(), "target": v.target.tolist(), "up": v.up.tolist(), "fov": v.fov,
         "near": v.near}
        for f, v in enumerate(views)
    ]  # fmt: skip
    return _kept(folder, f"{_safe(path.name)}.toml", toml_text({"key": keys}).encode(), fresh)


def keep_file(folder: Path, file: Path, fresh: bool) -> str:
    """Copies a key-frame file; its name from `folder`. InvalidInput as `keep_path`, and when it cannot be read."""
    try:
        data = file.read_bytes()
    except OSError as error:
        raise InvalidInput(f"camera path: cannot read {file}: {error.strerror}") from None
    return _kept(folder, f"{_safe(file.stem)}{file.suffix.lower()}", data, fresh)


def _kept(folder: Path, name: str, data: bytes, fresh: bool) -> str:
    file = folder / "paths" / name
    if not file.exists() or file.read_bytes() != data:
        if file.exists() and not fresh:
            raise InvalidInput(
                f"run directory {folder}: path {name} has changed since its runs were made, or is another one of that "
                "name; their rows do not compare. Choose another directory or another name"
            )
        file.parent.mkdir(parents=True, exist_ok=True)
        write_atomic(file, data)
    return f"paths/{name}"


def keep_array(folder: Path, name: str, source: Source, most_mb: float) -> None:
    """Writes what a source without a SOURCE text is made of: heights as `sources/NAME.npy`, voids NaN, a mesh's arrays
    as `NAME.npz`, and where it lies and its hash beside them. Nothing where a SOURCE text loads it, and where it is
    larger than `most_mb`."""
    if source.spec:
        return
    mesh = isinstance(source, Mesh)
    arrays = _arrays_of(source) if mesh else {"heights": source.heights}
    if sum(array.nbytes for array in arrays.values()) > most_mb * 2**20:
        return
    file = _array_file(folder, name, mesh)
    frame = {} if mesh else source.__getstate__()["frame"]
    about = json.dumps({**frame, "name": source.name, "hash": source.hash()}, indent=2) + "\n"
    if file.exists() and file.with_suffix(".json").exists() and file.with_suffix(".json").read_text() == about:
        return
    file.parent.mkdir(parents=True, exist_ok=True)
    data = io.BytesIO()
    np.savez(data, **arrays) if mesh else np.save(data, arrays["heights"])
    for kind in (True, False):
        _array_file(folder, name, kind).unlink(
            missing_ok=True
        )  # no moment with the frame of one and the arrays of another
    write_atomic(file.with_suffix(".json"), about)
    write_atomic(file, data.getvalue())


def kept_array(folder: Path, name: str) -> Source | None:
    """What `keep_array` wrote, or None. StoreError when it is not what was written beside it."""
    file = next((f for f in (_array_file(folder, name, mesh) for mesh in (False, True)) if f.is_file()), None)
    if file is None:
        return None
    try:
        about = json.loads(file.with_suffix(".json").read_text())
        title, digest = about.pop("name"), about.pop("hash")
        if file.suffix == ".npz":
            with file.open("rb") as opened, np.load(opened, allow_pickle=False) as arrays:
                source: Source = Mesh(**arrays, name=title)
        else:
            source = _field_of(np.load(file, allow_pickle=False), about, title)
    except (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile) as error:
        raise StoreError(f"source {name}: {file} is damaged: {error}") from None
    if source.hash() != digest:
        raise StoreError(f"source {name}: {file} is damaged: its hash is {source.hash()}, not {digest}")
    return source


def _arrays_of(mesh: Mesh) -> dict[str, np.ndarray]:
    arrays = {"positions": mesh.positions, "faces": mesh.faces, "colors": mesh.colors, "normals": mesh.normals}
    return {name: array for name, array in arrays.items() if array is not None}


def _field_of(heights: np.ndarray, frame: dict[str, Any], name: str) -> HeightField:
    valid = np.isfinite(heights)
    mask = None if valid.all() else np.ascontiguousarray(valid).view(np.uint8)
    if mask is not None:
        _core.fill_voids(heights, mask)
    field = HeightField.__new__(HeightField)
    field.__setstate__({"arrays": (heights, mask), "frame": frame, "spec": "", "name": name})
    return field


def source_in(folder: Path, name: str) -> Source:
    """The source of that name of a run directory: an array that it keeps, or what the SOURCE text loads."""
    kept = kept_array(folder, name)
    return as_source(name) if kept is None else kept


def path_in(folder: Path, text: str) -> str:
    """A path as a run directory names it: the file of the key frames that it keeps, or a built-in name; likewise what
    deforms the mesh."""
    path, deform = (os.fspath(folder / part) if (folder / part).is_file() else part for part in parts_of(text))
    return joined(path, deform)


def _array_file(folder: Path, name: str, mesh: bool) -> Path:
    return folder / "sources" / f"{_safe(name)}{'.npz' if mesh else '.npy'}"


def _safe(name: str) -> str:
    return "".join(c if c.isalnum() or c in "._-" else "_" for c in name).lstrip(".") or "_"
