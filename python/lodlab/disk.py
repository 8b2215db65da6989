# SPDX-License-Identifier: MIT
"""Files on disk: written whole or not at all, folders that go with their owner, what kind a file is, and hashes."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import tempfile
import weakref
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any


def short_hash(value: Any) -> str:
    """Twelve hex digits of the canonical JSON of a value: names of stores, `options_hash`."""
    text = json.dumps(value, sort_keys=True, separators=(",", ":"))
    return hashlib.blake2b(text.encode(), digest_size=6).hexdigest()


def write_atomic(file: Path, data: str | bytes) -> None:
    """Writes a file whole or not at all: temporary name, sync, rename."""
    temporary = file.with_name(f".{file.name}.{os.getpid()}.tmp")
    try:
        with temporary.open("wb") as out:
            out.write(data.encode() if isinstance(data, str) else data)
            out.flush()
            os.fsync(out.fileno())
        temporary.replace(file)
    except BaseException as error:
        temporary.unlink(missing_ok=True)
        if isinstance(error, OSError):  # writes name no file, and the temporary name tells nobody anything
            raise OSError(error.errno, error.strerror, os.fspath(file)) from None
        raise


def temporary_folder(owner: Any) -> Path:
    """A folder that is removed when its owner is gone, or at the end of the program."""
    folder = tempfile.mkdtemp(prefix="lodlab-")
    weakref.finalize(owner, shutil.rmtree, folder, True)
    return Path(folder)


_APPLICATION_ID = b"lodl"  # of stores, in the header of their SQLite file


def is_store(path: str | os.PathLike[str]) -> bool:
    """True for files that say that they are a store, by name or by their first bytes."""
    file = Path(path)
    if not file.is_file():
        return file.suffix == ".lod"
    with file.open("rb") as opened:
        head = opened.read(72)
    return (head.startswith(b"SQLite format 3") and head[68:72] == _APPLICATION_ID) or file.suffix == ".lod"


def parts_of(text: str) -> list[str]:
    """The SOURCE texts of an option: with ';' between them, or where there is none with ','; a file's name as it is."""
    separator = ";" if ";" in text else ","
    return [text] if os.path.isfile(text) else [part.strip() for part in text.split(separator) if part.strip()]


def _file_in(part: str) -> str | None:
    """The file that a SOURCE text begins with."""
    return next((name for name in (part, part.partition(":")[0]) if name and os.path.isfile(name)), None)


def absolute_parts(text: str) -> str:
    """An option's text, the files that it names by absolute names."""
    parts = parts_of(text)
    if not any(map(_file_in, parts)):
        return text
    named = ((part, _file_in(part)) for part in parts)
    return ";".join(part if file is None else os.path.abspath(file) + part[len(file) :] for part, file in named)


def rasters(options: Mapping[str, Any]) -> dict[tuple[str, str], str]:
    """The files that build options name, each as ("raster", its name) with 32 hex digits of its bytes."""
    out = {}
    texts = (v for v in options.values() if isinstance(v, str) and v)
    for file in (file for text in texts for part in parts_of(text) if (file := _file_in(part))):
        status = os.stat(file)
        out["raster", file] = _file_hash(os.path.abspath(file), status.st_mtime_ns, status.st_size)
    return out


def attribute_hash(options: Mapping[str, Any]) -> str:
    """The hash of the file that build options name (several: theirs joined), empty where they name none."""
    return "-".join(rasters(options).values())


@lru_cache(maxsize=64)
def _file_hash(file: str, _changed: int, _size: int) -> str:
    with open(file, "rb") as opened:
        return hashlib.file_digest(opened, lambda: hashlib.blake2b(digest_size=16)).hexdigest()
