# SPDX-License-Identifier: MIT
"""Mesh files as arrays: which format a file has and what it is packed in.

A reader takes the bytes of a file and gives polygons; `polygons.triangles` cuts them. Nothing that a file claims is
believed before its bytes are there: memory is asked for by what was read.
"""

from __future__ import annotations

import gzip
import os
import zlib

from ..errors import InvalidInput
from .gltf import levels_in_gltf, read_gltf
from .obj import read_obj
from .off import read_off
from .ply import read_ply
from .polygons import UNPACKED_ALWAYS, UNPACKED_AT_MOST, MeshData, triangles
from .stl import read_stl

_READERS = {
    ".ply": read_ply,
    ".obj": read_obj,
    ".stl": read_stl,
    ".off": read_off,
    ".gltf": read_gltf,
    ".glb": read_gltf,
}
FORMATS = tuple(_READERS)
_CHUNK = 1 << 20


def format_of(path: str) -> str | None:
    """`.ply` of `a.ply` and `a.PLY.gz`; None where it is no mesh file by its name."""
    name = path.lower().removesuffix(".gz")
    return next((suffix for suffix in FORMATS if name.endswith(suffix)), None)


def read_mesh(path: str) -> MeshData:
    """The mesh of a file. InvalidInput names the path and what is wrong with it."""
    kind = format_of(path)
    if kind is None:
        raise InvalidInput(f"open {path}: it ends in none of {', '.join(FORMATS)}, nor one of them and .gz")
    return triangles(_READERS[kind](read_bytes(path), path), path)


def read_levels(path: str) -> list[MeshData]:
    """The levels of a file, the finest first: several of a glTF file with the extension MSFT_lod."""
    kind = format_of(path)
    if kind not in (".gltf", ".glb"):
        return [read_mesh(path)]
    data = read_bytes(path)
    return [triangles(read_gltf(data, path, level), path) for level in range(levels_in_gltf(data))]


def read_bytes(path: str) -> bytes:
    """All of a file, unpacked where it is gzipped. InvalidInput names the path."""
    try:
        with open(path, "rb") as opened:
            packed = opened.read(2) == b"\x1f\x8b"
            if not packed:
                opened.seek(0)
                return opened.read()
        most = max(UNPACKED_ALWAYS, UNPACKED_AT_MOST * os.path.getsize(path))
        out = bytearray()
        with gzip.open(path) as unpacked:
            while chunk := unpacked.read(_CHUNK):
                out += chunk
                if len(out) > most:
                    raise InvalidInput(
                        f"open {path}: it unpacks to more than {most} bytes, {UNPACKED_AT_MOST} times its size, "
                        "more than meshes do; gunzip it if it is one"
                    )
        return bytes(out)
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise InvalidInput(f"open {path}: damaged or cut short: {error}") from None
    except OSError as error:
        raise InvalidInput(f"open {path}: {error.strerror or error}") from None
