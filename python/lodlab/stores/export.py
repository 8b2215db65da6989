# SPDX-License-Identifier: MIT
"""Meshes into files: .ply and .obj with double coordinates, .glb with its offset in the node's transform.

All carry a normal a vertex, and a colour where the mesh has them. What the mesh is of (source, CRS, budget, view)
stands in .glb as extras of its node, in the others as comments. Coordinates are the source's. Those of height fields
have z up; .glb, whose y is up by its standard, turns them in the node: x east, y up, z south. Meshes stay as they are.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from .. import _core
from ..disk import write_atomic
from ..errors import InvalidInput, StoreError, Unsupported

KINDS = (".ply", ".glb", ".obj")
Y_UP = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])


def check_name(path: str | os.PathLike[str]) -> None:
    """InvalidInput unless a mesh can be written there."""
    file = Path(path)
    if file.suffix.lower() not in KINDS:
        raise InvalidInput(f"write mesh: {file.name} ends in none of {', '.join(KINDS)}")
    if not file.resolve().parent.is_dir():
        raise InvalidInput(f"write mesh: no directory {file.parent}")


def save(
    path: str | os.PathLike[str], mesh: Any, about: Mapping[str, Any] | None = None, *, ground: bool = True
) -> None:
    """Writes a `trimesh.Trimesh`; the format follows the file's ending. `about`: what it is of, as JSON has it.
    `ground`: its z is up, which .glb turns."""
    check_name(path)
    file, about = Path(path), about or {}
    match file.suffix.lower():
        case ".glb":
            write_atomic(file, glb(mesh, about, Y_UP if ground else np.eye(4)))
        case kind:
            write_atomic(file, (ply if kind == ".ply" else obj)(mesh, about))


def about(store: Any, cut: Any, budget: Mapping[str, Any]) -> dict[str, Any]:
    """What a cut's mesh is of: source and CRS, method and options, budget and view."""
    view = cut.view
    seen = {name: list(getattr(view, name)) for name in ("eye", "target", "up", "size")} | {"fov": view.fov}
    return {
        "source": store.source_spec or f"array:{store.source_hash[:8]}",
        "source_hash": store.source_hash,
        "crs": getattr(store.source, "used", {}).get("crs"),
        "method": store.method,
        "options": {**store.options, **cut._session.options},
        "budget": dict(budget),
        "view": seen,
        "predicted_px": cut.predicted_px,
    }


# ---- what vertices carry --------------------------------------------------------------------------


def normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(V, 3) unit normals: those of the faces round a vertex, weighted by their areas; up where they cancel."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    across = np.cross(b - a, c - a)
    out = np.empty((len(vertices), 3))
    for axis in range(3):
        weights = np.repeat(across[:, axis], 3)
        out[:, axis] = np.bincount(faces.ravel(), weights, minlength=len(vertices))
    length = np.linalg.norm(out, axis=1, keepdims=True)
    return np.where(length > 0.0, out / np.where(length > 0.0, length, 1.0), (0.0, 0.0, 1.0))


def colors(store: Any, vertices: np.ndarray, pose: np.ndarray | None = None) -> np.ndarray | None:
    """(V, 4) uint8: the store's colour raster at its vertices, between texels linear; of a mesh those of the nearest
    vertices of its source, which a pose deforms; None where it has none.

    StoreError when the raster, which the option `attribute` names, or the source cannot be read any more.
    """
    if store.source_kind == "mesh":
        if not store.frame["colors"]:
            return None
        from scipy.spatial import KDTree

        source = store.source if pose is None else store.deformed(pose)
        return source.colors[KDTree(source.positions).query(vertices)[1]]
    file = store.options.get("attribute")
    if not file:
        return None
    if not hasattr(_core, "read_rgba8"):
        raise Unsupported("mesh: colours need a core built with OpenImageIO; colors=False leaves them out")
    try:
        image = np.asarray(_core.read_rgba8(file), np.float64)
    except (ValueError, OSError) as error:
        raise StoreError(f"mesh: the colours of {store.path}: {error}; colors=False leaves them out") from error
    frame = store.frame
    row, col = _grid_of(frame, np.asarray(vertices, np.float64))
    # The raster spans what the samples do: sample c is centred at c + 1/2.
    y = (row + 0.5) * (image.shape[0] / frame["rows"]) - 0.5
    x = (col + 0.5) * (image.shape[1] / frame["cols"]) - 0.5
    top, left = np.floor(y).astype(int), np.floor(x).astype(int)
    down, right = (y - top)[:, None], (x - left)[:, None]

    def texel(i: np.ndarray, j: np.ndarray) -> np.ndarray:
        across = j % image.shape[1] if frame["wraps"] else np.clip(j, 0, image.shape[1] - 1)
        return image[np.clip(i, 0, image.shape[0] - 1), across]

    upper = texel(top, left) * (1.0 - right) + texel(top, left + 1) * right
    lower = texel(top + 1, left) * (1.0 - right) + texel(top + 1, left + 1) * right
    return np.rint(upper * (1.0 - down) + lower * down).astype(np.uint8)


def _grid_of(frame: Mapping[str, Any], points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns, fractions among them, at which points lie."""
    x, y, z = points.T
    if not frame["planet"]:
        return (frame["y0"] - y) / frame["dy"], (x - frame["x0"]) / frame["dx"]
    longitude = np.degrees(np.arctan2(y, x))
    latitude = np.degrees(np.arctan2(z, np.hypot(x, y)))
    # East of the first column, by less than a turn; half a column west of it still counts as west.
    col = np.mod((longitude - frame["lon0"]) / frame["dlon"] + 0.5, 360.0 / frame["dlon"]) - 0.5
    return (frame["lat0"] - latitude) / frame["dlat"], col


def _carried(mesh: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray | None]:
    """Vertices, faces, normals and colours or None of a mesh."""
    vertices, faces = np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces)
    coloured = getattr(mesh.visual, "kind", None) == "vertex"
    return vertices, faces, normals(vertices, faces), np.asarray(mesh.visual.vertex_colors) if coloured else None


# ---- formats --------------------------------------------------------------------------------------


def _lines(about: Mapping[str, Any]) -> list[str]:
    """A line for each thing that is known, ASCII, without line ends of its own."""
    return [f"{name}: {json.dumps(_plain(value))}" for name, value in about.items()]


def _plain(value: Any) -> Any:
    """A value as JSON has it: numbers that are not finite are texts."""
    if isinstance(value, Mapping):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(v) for v in value]
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value


def ply(mesh: Any, about: Mapping[str, Any]) -> bytes:
    """A binary PLY: positions as doubles, normals as floats, colours as bytes, faces as 32-bit indices."""
    vertices, faces, normal, color = _carried(mesh)
    fields = [(name, "<f8", "double") for name in "xyz"] + [(f"n{name}", "<f4", "float") for name in "xyz"]
    if color is not None:
        fields += [(name, "u1", "uchar") for name in ("red", "green", "blue", "alpha")]
    columns = np.hstack([vertices, normal] if color is None else [vertices, normal, color])
    rows = np.empty(len(vertices), [(name, kind) for name, kind, _ in fields])
    for i, (name, _, _) in enumerate(fields):
        rows[name] = columns[:, i]
    corners = np.empty(len(faces), [("n", "u1"), ("v", "<i4", 3)])
    corners["n"], corners["v"] = 3, faces
    head = [
        "ply", "format binary_little_endian 1.0", *(f"comment {line}" for line in _lines(about)),
        f"element vertex {len(vertices)}", *(f"property {text} {name}" for name, _, text in fields),
        f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header",
    ]  # fmt: skip
    return "\n".join([*head, ""]).encode() + rows.tobytes() + corners.tobytes()


def obj(mesh: Any, about: Mapping[str, Any]) -> str:
    """Wavefront OBJ; coordinates in the shortest form that reads back the same, colours after them from 0 to 1."""
    vertices, faces, normal, color = _carried(mesh)
    shades = [""] * len(vertices)
    if color is not None:
        shades = [f" {r:.4g} {g:.4g} {b:.4g}" for r, g, b in (color[:, :3] / 255.0).tolist()]
    lines = [f"# {line}" for line in _lines(about)]
    lines += [f"v {x!r} {y!r} {z!r}{s}" for (x, y, z), s in zip(vertices.tolist(), shades, strict=True)]
    lines += [f"vn {x:.6g} {y:.6g} {z:.6g}" for x, y, z in normal.tolist()]
    lines += [f"f {a}//{a} {b}//{b} {c}//{c}" for a, b, c in (faces + 1).tolist()]
    return "\n".join(lines) + "\n"


def _linear(color: np.ndarray | None) -> np.ndarray | None:
    """sRGB bytes as linear ones; alpha as it is."""
    if color is None:
        return None
    share = color[:, :3] / 255.0
    linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    return np.hstack([np.rint(255.0 * linear).astype(np.uint8), color[:, 3:]])


def glb(mesh: Any, about: Mapping[str, Any], turn: np.ndarray) -> bytes:
    """Binary glTF. Its positions are floats, so the mesh's middle goes into the node's matrix (doubles), with a `turn`
    (4, 4). Colours are linear, as its standard has them; the material is dull, where none would be metal."""
    import trimesh

    vertices, faces, normal, color = _carried(mesh)
    middle = np.round(mesh.bounds.mean(axis=0))
    local = trimesh.Trimesh(
        vertices - middle, faces, vertex_normals=normal, vertex_colors=_linear(color), process=False
    )
    scene = trimesh.Scene()
    scene.add_geometry(local, transform=turn @ trimesh.transformations.translation_matrix(middle))

    def keep(tree: dict[str, Any]) -> None:
        node = next(node for node in tree["nodes"] if "mesh" in node)
        node["extras"] = _plain(about)
        tree["materials"] = [{"pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 1.0}}]
        tree["meshes"][node["mesh"]]["primitives"][0]["material"] = 0

    return trimesh.exchange.gltf.export_glb(scene, include_normals=True, tree_postprocessor=keep)
