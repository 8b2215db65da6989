# SPDX-License-Identifier: MIT
"""SOURCE texts: `NAME_OR_FILE[:key=value,...]`, as `earth:vertical_scale=20` or `dem.png:spacing=30`.

What lies inside a file is named as GDAL names it, or `FILE.npz:ARRAY`. An existing file of that whole name wins.
Bare file names are looked up from the working directory, then in
the folder of further data (`LODLAB_DATA`, default `../shared/data` beside the repository).
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InvalidInput
from .mesh_files import format_of
from .raster import absolute


def data_folder() -> Path | None:
    """The folder of further real data, or None: LODLAB_DATA, else ../shared/data beside the repository."""
    if named := os.environ.get("LODLAB_DATA"):
        return Path(named)
    for base in (Path(__file__).resolve().parents[3], Path.cwd()):
        folder = base.parent / "shared" / "data"
        if folder.is_dir():
            return folder
    return None


def find_file(name: str) -> str | None:
    """The path of an existing file or folder of this name: as it stands, or in the data folder."""
    if os.path.exists(name):
        return name
    folder = data_folder()
    if folder is not None and not os.path.isabs(name):
        for base in (folder, folder / "terrain", folder / "mesh"):
            if os.path.isfile(base / name):  # False for names that no file can have
                return str(base / name)
    return None


def _number(text: str) -> float:
    return float(text)


def _whole(text: str) -> int:
    return int(text, 10)


def _flag(text: str) -> bool:
    if text.lower() not in ("true", "false"):
        raise ValueError
    return text.lower() == "true"


def _spacing(text: str) -> float | tuple[float, float]:
    values = tuple(float(v) for v in text.split("/"))
    if len(values) > 2:
        raise ValueError
    return values if len(values) == 2 else values[0]


def _nodata(text: str) -> float | tuple[float, ...] | str:
    if text.lower() == "none":
        return "none"
    values = tuple(float(v) for v in text.split("/"))
    return values if len(values) > 1 else values[0]


def _window(text: str) -> tuple[int, ...]:
    values = tuple(int(v, 10) for v in text.split("/"))
    if len(values) != 4:
        raise ValueError
    return values


@dataclass(frozen=True)
class Key:
    """A key of SOURCE texts: how its value reads, and what it looks like in messages."""

    read: Callable[[str], Any]
    form: str


KEYS = {
    "spacing": Key(_spacing, "metres, or dx/dy"),
    "vertical_scale": Key(_number, "a positive number"),
    "nodata": Key(_nodata, "a number, several as A/B, or none"),
    "planet": Key(_flag, "true or false"),
    "radius": Key(_number, "metres"),
    "band": Key(_whole, "a whole number from 1"),
    "window": Key(_window, "row0/col0/rows/cols"),
    "encoding": Key(str, "terrarium or mapbox"),
    "offset": Key(_number, "metres"),
    "size": Key(_whole, "a whole number from 2"),
    "seed": Key(_whole, "a whole number from 0"),
    "roughness": Key(_number, "a number from 0 to 1"),
    "level": Key(_whole, "a whole number from 0"),
    "rings": Key(_whole, "a whole number from 3"),
    "sides": Key(_whole, "a whole number from 3"),
    "tube": Key(_number, "a number between 0 and 1"),
    "repair": Key(str, "all, or some of weld,degenerate,duplicates,orient,split,unused"),
}
FILE_KEYS = ("spacing", "vertical_scale", "nodata", "planet", "radius", "band", "window", "encoding", "offset")
MESH_KEYS = ("repair",)


@dataclass(frozen=True)
class SourceSpec:
    """What a SOURCE text says: a data set's name or a file's absolute path (or what of it), and its keys."""

    name: str
    is_file: bool
    keys: dict[str, Any] = field(default_factory=dict)


def _read_keys(text: str, tail: str, known: Iterable[str], owner: str) -> dict[str, Any]:
    known = list(known)
    out: dict[str, Any] = {}
    parts: list[str] = []
    for part in tail.split(","):
        if parts and "=" not in part and parts[-1].strip().startswith("repair="):
            parts[-1] += "," + part  # a list's next word
        else:
            parts.append(part)
    for part in parts:
        key, equals, value = (s.strip() for s in part.partition("="))
        if key not in known:
            raise InvalidInput(f"source '{text}': unknown key '{key}'; {owner} knows {', '.join(known)}")
        if not equals or not value:
            raise InvalidInput(f"source '{text}': key '{key}' has no value; it takes {KEYS[key].form}")
        if key in out:
            raise InvalidInput(f"source '{text}': key '{key}' is given twice")
        try:
            out[key] = KEYS[key].read(value)
        except ValueError:
            raise InvalidInput(f"source '{text}': {key}={value} is not {KEYS[key].form}") from None
    return out


def parse(text: str | os.PathLike[str], datasets: Mapping[str, Any]) -> SourceSpec:
    """Reads a SOURCE text; `datasets`: those known by name, each with its `keys`. InvalidInput lists the known keys, or
    the known data sets."""
    if not isinstance(text, (str, os.PathLike)):
        raise InvalidInput(f"source: {type(text).__name__} is no SOURCE text or path")
    text = os.fsdecode(text)
    if not text.strip():
        raise InvalidInput("source '': it names neither a file nor a data set")
    path = find_file(text)
    if path is not None and (os.path.isfile(path) or text not in datasets):
        return SourceSpec(os.path.abspath(path), True)
    head, colon, tail = text.rpartition(":")
    if not colon:
        head, tail = text, ""
    if head in datasets:
        owner = f"'{head}'"
        return SourceSpec(head, False, _read_keys(text, tail, datasets[head].keys, owner) if colon else {})
    keyed = bool(colon) and all("=" in part for part in tail.split(","))
    name = head if keyed else text
    if (inside := absolute(name, find_file)) is not None:
        return SourceSpec(inside, True, _read_keys(text, tail, FILE_KEYS, "a raster") if keyed else {})
    if colon and (path := find_file(head)) is not None:
        keys, owner = (MESH_KEYS, "a mesh file") if format_of(path) else (FILE_KEYS, "a raster file")
        return SourceSpec(os.path.abspath(path), True, _read_keys(text, tail, keys, owner))
    folder = data_folder()
    where = f"the working directory or {folder}" if folder is not None else "the working directory"
    raise InvalidInput(
        f"source '{text}': '{name}' is neither a file in {where} nor one of the data sets {', '.join(datasets)}"
    )


def short_source(text: str) -> str:
    """A SOURCE text for people: of a file, its name without the folders, keys kept."""
    head, colon, keys = text.partition(":")
    return os.path.basename(head) + colon + keys


def _text(value: Any) -> str:
    """A key's value as SOURCE text that reads back the same."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (tuple, list, np.ndarray)):
        return "/".join(_text(v) for v in value)
    if isinstance(value, (float, np.floating)):
        return str(int(value)) if float(value).is_integer() and abs(value) < 1e15 else repr(float(value))
    return str(value)


def format_spec(name: str, keys: dict[str, Any]) -> str:
    """SOURCE text of a name or file and its keys; keys that are None are left out."""
    given = [f"{key}={_text(value)}" for key, value in keys.items() if value is not None]
    return f"{name}:{','.join(given)}" if given else name
