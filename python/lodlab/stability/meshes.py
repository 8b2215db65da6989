# SPDX-License-Identifier: MIT
"""Meshes of the scenes and of the random search: shapes made for one failure each, known by a name, and recipes of
random ones. Every name has `mesh` in it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ..paths.path import CameraPath
from ..sources import shapes
from ..sources.mesh import Mesh

Arrays = tuple[np.ndarray, np.ndarray]  # positions (V, 3), faces (F, 3)

TRIANGLE: Arrays = (np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), np.array([[0, 1, 2]]))
TETRAHEDRON: Arrays = (np.vstack([np.zeros(3), np.eye(3)]), np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]))
TORUS = {"rings": 32, "sides": 16}


def _of(mesh: Mesh) -> Arrays:
    return np.array(mesh.positions), np.array(mesh.faces, np.int64)


def joined(*parts: Arrays) -> Arrays:
    """The parts side by side, none sharing a vertex with another."""
    first = np.cumsum([0, *(len(p) for p, _ in parts)])
    return np.vstack([p for p, _ in parts]), np.vstack([f + n for (_, f), n in zip(parts, first, strict=False)])


def moved(arrays: Arrays, by: Any, size: Any = 1.0) -> Arrays:
    return arrays[0] * size + np.asarray(by, float), arrays[1]


def bowl(level: int) -> Arrays:
    """The lower half of a sphere, open."""
    positions, faces = _of(shapes.icosphere(level))
    return positions, faces[positions[faces][:, :, 2].max(axis=1) < 0.1]


def needles(sides: int) -> Arrays:
    """A tube 10 long and 0.01 thick, open at both ends: triangles thousands of times as long as wide."""
    angle = np.arange(sides) * (2.0 * np.pi / sides)
    ring = 0.005 * np.stack([np.cos(angle), np.sin(angle), np.zeros(sides)], axis=1)
    a = np.arange(sides)
    b = (a + 1) % sides
    faces = np.vstack([np.stack([a, b, b + sides], axis=1), np.stack([a, b + sides, a + sides], axis=1)])
    return np.vstack([ring, ring + [0.0, 0.0, 10.0]]), faces


def plate(cells: int, heights: Callable[[np.ndarray, np.ndarray], np.ndarray] | None = None) -> Arrays:
    """The unit square in cells x cells, outside up."""
    at = np.linspace(0.0, 1.0, cells + 1)
    x, y = (v.ravel() for v in np.meshgrid(at, at))
    row, col = np.divmod(np.arange(cells * cells), cells)
    a = row * (cells + 1) + col
    faces = np.stack([a, a + 1, a + cells + 2, a, a + cells + 2, a + cells + 1], axis=1).reshape(-1, 3)
    return np.stack([x, y, np.zeros_like(x) if heights is None else heights(x, y)], axis=1), faces


def folds(cells: int) -> Arrays:
    """The unit square, open, in two waves across whose crests and troughs bulge beyond their necks."""
    positions, faces = plate(cells)
    x, y, _ = positions.T
    turn = 4.0 * np.pi * x
    return np.stack([x + 0.12 * np.sin(2.0 * turn), y, 0.2 * np.cos(turn)], axis=1), faces


def revolved(profile: np.ndarray, sides: int) -> Arrays:
    """Closed, round z: of a profile (N, 2) of distances to the axis and heights that runs from its top end on the axis
    down to the other."""
    angle = np.arange(sides) * (2.0 * np.pi / sides)
    rings = profile[1:-1]
    round_z = np.stack([np.outer(rings[:, 0], np.cos(angle)), np.outer(rings[:, 0], np.sin(angle))], axis=-1)
    z = np.repeat(rings[:, 1], sides)
    ends = np.array([[0.0, 0.0, profile[0, 1]], [0.0, 0.0, profile[-1, 1]]])
    row, a = np.divmod(np.arange((len(rings) - 1) * sides), sides)
    b = row * sides + (a + 1) % sides
    a = row * sides + a
    one = np.arange(sides)
    top, bottom = len(z), len(z) + 1
    last = top - sides
    faces = [
        np.stack([np.full(sides, top), one, (one + 1) % sides], axis=1),
        np.stack([a, a + sides, b], axis=1),
        np.stack([b, a + sides, b + sides], axis=1),
        np.stack([np.full(sides, bottom), last + (one + 1) % sides, last + one], axis=1),
    ]
    return np.vstack([np.column_stack([round_z.reshape(-1, 2), z]), ends]), np.vstack(faces)


def mushroom(steps: int, sides: int) -> Arrays:
    """A cap whose rim curls under, on a stem: closed."""
    t = np.linspace(0.0, 1.0, steps + 1)
    corners = [[0, 1], [0.6, 0.9], [1, 0.5], [0.9, 0.35], [0.55, 0.75], [0.25, 0.85], [0.25, 0], [0.35, -0.9], [0, -1]]
    bends = np.array(corners, float)
    for _ in range(3):  # cut corners (Chaikin), the ends kept
        cut = np.stack([0.75 * bends[:-1] + 0.25 * bends[1:], 0.25 * bends[:-1] + 0.75 * bends[1:]], axis=1)
        bends = np.vstack([bends[:1], cut.reshape(-1, 2), bends[-1:]])
    along = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(bends, axis=0), axis=1))]
    return revolved(np.stack([np.interp(t * along[-1], along, side) for side in bends.T], axis=1), sides)


def ribbon(cells: int) -> Arrays:
    """A Moebius strip, which has one side."""
    u = np.linspace(0.0, 2.0 * np.pi, cells, endpoint=False)
    rims = [
        np.stack([(1 + s * np.cos(u / 2)) * np.cos(u), (1 + s * np.cos(u / 2)) * np.sin(u), s * np.sin(u / 2)], axis=1)
        for s in (-0.3, 0.3)
    ]
    a = np.arange(cells)
    b, c = a + cells, (a + 1) % cells + cells
    d = (a + 1) % cells
    c[-1], d[-1] = 0, cells  # the rims change places
    return np.vstack(rims), np.vstack([np.stack([a, d, c], axis=1), np.stack([a, c, b], axis=1)])


def _every(arrays: Arrays, step: int, act: Callable[[np.ndarray], np.ndarray]) -> Arrays:
    """Every so manyth triangle put in the place of itself as changed."""
    faces = arrays[1].copy()
    faces[::step] = act(faces[::step])
    return arrays[0], faces


def _ball() -> Arrays:
    return _of(shapes.icosphere(3))


#: Made for one failure each.
MADE: dict[str, Callable[[], Arrays]] = {
    "mesh:closed": _ball,
    "mesh:open": lambda: bowl(3),
    "mesh:genus 1": lambda: _of(shapes.torus(**TORUS)),
    "mesh:two components": lambda: joined(_of(shapes.icosphere(2)), moved(_of(shapes.torus(16, 8)), [0.4, 0.2, 0.9])),
    "mesh:two with many levels": lambda: joined(
        _of(shapes.icosphere(4)), moved(_of(shapes.torus(64, 32)), [0.4, 0.2, 0.9])
    ),
    "mesh:slivers": lambda: needles(60),
    "mesh:one triangle": lambda: TRIANGLE,
    "mesh:tetrahedron": lambda: TETRAHEDRON,
    "mesh:fractal": lambda: _of(shapes.blob(33)),
    "mesh:fine": lambda: _of(shapes.blob(193)),
    "mesh:three on one edge": lambda: joined(
        (
            np.array([[0, 0, 0], [0, 0, 1], [1, 0, 0], [0, 1, 0], [-1, -1, 0]], float),
            np.array([[0, 1, 2], [0, 1, 3], [0, 1, 4]]),
        ),
        moved(_of(shapes.icosphere(2)), [3, 0, 0]),
    ),
    "mesh:two fans on one vertex": lambda: (
        np.vstack([TETRAHEDRON[0], -TETRAHEDRON[0][1:]]),
        np.vstack([TETRAHEDRON[1], [[0, 4, 5], [0, 6, 4], [4, 6, 5], [0, 5, 6]]]),
    ),
    "mesh:turned triangles": lambda: _every(_ball(), 7, lambda f: f[:, ::-1]),
    "mesh:inside out": lambda: _every(_ball(), 1, lambda f: f[:, ::-1]),
    "mesh:duplicates": lambda: (_ball()[0], np.vstack([_ball()[1], _ball()[1][::5], _ball()[1][::9, ::-1]])),
    "mesh:no area": lambda: (_ball()[0], np.vstack([_ball()[1], np.repeat(_ball()[1][::5, :1], 3, axis=1)])),
    "mesh:unused vertices": lambda: (np.vstack([_ball()[0], 100.0 * _ball()[0]]), _ball()[1]),
    "mesh:one side": lambda: ribbon(60),
    "mesh:far away": lambda: moved(_ball(), [6.4e6, -6.4e6, 1e5], 1000.0),
    "mesh:nothing": lambda: (np.zeros((0, 3)), np.zeros((0, 3), np.int64)),
    "mesh:folds": lambda: folds(48),
    "mesh:mushroom": lambda: mushroom(96, 48),
    "mesh:nested shells": lambda: joined(_of(shapes.icosphere(4)), moved(_of(shapes.icosphere(4)), [0, 0, 0], 0.97)),
    "mesh:flat ring": lambda: moved(_of(shapes.torus(64, 32)), [0, 0, 0], [1.0, 1.0, 0.05]),
}
#: The least distance between two sheets of those that lie over themselves, but for where they bend into one another.
FOLDED = {"mesh:folds": 0.13, "mesh:mushroom": 0.1, "mesh:nested shells": 0.029, "mesh:flat ring": 0.04}
REFUSED = ("mesh:nothing",)  # no mesh, by Mesh's own rule
SOUND = ("closed", "open", "genus 1", "two components", "slivers", "one triangle", "tetrahedron")  # what contracts use


def doubled(source: Any) -> bool:
    """Whether it is a mesh with triangles that lie on others."""
    return isinstance(source, Mesh) and source.census["duplicate_triangles"] > 0


def load(name: str) -> Mesh:
    """The mesh of this name; InvalidInput for those of `REFUSED`."""
    return Mesh(*MADE[name](), name=name)


# ---- random ones ----------------------------------------------------------------------------------

SHAPES: dict[str, Callable[[int, int], Arrays]] = {  # of a size of 1 to 16, and a seed
    "ball": lambda n, _: _of(shapes.icosphere(min(n // 4, 3))),
    "torus": lambda n, _: _of(shapes.torus(2 * n + 1, n + 2)),
    "blob": lambda n, seed: _of(shapes.blob(n + 1, seed)),
    "bowl": lambda n, _: bowl(1 + n // 6),
    "needles": lambda n, _: needles(n + 2),
    "plate": lambda n, _: plate(n),
    "rough": lambda n, seed: plate(n, lambda x, _: 0.3 * np.random.default_rng(seed).normal(size=len(x))),
    "ribbon": lambda n, _: ribbon(n + 2),
    "triangle": lambda _n, _s: TRIANGLE,
    "tetrahedron": lambda _n, _s: TETRAHEDRON,
}


def _some(faces: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """(F,) a random tenth of them, at least one."""
    chosen = random.random(len(faces)) < 0.1
    chosen[random.integers(len(faces))] = True
    return chosen


def _holes(arrays: Arrays, random: np.random.Generator) -> Arrays:
    kept = ~_some(arrays[1], random)
    return arrays[0], arrays[1][kept] if kept.any() else arrays[1]


def _half(arrays: Arrays, random: np.random.Generator) -> Arrays:
    positions, faces = arrays
    along = positions[faces].mean(axis=1) @ random.normal(size=3)
    return positions, faces[along >= np.median(along)]


def _turned(arrays: Arrays, random: np.random.Generator) -> Arrays:
    faces, chosen = arrays[1].copy(), _some(arrays[1], random)
    faces[chosen] = faces[chosen][:, ::-1]
    return arrays[0], faces


def _duplicates(arrays: Arrays, random: np.random.Generator) -> Arrays:
    more = arrays[1][_some(arrays[1], random)]
    return arrays[0], np.vstack([arrays[1], more if random.random() < 0.5 else more[:, ::-1]])


def _no_area(arrays: Arrays, random: np.random.Generator) -> Arrays:
    positions, faces = arrays
    chosen = faces[_some(faces, random)]
    middles = positions[chosen[:, :2]].mean(axis=1)  # on an edge, beside it, or a corner named again
    more = np.stack([chosen[:, 0], chosen[:, 1], len(positions) + np.arange(len(chosen))], axis=1)
    return np.vstack([positions, middles]), np.vstack([faces, more, chosen[:, [0, 0, 1]]])


def _fins(arrays: Arrays, random: np.random.Generator) -> Arrays:
    positions, faces = arrays
    chosen = faces[_some(faces, random)]
    tips = positions[chosen].mean(axis=1) + 0.2 * random.normal(size=(len(chosen), 3))
    more = np.stack([chosen[:, 0], chosen[:, 1], len(positions) + np.arange(len(chosen))], axis=1)
    return np.vstack([positions, tips]), np.vstack([faces, more])


def _welded(arrays: Arrays, random: np.random.Generator) -> Arrays:
    positions, faces = arrays
    to = np.where(random.random(len(positions)) < 0.05, random.integers(len(positions), size=len(positions)), -1)
    to = np.where(to < 0, np.arange(len(positions)), to)
    return positions, to[faces]


DAMAGE: dict[str, Callable[[Arrays, np.random.Generator], Arrays]] = {
    "holes": _holes,
    "half": _half,
    "turned": _turned,
    "inside out": lambda a, _: (a[0], a[1][:, ::-1]),
    "duplicates": _duplicates,
    "no area": _no_area,
    "fins": _fins,
    "welded": _welded,
    "unused": lambda a, random: (np.vstack([a[0], 30.0 * random.normal(size=(5, 3))]), a[1]),
    "soup": lambda a, _: (a[0][a[1]].reshape(-1, 3), np.arange(a[1].size).reshape(-1, 3)),
    "noise": lambda a, random: (a[0] + 0.05 * random.normal(size=a[0].shape), a[1]),
}


def random_mesh(random: np.random.Generator) -> dict[str, Any]:
    """The recipe of a random mesh: a shape or several, damaged or not, of any size, anywhere."""

    def pick(values: Any) -> Any:
        return values[int(random.integers(len(values)))]

    return {
        "mesh": pick(list(SHAPES)),
        "detail": int(random.integers(1, 17)),
        "seed": int(random.integers(2**31)),
        "parts": pick((1, 1, 1, 2, 5)),
        "damage": pick((*[None] * 6, *DAMAGE)),
        "stretch": pick(([1.0, 1.0, 1.0], [1.0, 1.0, 1.0], [1.0, 1.0, 1e-4], [30.0, 1.0, 1.0], [1.0, 0.1, 3.0])),
        "size": pick((1.0, 1.0, 1000.0, float(np.exp(random.uniform(-12.0, 16.0))))),
        "shift": pick(([0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [10.0, -7.0, 3.0], [1e5, -1e6, 1e4])),  # in sizes
    }


def make_mesh(recipe: Mapping[str, Any]) -> Mesh:
    """The mesh of a recipe; InvalidInput when it is none."""
    random = np.random.default_rng(recipe["seed"])
    shape = SHAPES[recipe["mesh"]]
    parts = [
        moved(shape(recipe["detail"], recipe["seed"] % 9973 + i), random.normal(size=3) * i)
        for i in range(recipe["parts"])
    ]
    positions, faces = joined(*parts)
    if recipe["damage"] is not None:
        positions, faces = DAMAGE[recipe["damage"]]((positions, faces), random)
    size = recipe["size"]
    return Mesh(positions * recipe["stretch"] * size + np.array(recipe["shift"]) * size, faces)


class About:
    """Places on and about a mesh, as `trials.Ground` has them of a field."""

    def __init__(self, source: Mesh):
        self.source = source
        self.positions, self.faces = np.array(source.positions), np.array(source.faces)
        corners = self.positions[self.faces]
        edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
        self.span = max(0.5 * source.extent, 1e-9)
        self.cell = max(float(np.median(edges)), 1e-6 * self.span)
        self.relief = 0.1 * self.span

    def place(self, row: float, col: float) -> tuple[np.ndarray, np.ndarray]:
        """(3,) a corner of the triangle at this share of all, and its axes."""
        corners = self.positions[self.faces[round(row * (len(self.faces) - 1))]]
        normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
        length = float(np.linalg.norm(normal))
        return corners[min(2, int(3.0 * col))], axes_of(normal / length if length > 0.0 else np.array([0.0, 0.0, 1.0]))

    def along(self, path: str, t: float) -> Any:
        """The view of a built-in path at a time."""
        return CameraPath.named(path, self.source).view_at(t)


def axes_of(up: np.ndarray) -> np.ndarray:
    """(3, 3): east, north, up as rows, for a unit vector up."""
    east = np.cross([0.0, 0.0, 1.0], up) if abs(up[2]) < 0.999 else np.cross([1.0, 0.0, 0.0], up)
    east /= np.linalg.norm(east)
    return np.stack([east, np.cross(up, east), up])
