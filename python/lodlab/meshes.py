# SPDX-License-Identifier: MIT
"""Meshes into files: .ply and .obj with double coordinates, .glb with its offset in the node's transform."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from .errors import InvalidInput
from .results import write_atomic

KINDS = (".ply", ".glb", ".obj")


def check_name(path: str | os.PathLike[str]) -> None:
    """InvalidInput unless a mesh can be written there."""
    file = Path(path)
    if file.suffix.lower() not in KINDS:
        raise InvalidInput(f"write mesh: {file.name} ends in none of {', '.join(KINDS)}")
    if not file.resolve().parent.is_dir():
        raise InvalidInput(f"write mesh: no directory {file.parent}")


def save(path: str | os.PathLike[str], mesh: Any) -> None:
    """Writes a `trimesh.Trimesh`; the format follows the file's ending."""
    check_name(path)
    file = Path(path)
    kind = file.suffix.lower()
    if kind == ".ply":
        write_atomic(file, ply(mesh.vertices, mesh.faces))
    elif kind == ".obj":
        write_atomic(file, obj(mesh.vertices, mesh.faces))
    else:
        write_atomic(file, glb(mesh))


def ply(vertices: np.ndarray, faces: np.ndarray) -> bytes:
    """A binary PLY: vertices (V, 3) as doubles, faces (F, 3) as 32-bit indices."""
    head = (
        "ply\nformat binary_little_endian 1.0\n"
        f"element vertex {len(vertices)}\nproperty double x\nproperty double y\nproperty double z\n"
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    rows = np.empty(len(faces), dtype=[("n", "u1"), ("v", "<i4", 3)])
    rows["n"] = 3
    rows["v"] = faces
    return head.encode() + np.ascontiguousarray(vertices, "<f8").tobytes() + rows.tobytes()


def obj(vertices: np.ndarray, faces: np.ndarray) -> str:
    """Wavefront OBJ; coordinates in the shortest form that reads back the same."""
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in np.asarray(vertices, np.float64).tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (np.asarray(faces) + 1).tolist()]
    return "\n".join(lines) + "\n"


def glb(mesh: Any) -> bytes:
    """Binary glTF. Its positions are floats, so the mesh's middle goes into the node's translation (double)."""
    import trimesh

    middle = np.round(mesh.bounds.mean(axis=0))
    local = trimesh.Trimesh(vertices=mesh.vertices - middle, faces=mesh.faces, process=False)
    scene = trimesh.Scene()
    scene.add_geometry(local, transform=trimesh.transformations.translation_matrix(middle))
    return scene.export(file_type="glb")
