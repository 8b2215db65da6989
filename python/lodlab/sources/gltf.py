# SPDX-License-Identifier: MIT
"""glTF 2 and GLB files: the triangles of the default scene, every node's transform applied.

Buffers lie in the file, in `data:` texts or in files beside it. Primitives of one node that share their vertices
keep sharing them; vertices that a program doubled (at seams of textures) stay doubled: `repair=weld` joins them.
Every count is held against the bytes that are there before memory is asked for.
"""

from __future__ import annotations

import base64
import json
import os
import struct
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import unquote

import numpy as np

from ..errors import InvalidInput
from .polygons import UNPACKED_ALWAYS, UNPACKED_AT_MOST, Polygons, as_bytes, unrolled

_TYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
_JSON, _BIN = 0x4E4F534A, 0x004E4942  # chunks of GLB
_TRIANGLES, _STRIP, _FAN = 4, 5, 6


def read_gltf(data: bytes, path: str, level: int = 0) -> Polygons:
    """The triangles of a glTF or GLB file. InvalidInput names the path. `level`: of nodes that have levels by the
    extension MSFT_lod that one, or their last."""
    try:
        text, binary = _chunks(data) if data[:4] == b"glTF" else (data, None)
        document = json.loads(text)
        needed = [name for name in document.get("extensionsRequired", []) if "compression" in str(name).lower()]
        if needed:
            raise InvalidInput(f"it needs the extension {needed[0]}, which is not read")
        return _Scene(document, binary, os.path.dirname(path), level).polygons()
    except InvalidInput as error:
        raise InvalidInput(f"open {path}: {error}") from None
    except (
        LookupError,
        TypeError,
        ValueError,
        AttributeError,
        OverflowError,
        OSError,
        RecursionError,
        struct.error,
    ) as error:
        raise InvalidInput(f"open {path}: it is damaged: {type(error).__name__}: {str(error)[:200]}") from None


def levels_in_gltf(data: bytes) -> int:
    """How many levels the nodes of a glTF or GLB file have, by the extension MSFT_lod; 1 where none has more, and
    where the file is damaged, which reading it tells."""
    try:
        text, _ = _chunks(data) if data[:4] == b"glTF" else (data, None)
        return 1 + max((len(_lower(node)) for node in json.loads(text).get("nodes", [])), default=0)
    except (InvalidInput, LookupError, TypeError, ValueError, AttributeError, RecursionError):
        return 1


def _lower(node: dict[str, Any]) -> list[int]:
    """The nodes that stand in for a node, the finest first (MSFT_lod)."""
    return node.get("extensions", {}).get("MSFT_lod", {}).get("ids", [])


def _chunks(data: bytes) -> tuple[bytes, bytes | None]:
    """The text and the binary chunk of a GLB file."""
    if len(data) < 20:
        raise InvalidInput(f"it is cut short: {len(data)} bytes are no GLB file")
    version, length = struct.unpack_from("<II", data, 4)
    if version != 2 or length > len(data):
        raise InvalidInput(f"version {version} of {length} bytes: version 2 is read, and {len(data)} bytes are there")
    at, found = 12, {}
    while at + 8 <= length:
        size, kind = struct.unpack_from("<II", data, at)
        if size > length - at - 8:
            raise InvalidInput(f"it is cut short: a chunk claims {size} bytes, {length - at - 8} are left")
        found.setdefault(kind, data[at + 8 : at + 8 + size])
        at += 8 + size
    if _JSON not in found:
        raise InvalidInput("it has no chunk of JSON")
    return found[_JSON], found.get(_BIN)


@dataclass
class _Parts:
    """What is gathered of the scene's nodes."""

    positions: list[np.ndarray] = field(default_factory=list)
    normals: list[np.ndarray | None] = field(default_factory=list)
    colors: list[np.ndarray | None] = field(default_factory=list)
    corners: list[np.ndarray] = field(default_factory=list)
    vertices: int = 0
    bytes: int = 0
    left_out: int = 0  # primitives that are no triangles


class _Scene:
    def __init__(self, document: dict[str, Any], binary: bytes | None, folder: str, level: int) -> None:
        self._level = level
        self._document = document
        self._folder = folder
        self._buffers = [self._buffer(k, b, binary) for k, b in enumerate(document.get("buffers", []))]
        self._most = max(UNPACKED_ALWAYS, UNPACKED_AT_MOST * sum(map(len, self._buffers)))
        self._parts = _Parts()

    def polygons(self) -> Polygons:
        """All triangles, as polygons."""
        parts = self._parts
        reached: set[int] = set()
        waiting = [(node, np.eye(4)) for node in self._roots()]
        while waiting:
            node, above = waiting.pop()
            if node in reached:
                raise InvalidInput(f"its node {node} is reached twice; nodes are trees")
            reached.add(node)
            about = _item(self._document["nodes"], node)
            if self._level and (lower := _lower(about)):
                about = _item(self._document["nodes"], lower[min(self._level, len(lower)) - 1])
            with np.errstate(all="ignore"):
                matrix = above @ _transform(about)
            if not np.isfinite(matrix).all():
                raise InvalidInput(f"its node {node} has a transform that is not finite")
            if "mesh" in about:
                self._instance(_item(self._document["meshes"], about["mesh"]), matrix)
            waiting += [(child, matrix) for child in about.get("children", [])]
        if not parts.corners:
            raise InvalidInput("its scene has no triangles")
        corners = np.concatenate(parts.corners)
        used = {"left_out": f"{parts.left_out} primitives that are points or lines"} if parts.left_out else {}
        return Polygons(
            np.concatenate(parts.positions),
            corners,
            np.full(len(corners) // 3, 3),
            _stacked(parts.colors, parts.positions),
            None if any(n is None for n in parts.normals) else np.concatenate(parts.normals).astype(np.float32),
            used,
        )

    def _roots(self) -> list[int]:
        """Nodes of the default scene; without scenes those that are nobody's children."""
        if scenes := self._document.get("scenes"):
            return list(_item(scenes, self._document.get("scene", 0)).get("nodes", []))
        nodes = self._document.get("nodes", [])
        children = {child for node in nodes for child in node.get("children", [])}
        return [k for k in range(len(nodes)) if k not in children]

    # ---- bytes ----

    def _buffer(self, index: int, about: dict[str, Any], binary: bytes | None) -> bytes:
        uri = about.get("uri")
        if uri is None:
            if index != 0 or binary is None:
                raise InvalidInput(f"its buffer {index} is missing: it names no file, and no binary chunk is there")
            data = binary
        elif uri.startswith("data:"):
            data = base64.b64decode(uri.partition(",")[2], validate=True)
        else:
            file = os.path.join(self._folder, unquote(uri))
            if not os.path.isfile(file):
                raise InvalidInput(f"its buffer {index} is missing: there is no file {file}")
            with open(file, "rb") as opened:
                data = opened.read()
        if not 0 <= about["byteLength"] <= len(data):
            raise InvalidInput(f"its buffer {index} claims {about['byteLength']} bytes and has {len(data)}")
        return data[: about["byteLength"]]

    def _accessor(self, index: int, width: int) -> np.ndarray:
        """(N, width) numbers; integers that stand for 0 to 1 (or -1 to 1) as floats."""
        about = _item(self._document["accessors"], index)
        if "sparse" in about or "bufferView" not in about:
            raise InvalidInput(f"its accessor {index} is sparse or has no bufferView, which is not read")
        view = _item(self._document["bufferViews"], about["bufferView"])
        buffer = _item(self._buffers, view["buffer"])
        code = np.dtype(_TYPES[about["componentType"]])
        packed = code.itemsize * _WIDTHS[about["type"]]
        stride, count = view.get("byteStride", packed), about["count"]
        begin, offset = view.get("byteOffset", 0), about.get("byteOffset", 0)
        length = view["byteLength"]
        for number in (stride, count, begin, offset, length):
            if not isinstance(number, int) or number < 0:
                raise InvalidInput(f"its accessor {index} has the number {number!r}; whole ones from 0 are needed")
        if _WIDTHS[about["type"]] < width or stride < packed:
            raise InvalidInput(
                f"its accessor {index} is {about['type']}, every {stride} bytes; {width} numbers are needed"
            )
        last = offset + (count - 1) * stride + packed if count else 0
        if last > length or begin + length > len(buffer):
            end = begin + max(last, length)
            raise InvalidInput(f"its accessor {index} claims {count} elements, to byte {end} of {len(buffer)}")
        shape, strides = (count, width), (stride, code.itemsize)
        out = np.ndarray(shape, code, buffer, begin + offset, strides) if count else np.zeros(shape, code)
        if about.get("normalized") and code.kind != "f":
            return np.maximum(out / np.float64(np.iinfo(code).max), -1.0)
        return out

    # ---- nodes ----

    def _instance(self, mesh: dict[str, Any], matrix: np.ndarray) -> None:
        """Adds the triangles of a mesh under a transform."""
        placed: dict[tuple, int] = {}  # vertices by their accessors
        for primitive in mesh["primitives"]:
            mode = primitive.get("mode", _TRIANGLES)
            if mode not in (_TRIANGLES, _STRIP, _FAN):
                self._parts.left_out += 1
                continue
            named = primitive["attributes"]
            key = tuple(named.get(name) for name in ("POSITION", "NORMAL", "COLOR_0"))
            positions = self._accessor(named["POSITION"], 3)
            indices = self._accessor(primitive["indices"], 1)[:, 0] if "indices" in primitive else None
            if indices is not None and indices.dtype.kind != "u":
                raise InvalidInput("its indices are no unsigned whole numbers")
            self._count(24 * len(positions) + 24 * (len(positions) if indices is None else len(indices)))
            if key not in placed:
                placed[key] = self._parts.vertices
                self._vertices(positions, named, matrix)
            corners = _triangles(np.arange(len(positions)) if indices is None else indices.astype(np.int64), mode)
            if len(corners) and corners.max() >= len(positions):
                raise InvalidInput(f"a primitive names vertex {corners.max()} of {len(positions)}")
            if np.linalg.det(matrix[:3, :3]) < 0.0:  # mirrored
                corners = corners.reshape(-1, 3)[:, ::-1].reshape(-1)
            self._parts.corners.append(corners + placed[key])

    def _vertices(self, positions: np.ndarray, named: dict[str, int], matrix: np.ndarray) -> None:
        parts, turned = self._parts, matrix[:3, :3]
        moved = positions.astype(np.float64)
        normals = self._accessor(named["NORMAL"], 3).astype(np.float64) if "NORMAL" in named else None
        colors = None
        if "COLOR_0" in named:
            wide = _item(self._document["accessors"], named["COLOR_0"])["type"] == "VEC4"
            colors = _shown(self._accessor(named["COLOR_0"], 4 if wide else 3))
        if not np.array_equal(matrix, np.eye(4)):
            moved = moved @ turned.T + matrix[:3, 3]
            if normals is not None:
                normals = normals @ np.linalg.pinv(turned)
                normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
        if any(array is not None and len(array) != len(moved) for array in (normals, colors)):
            raise InvalidInput("a primitive has more or fewer normals or colours than positions")
        parts.positions.append(moved)
        parts.normals.append(normals)
        parts.colors.append(colors)
        parts.vertices += len(moved)

    def _count(self, size: int) -> None:
        """Refuses before memory is asked for: a few bytes can place a mesh a million times."""
        self._parts.bytes += size
        if self._parts.bytes > self._most:
            raise InvalidInput(
                f"its nodes place more than {self._most} bytes of vertices and indices, {UNPACKED_AT_MOST} times "
                "what its buffers hold"
            )


def _item(items: Any, index: Any) -> Any:
    """An item by an index that is a whole number from 0."""
    if not isinstance(index, int) or not 0 <= index < len(items):
        raise InvalidInput(f"it names item {index!r} of {len(items)}")
    return items[index]


def _shown(colors: np.ndarray) -> np.ndarray:
    """(V, 4) uint8, sRGB as everywhere else, of colours that are linear by the standard; alpha as it is."""
    most = 1.0 if colors.dtype.kind == "f" else np.iinfo(colors.dtype).max
    share = np.clip(np.nan_to_num(colors / most), 0.0, 1.0)
    linear = share[:, :3]
    share[:, :3] = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1.0 / 2.4) - 0.055)
    return as_bytes(share)


def _transform(node: dict[str, Any]) -> np.ndarray:
    """(4, 4) of a node beside its parent."""
    if "matrix" in node:
        return np.array(node["matrix"], np.float64).reshape(4, 4).T
    x, y, z, w = np.array(node.get("rotation", (0.0, 0.0, 0.0, 1.0)), np.float64)
    turn = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    out = np.eye(4)
    out[:3, :3] = turn * np.array(node.get("scale", (1.0, 1.0, 1.0)), np.float64)
    out[:3, 3] = node.get("translation", (0.0, 0.0, 0.0))
    return out


def _triangles(indices: np.ndarray, mode: int) -> np.ndarray:
    """Corners of triangles, strips and fans; what is left over at the end is nothing."""
    if mode == _TRIANGLES:
        return indices[: len(indices) // 3 * 3]
    if mode == _STRIP:
        return unrolled(indices, np.array([len(indices)]))
    if len(indices) < 3:
        return indices[:0]
    return np.stack([np.full(len(indices) - 2, indices[0]), indices[1:-1], indices[2:]], axis=1).reshape(-1)


def _stacked(colors: list[np.ndarray | None], positions: list[np.ndarray]) -> np.ndarray | None:
    """Colours of all vertices, white where a primitive has none; None where none has."""
    if all(c is None for c in colors):
        return None
    white = (np.full((len(p), 4), 255, np.uint8) for p in positions)
    return np.concatenate([w if c is None else c for c, w in zip(colors, white, strict=True)])
