# SPDX-License-Identifier: MIT
"""PLY files: ASCII, little and big endian, any properties beside, faces of any size, triangle strips with restart.

A file is a header and the rows of its elements. Text is first read as numbers and then as a binary file of doubles,
so that there is one way to read rows: as one structured array where all lists are as long as the first row's, else
row by row for where the lists lie, which are then fetched at once.
"""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass, field
from typing import NoReturn

import numpy as np

from ..errors import InvalidInput
from .polygons import Polygons, as_bytes, numbers, unrolled

_TYPES = {
    "i1": ("char", "int8"), "u1": ("uchar", "uint8"), "i2": ("short", "int16"), "u2": ("ushort", "uint16"),
    "i4": ("int", "int32"), "u4": ("uint", "uint32"), "f4": ("float", "float32"), "f8": ("double", "float64"),
}  # fmt: skip
_CODES = {name: code for code, names in _TYPES.items() for name in names}
_STRUCT = {"i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I", "f4": "f", "f8": "d"}
_FORMATS = {"ascii": "=", "binary_little_endian": "<", "binary_big_endian": ">"}
_LONGEST_HEADER = 1 << 20
_INDICES = ("vertex_indices", "vertex_index")
_COLORS = (("red", "green", "blue", "alpha"), ("diffuse_red", "diffuse_green", "diffuse_blue", "alpha"))


@dataclass
class _Property:
    name: str
    code: str  # of a value
    count: str | None = None  # of the number before a list


@dataclass
class _Element:
    name: str
    rows: int
    properties: list[_Property] = field(default_factory=list)

    def as_text(self) -> _Element:
        """Its rows once their text is read: doubles."""
        return _Element(self.name, self.rows, [_Property(p.name, "f8", p.count and "f8") for p in self.properties])


def read_ply(data: bytes, path: str) -> Polygons:
    """The polygons of a PLY file. InvalidInput names the path."""
    order, elements, begin = _header(data, path)
    body = memoryview(data)[begin:]
    declared = elements
    if order == "=":
        body = memoryview(numbers(bytes(body), path).tobytes())
        elements = [
            _Element(e.name, e.rows, [_Property(p.name, "f8", p.count and "f8") for p in e.properties])
            for e in elements
        ]
    reader = _Rows(body, order, path)
    found = {}
    for element, as_declared in zip(elements, declared, strict=True):
        columns = reader.read(element)
        if element.name not in found:
            found[element.name] = (as_declared, columns)
    if "vertex" not in found:
        raise InvalidInput(f"open {path}: its header declares no element vertex")
    used: dict[str, str] = {}
    positions, colors, normals = _vertices(*found["vertex"], used, path)
    corners, sizes = _faces(found, used, path)
    return Polygons(positions, corners, sizes, colors, normals, used)


# ---- the header -----------------------------------------------------------------------------------


def _header(data: bytes, path: str) -> tuple[str, list[_Element], int]:
    """Byte order ("=": text), elements, and where the rows begin."""

    def refuse(why: str) -> NoReturn:
        raise InvalidInput(f"open {path}: {why}")

    if not re.match(rb"ply\s", data):
        refuse("it does not begin with the word ply")
    end = re.search(rb"(?<=[\r\n])end_header[ \t]*(\r\n|\n|\r)", data[:_LONGEST_HEADER])
    if end is None:
        refuse(f"its header does not end within {_LONGEST_HEADER} bytes")
    order = None
    elements: list[_Element] = []
    for line in data[: end.start()].decode("latin-1").splitlines()[1:]:
        words = line.split()
        match words:
            case [] | ["comment" | "obj_info", *_]:
                pass
            case ["format", kind, "1.0"] if kind in _FORMATS:
                order = _FORMATS[kind]
            case ["element", name, rows] if rows.isdecimal() and len(rows) < 20:
                elements.append(_Element(name, int(rows)))
            case ["property", "list", count, code, name] if elements and count in _CODES and code in _CODES:
                elements[-1].properties.append(_Property(name, _CODES[code], _CODES[count]))
            case ["property", code, name] if elements and code in _CODES:
                elements[-1].properties.append(_Property(name, _CODES[code]))
            case _:
                refuse(f"its header has the line {line[:80]!r}")
    if order is None:
        refuse("its header declares no format")
    for element in elements:
        names = [p.name for p in element.properties]
        if len(set(names)) < len(names):
            refuse(f"its element {element.name} has two properties of one name")
    return order, elements, end.end()


# ---- rows -----------------------------------------------------------------------------------------

Column = tuple[np.ndarray, np.ndarray | None]  # values, and how many of them each row has (None: one)


class _Rows:
    """Reads the rows of one element after the other."""

    def __init__(self, body: memoryview, order: str, path: str) -> None:
        self._body, self._order, self._path = body, order, path
        self._bytes = np.frombuffer(body, np.uint8)
        self._at = 0

    def read(self, element: _Element) -> dict[str, Column]:
        """The columns of an element by name. InvalidInput when its rows are not all there."""
        least = sum(np.dtype(p.count or p.code).itemsize for p in element.properties)
        left = len(self._body) - self._at
        if element.rows * least > left:
            raise InvalidInput(
                f"open {self._path}: its header claims {element.rows} rows of element {element.name}, at least {least} "
                f"bytes each; {left} bytes are left: it is cut short or its header is wrong"
            )
        if not element.rows or not element.properties:
            return {
                p.name: (np.zeros(0, p.code), np.zeros(0, np.int64) if p.count else None) for p in element.properties
            }
        return self._uniform(element) or self._walk(element)

    def _uniform(self, element: _Element) -> dict[str, Column] | None:
        """All rows at once, where every row's lists are as long as the first row's."""
        fields: list[tuple] = []
        lengths = {}
        at = self._at
        for p in element.properties:
            if p.count:
                size = np.dtype(p.count).itemsize
                if at + size > len(self._body):
                    return None
                length = float(np.frombuffer(self._body, self._order + p.count, 1, at)[0])
                if not (0 <= length <= len(self._body)) or length != int(length):
                    return None
                lengths[p.name] = int(length)
                fields.append((f"{p.name} count", self._order + p.count))
                fields.append((p.name, self._order + p.code, (int(length),)))
                at += size + int(length) * np.dtype(p.code).itemsize
            else:
                fields.append((p.name, self._order + p.code))
                at += np.dtype(p.code).itemsize
            if at > len(self._body):
                return None
        step = at - self._at
        if element.rows * step > len(self._body) - self._at:
            return None
        table = np.frombuffer(self._body, np.dtype(fields), element.rows, self._at)
        if any((table[f"{name} count"] != length).any() for name, length in lengths.items()):
            return None
        self._at += element.rows * step
        return {
            p.name: (table[p.name].reshape(-1), np.full(element.rows, lengths[p.name]) if p.count else None)
            for p in element.properties
        }

    def _walk(self, element: _Element) -> dict[str, Column]:
        """Row by row for where values lie."""
        starts: dict[str, list[int]] = {p.name: [] for p in element.properties}
        sizes: dict[str, list[int]] = {p.name: [] for p in element.properties}
        steps = [
            (starts[p.name].append, sizes[p.name].append, np.dtype(p.code).itemsize,
             p.count and struct.Struct(self._order + _STRUCT[p.count]))
            for p in element.properties
        ]  # fmt: skip
        at, end, body, row = self._at, len(self._body), self._body, 0
        try:
            for row in range(element.rows):  # noqa: B007 - named in the refusal
                for start, size, width, count in steps:
                    length = 1
                    if count:
                        length = int(count.unpack_from(body, at)[0])
                        if length < 0:
                            raise ValueError
                        at += count.size
                    start(at)
                    size(length)
                    at += length * width
                if at > end:
                    raise ValueError
        except (struct.error, ValueError, OverflowError):
            raise InvalidInput(
                f"open {self._path}: row {row} of {element.rows} of its element {element.name} is damaged or cut short"
            ) from None
        self._at = at
        return {p.name: self._fetch(p, np.array(starts[p.name]), np.array(sizes[p.name])) for p in element.properties}

    def _fetch(self, p: _Property, starts: np.ndarray, sizes: np.ndarray) -> Column:
        width = np.dtype(p.code).itemsize
        ends = np.cumsum(sizes)
        at = np.repeat(starts - (ends - sizes) * width, sizes) + np.arange(int(sizes.sum())) * width
        values = np.empty((len(at), width), np.uint8)
        for byte in range(width):
            values[:, byte] = self._bytes[at + byte]
        return values.reshape(-1).view(self._order + p.code), sizes if p.count else None


# ---- meaning --------------------------------------------------------------------------------------


def _vertices(
    element: _Element, columns: dict[str, Column], used: dict[str, str], path: str
) -> tuple[np.ndarray, np.ndarray | None, np.ndarray | None]:
    """Positions, colours and normals; a number of text is rounded to the type that the header declares."""
    codes = {p.name: p.code for p in element.properties if not p.count}

    def block(names: tuple[str, ...]) -> np.ndarray:
        with np.errstate(over="ignore", invalid="ignore"):
            return np.stack([columns[name][0].astype(codes[name]) for name in names], axis=1)

    if missing := [name for name in "xyz" if name not in codes]:
        raise InvalidInput(f"open {path}: its element vertex has no property {missing[0]}")
    taken = {"x", "y", "z"}
    colors = normals = None
    if all(name in codes for name in ("nx", "ny", "nz")):
        normals = block(("nx", "ny", "nz")).astype(np.float32)
        taken |= {"nx", "ny", "nz"}
    for names in _COLORS:
        if colors is None and all(name in codes for name in names[:3]):
            names = names if names[3] in codes else names[:3]
            colors = as_bytes(block(names))
            taken |= set(names)
    if rest := [p.name for p in element.properties if p.name not in taken]:
        used["ignored"] = f"of vertices {', '.join(rest)}"
    return block(("x", "y", "z")).astype(np.float64), colors, normals


def _faces(
    found: dict[str, tuple[_Element, dict[str, Column]]], used: dict[str, str], path: str
) -> tuple[np.ndarray, np.ndarray]:
    """Corners and sizes of faces and strips."""
    corners, sizes = [], []
    for name in ("face", "tristrips"):
        if name not in found:
            continue
        element, columns = found[name]
        indices = next((columns[i] for i in _INDICES if i in columns and columns[i][1] is not None), None)
        if indices is None:
            raise InvalidInput(f"open {path}: its element {name} has no list {' or '.join(_INDICES)}")
        values, lengths = indices
        if name == "tristrips":
            values = unrolled(values, lengths)
            lengths = np.full(len(values) // 3, 3)
            used["strips"] = f"triangle strips, as {len(lengths)} triangles"
        corners.append(values)
        sizes.append(lengths)
    if not corners:
        raise InvalidInput(f"open {path}: its header declares neither faces nor triangle strips")
    return np.concatenate(corners), np.concatenate(sizes)
