# SPDX-License-Identifier: MIT
"""Wavefront OBJ files: vertices, with colours behind them where a program wrote such, normals, faces of any size.

Faces name places and normals apart; a vertex is a place, and normals are kept where each vertex has one.
"""

from __future__ import annotations

import re

import numpy as np

from ..errors import InvalidInput
from .polygons import Polygons, as_bytes, lines_of_numbers, numbers


def read_obj(data: bytes, path: str) -> Polygons:
    """The polygons of an OBJ file. InvalidInput names the path."""
    if b"\\" in data:
        data = re.sub(rb"\\[ \t]*\r?\n", b" ", data)
    if b"#" in data:
        data = re.sub(rb"#[^\r\n]*", b"", data)
    lines = [line.strip() for line in data.splitlines()]

    def of(word: bytes) -> list[bytes]:
        begins = (word + b" ", word + b"\t")
        return [line[len(word) :] for line in lines if line.startswith(begins)]

    positions, colors = _vertices(of(b"v"), path)
    faces = of(b"f")
    text = b"\n".join(faces)
    places, _, sizes = lines_of_numbers(re.sub(rb"/\S*", b"", text) if b"/" in text else text, path)
    corners = _from_zero(places, sizes, lines, b"v", len(positions), path)
    used: dict[str, str] = {}
    normals = None
    if directions := of(b"vn"):
        table = numbers(b"\n".join(directions), path)
        if len(table) == 3 * len(directions) and text.count(b"/") == 2 * len(corners):
            index = numbers(re.sub(rb"\S*/", b"", text), path)
            if len(index) == len(corners):
                normals = _normals(
                    corners, _from_zero(index, sizes, lines, b"vn", len(directions), path), table, len(positions)
                )
        if normals is None:
            used["ignored"] = "normals, of which vertices have several or none"
    return Polygons(positions, corners, sizes, colors, normals, used)


def _vertices(lines: list[bytes], path: str) -> tuple[np.ndarray, np.ndarray | None]:
    """Positions, and colours where every line has three numbers more."""
    values, starts, sizes = lines_of_numbers(b"\n".join(lines), path)
    bad = (sizes < 3) | (sizes > 7)
    if len(sizes) != len(lines) or bad.any():
        vertex = int(np.argmax(bad)) if bad.any() else len(sizes)
        raise InvalidInput(f"open {path}: vertex {vertex} has fewer numbers than 3 or more than 7")
    positions = values[starts[:, None] + np.arange(3)] if len(starts) else np.zeros((0, 3))
    if not len(sizes) or (sizes < 6).any():
        return positions, None
    last = starts + sizes - 3
    return positions, as_bytes(values[last[:, None] + np.arange(3)])


def _from_zero(
    values: np.ndarray, sizes: np.ndarray, lines: list[bytes], word: bytes, count: int, path: str
) -> np.ndarray:
    """Indices that count from 1, or backwards from the last line that begins with `word`, as those that count from 0.
    InvalidInput names one that names nothing."""
    if not (values < 0).any():
        out = values - 1
    else:
        begins = (word + b" ", word + b"\t")
        defined = np.cumsum([line.startswith(begins) for line in lines])
        at = np.array([k for k, line in enumerate(lines) if line.startswith((b"f ", b"f\t"))], np.int64)
        before = np.repeat(defined[at], sizes) if len(at) == len(sizes) else np.full(len(values), count)
        out = np.where(values < 0, before + values, values - 1)
    bad = ~((out >= 0) & (out < count) & (out == np.floor(out)))
    if bad.any():
        face = int(np.searchsorted(np.cumsum(sizes), int(np.argmax(bad)), side="right"))
        raise InvalidInput(f"open {path}: face {face} names {word.decode()} {values[bad][0]:g} of {count}")
    return out.astype(np.int64)


def _normals(corners: np.ndarray, index: np.ndarray, table: np.ndarray, vertices: int) -> np.ndarray | None:
    """(V, 3) float32 where all corners at a vertex name the same direction; 0 at vertices without corners."""
    directions = table.reshape(-1, 3)
    out = np.zeros((vertices, 3))
    out[corners] = directions[index]
    same = (out[corners] == directions[index]).all()
    return out.astype(np.float32) if same else None
