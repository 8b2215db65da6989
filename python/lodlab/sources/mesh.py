# SPDX-License-Identifier: MIT
"""Triangle meshes: from arrays, trimesh objects and files. Any topology is a mesh; `census` says which it is.

Positions are in the source's own units; outside is where a triangle's vertices run counter-clockwise. The native
object (`_core.Mesh`) is immutable.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from typing import Any

import numpy as np

from .. import _core
from ..errors import InvalidInput, check_one_of
from .base import Source
from .mesh_files import format_of, read_levels, read_mesh
from .polygons import MeshData
from .raster import title
from .spec import format_spec
from .thumbnail import portrait

REPAIRS = ("weld", "degenerate", "duplicates", "orient", "split", "unused")
MOST_VERTICES = 2**32  # that 32-bit indices name
MOST_TRIANGLES = 2**31 // 3


def _array(what: str, values: Any, name: str, kinds: str, widths: tuple[int, ...]) -> np.ndarray:
    """What the caller gave as (N, width); InvalidInput for another dtype or shape."""
    try:
        array = np.asarray(values)
    except ValueError as error:
        raise InvalidInput(f"mesh: {what} of {name} are no array: {error}") from None
    if array.size == 0 and array.dtype.kind == "f":
        kinds += "f"  # an empty list
    if array.ndim != 2 or array.shape[1] not in widths or array.dtype.kind not in kinds:
        shapes = " or ".join(f"(N, {width})" for width in widths)
        numbers = "whole numbers" if "f" not in kinds else "real numbers"
        raise InvalidInput(f"mesh: {what} of {name} are {array.dtype} of shape {array.shape}, not {numbers} {shapes}")
    return array


def _faces(values: Any, vertices: int, name: str) -> np.ndarray:
    """(F, 3) uint32; InvalidInput names the first index that no 32 bits hold."""
    array = _array("faces", values, name, "iu", (3,))
    if vertices > MOST_VERTICES or len(array) > MOST_TRIANGLES:
        raise InvalidInput(
            f"mesh: {name} has {vertices} vertices and {len(array)} triangles; at most {MOST_VERTICES} and "
            f"{MOST_TRIANGLES} (2^31 indices) are possible"
        )
    if array.size and (int(array.min()) < 0 or int(array.max()) >= vertices):
        face, corner = np.argwhere((array < 0) | (array >= vertices))[0]
        raise InvalidInput(f"mesh: triangle {face} of {name} names vertex {array[face, corner]} of {vertices}")
    return np.array(array, np.uint32, order="C")


def _colors(values: Any, name: str) -> np.ndarray:
    """(V, 4) uint8 from bytes, or from floats of 0 to 1."""
    array = _array("colours", values, name, "iuf", (3, 4))
    if array.dtype.kind == "f":
        if not (array.size == 0 or 0.0 <= array.min() <= array.max() <= 1.0):
            raise InvalidInput(f"mesh: colours of {name} are floats outside 0 to 1")
        array = np.rint(array * 255.0)
    elif array.size and not 0 <= int(array.min()) <= int(array.max()) <= 255:
        raise InvalidInput(f"mesh: colours of {name} are whole numbers outside 0 to 255")
    out = np.full((len(array), 4), 255, np.uint8)
    out[:, : array.shape[1]] = array
    return out


class Mesh(Source):
    """Triangles that index vertices.

    Parameters
    ----------
    positions: (V, 3) real numbers, finite, within 1e30; or a trimesh object, whose vertex colours are kept.
    faces: (F, 3) whole numbers from 0 to V - 1, at least one, at most 2^31 / 3.
    colors: (V, 3 or 4), whole numbers of 0 to 255 or floats of 0 to 1.
    normals: (V, 3), as the author wants them for shading; the geometry's own are the triangles'.

    Raises
    ------
    InvalidInput: dtype, shape, an index out of range (the first is named), a position that is not finite.
    """

    def __init__(
        self,
        positions: Any,
        faces: Any = None,
        colors: Any = None,
        normals: Any = None,
        *,
        name: str = "arrays",
    ) -> None:
        if faces is None:
            positions, faces, colors = _of_trimesh(positions, colors)
        points = _array("positions", positions, name, "iuf", (3,))
        triangles = _faces(faces, len(points), name)  # before anything is copied
        self._hold(
            MeshData(
                np.array(points, np.float64, order="C"),
                triangles,
                None if colors is None else _colors(colors, name),
                None if normals is None else np.array(_array("normals", normals, name, "iuf", (3,)), np.float32),
            ),
            name,
            "",
        )

    @classmethod
    def made(cls, data: MeshData, name: str, spec: str) -> Mesh:
        """A mesh of arrays that nobody else holds, of the native types."""
        mesh = cls.__new__(cls)
        mesh._hold(data, name, spec)
        return mesh

    @classmethod
    def open(cls, path: str | os.PathLike[str], repair: str | Iterable[str] | None = None) -> Mesh:
        """Reads a mesh file: PLY, OBJ, STL, OFF, glTF or GLB, each also gzipped (`.ply.gz`).

        Polygons become triangles, triangle strips too; vertex colours and normals are kept; `used` says what was
        done. `repair`: as `repaired` has it; nothing is repaired unasked.

        InvalidInput names the path: missing, unreadable, damaged, without triangles; and as the constructor.
        """
        text = os.fspath(path)
        wanted = repairs_of(repair)
        return _opened(read_mesh(text), text, wanted)

    def repaired(self, repair: str | Iterable[str] = "all") -> Mesh:
        """This mesh with what is asked for mended; `used` lists it, counted. No vertex moves, and each keeps its colour
        and normal. Names with commas between them, or "all"; always done in this order:

        weld: vertices at equal positions become the first of them.
        degenerate: triangles that name a vertex twice or have no area are left out.
        duplicates: triangles that name the vertices of an earlier one, in either sense, are left out.
        orient: neighbours run alike, as most of their component do; all are turned where the mesh, open by less than a
            tenth of its area, is inside out.
        split: vertices are doubled until no edge has three triangles and no vertex two fans.
        unused: vertices that no triangle names are left out.
        """
        wanted = repairs_of(repair)
        origin, faces, counts = self._core.repaired(**dict.fromkeys(wanted, True))
        arrays = (None if a is None else a[origin] for a in (self.colors, self.normals))
        before = [self.used["repaired"]] if "repaired" in self.used else []
        used = self.used | {"repaired": ", ".join(before + [_said(name, counts) for name in wanted])}
        spec = format_spec(self.spec, {"repair": ",".join(wanted)}) if format_of(self.spec) else ""
        return Mesh.made(MeshData(self.positions[origin], faces, *arrays, used), self.name, spec)

    def _hold(self, data: MeshData, name: str, spec: str) -> None:
        self._core = _core.Mesh(data.positions, data.faces, data.colors, data.normals, spec=spec)
        self.name = name
        self.used = data.used
        self._census: dict[str, Any] | None = None

    @property
    def core(self) -> Any:
        """The native mesh."""
        return self._core

    @property
    def kind(self) -> str:
        return "mesh"

    @property
    def positions(self) -> np.ndarray:
        """(V, 3) float64. Read-only."""
        return self._core.positions

    @property
    def faces(self) -> np.ndarray:
        """(F, 3) uint32, counter-clockwise from outside. Read-only."""
        return self._core.faces

    @property
    def colors(self) -> np.ndarray | None:
        """(V, 4) uint8, or None. Read-only."""
        return self._core.colors

    @property
    def normals(self) -> np.ndarray | None:
        """(V, 3) float32 as the source gives them, or None. Read-only."""
        return self._core.normals

    @property
    def bounds(self) -> np.ndarray:
        """(2, 3) float64: least and largest coordinates of the vertices that triangles use."""
        return self._core.bounds

    @property
    def extent(self) -> float:
        """The diagonal of its bounds."""
        return float(np.linalg.norm(self.bounds[1] - self.bounds[0]))

    @property
    def census(self) -> dict[str, Any]:
        """What kind of surface it is, counted by indices: `components` (triangles joined by vertices),
        `boundary_edges` (of one triangle), `nonmanifold_edges` (of three or more), `nonmanifold_vertices` (of several
        fans), `genus` (over all components, holes closed; None where something is not manifold or one-sided),
        `duplicate_triangles` (the vertices of an earlier one, in either sense), `degenerate_triangles` (a vertex twice,
        or no area), `unused_vertices`, `oriented` (no two triangles run along an edge in the same sense)."""
        if self._census is None:
            self._census = self._core.census()
        return dict(self._census)

    @property
    def samples(self) -> int:
        """Vertices."""
        return len(self.positions)

    def thumbnail(self, width: int = 256) -> np.ndarray:
        """The mesh from its front, upper right, (width, width, 3) uint8; y up."""
        return portrait(self, width)

    def __getstate__(self) -> dict[str, Any]:
        """What a worker process needs to have the same mesh."""
        arrays = (self.positions, self.faces, self.colors, self.normals)
        return {"arrays": arrays, "spec": self.spec, "name": self.name, "used": self.used}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self._hold(MeshData(*state["arrays"], state["used"]), state["name"], state["spec"])

    def __repr__(self) -> str:
        parts = [f"{self.samples} vertices", f"{len(self.faces)} triangles", f"extent {self.extent:.6g}"]
        parts += ["colours"] if self.colors is not None else []
        return f"<Mesh {self.name}: {', '.join(parts)}>"


def levels_of_file(path: str) -> list[Mesh]:
    """The levels that a file holds, the finest first: several of a glTF file with MSFT_lod; none of what is no mesh
    file by its name."""
    if format_of(path) is None:
        return []
    return [_opened(data, path) for data in read_levels(path)]


def _opened(data: MeshData, text: str, repairs: tuple[str, ...] = ()) -> Mesh:
    """The mesh of what a file held; InvalidInput names the path."""
    try:
        mesh = Mesh.made(data, title(text), os.path.abspath(text))
        return mesh.repaired(repairs) if repairs else mesh
    except InvalidInput as error:
        raise InvalidInput(f"open {text}: {str(error).removeprefix('mesh: ')}") from None


def repairs_of(repair: str | Iterable[str] | None) -> tuple[str, ...]:
    """The repairs that a text or list names, in the order in which they are done."""
    names = [n.strip() for n in repair.split(",")] if isinstance(repair, str) else list(repair or ())
    for name in names:
        check_one_of("mesh: repair", name, (*REPAIRS, "all"))
    return REPAIRS if "all" in names else tuple(name for name in REPAIRS if name in names)


def _said(name: str, counts: dict[str, Any]) -> str:
    """What a repair did, for people."""
    match name:
        case "weld":
            return f"welded {counts['welded']} vertices"
        case "orient":
            turned = f"turned {counts['turned']} triangles"
            turned += ", then all of them, which were inside out" if counts["inside_out"] else ""
            return turned + (" (a component has one side only)" if counts["one_sided"] else "")
        case "split":
            return f"split off {counts['split']} vertices"
        case "unused":
            return f"left out {counts['unused']} unused vertices"
    return f"left out {counts[name]} {name.removesuffix('s')} triangles"


def is_trimesh(value: Any) -> bool:
    """Whether it is one of trimesh's meshes, without importing trimesh."""
    return hasattr(value, "vertices") and hasattr(value, "faces")


def _of_trimesh(value: Any, colors: Any) -> tuple[Any, Any, Any]:
    """Positions, faces and colours of a trimesh object."""
    if not is_trimesh(value):
        raise InvalidInput(f"mesh: {type(value).__name__} is no trimesh object, and no faces are given")
    if colors is None and getattr(getattr(value, "visual", None), "kind", None) == "vertex":
        colors = value.visual.vertex_colors
    return value.vertices, value.faces, colors
