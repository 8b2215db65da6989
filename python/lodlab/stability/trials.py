# SPDX-License-Identifier: MIT
"""Random trials of a method: a source, options, and frames (views, budgets), all from a seed and an index.

A trial is plain values (JSON), so that it can be printed, shrunk and played again. Options come from the method's
option table, so that a new method is searched without an edit. What is drawn favours ends: of option ranges, of
fields of view, of sizes, of distances.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .. import _core
from ..sources.frames import EARTH_RADIUS
from ..sources.heightfield import HeightField
from ..sources.mesh import Mesh
from ..stores.methods import method_table
from . import fields, meshes
from .stage import look

#: What a trial does with its store, and how often of 20.
KINDS = {"frames": 9, "budgets": 4, "cuts": 3, "stream": 2, "tremble": 2}
PAGING = ("stream", "cpu_cache_mb", "gpu_cache_mb", "fetch_delay_ms")
PATHS = ("orbit", "zoom", "flyby")  # of meshes
VIEWS = ("over", "inside", "under", "border", "far", "grazing", "sample", "down", "through", "away")


@dataclass(frozen=True)
class Trial:
    """One trial of a method. `frames`: dicts `view`, `budget`; `name`: the line that draws it again."""

    method: str
    kind: str
    source: dict[str, Any]
    build: dict[str, Any] = field(default_factory=dict)
    draw: dict[str, Any] = field(default_factory=dict)
    frames: list[dict[str, Any]] = field(default_factory=list)
    seed: int = 0
    name: str = ""


def draw_trial(method: str, seed: int, index: int) -> Trial:
    """The trial of a method that a seed and an index name. InvalidInput for an unknown method."""
    table = method_table(method)
    random = np.random.default_rng([seed, index, *method.encode()])
    kind = str(random.choice(list(KINDS), p=np.array(list(KINDS.values())) / sum(KINDS.values())))
    style = _pick(random, ("plain", "plain", "deep", "any", "any"))
    streams = any(o["name"] == "stream" for o in table["options"])
    kind = "frames" if (kind == "budgets" and not table["budgets"]) or (kind == "stream" and not streams) else kind
    source = _source(table["accepts"], random, most=360 if kind == "stream" else 130)
    build = {"plain": dict, "deep": lambda: _deep(table, random), "any": lambda: _options(table, "build", random)}[
        style
    ]()
    draw = _options(table, "draw", random) if style == "any" else {}
    if kind == "stream":
        draw |= _paging(table, random)
    frames = _frames(table, kind, random, (*VIEWS, *PATHS) if "mesh" in source else VIEWS)
    name = f"python -m lodlab.stability.replay {method} {seed} {index}"
    return Trial(method, kind, source, build, draw, frames, int(random.integers(2**31)), name)


def _pick(random: np.random.Generator, values: Any) -> Any:
    """One of some values, as a plain one."""
    return values[int(random.integers(len(values)))]


def _between(random: np.random.Generator, low: float, high: float) -> float:
    """A number of any magnitude between two positive ones."""
    return float(np.exp(random.uniform(math.log(low), math.log(high))))


# ---- sources --------------------------------------------------------------------------------------


def _source(accepts: Sequence[str], random: np.random.Generator, most: int) -> dict[str, Any]:
    """The recipe of a source of one of these kinds."""
    if "mesh" in accepts and (len(accepts) == 1 or random.random() < 0.5):
        return meshes.random_mesh(random)
    return random_source(random, "planet" in accepts and random.random() < 0.5, most)


def random_source(random: np.random.Generator, planet: bool, most: int = 130) -> dict[str, Any]:
    """The recipe of a random height field of at most this many samples a side, flat or on a planet."""
    rows, cols = (_side(random, most) for _ in range(2))
    if random.random() < 0.15:  # strips
        rows, cols = (2, cols) if random.random() < 0.5 else (rows, 2)
    out: dict[str, Any] = {
        "rows": rows,
        "cols": cols,
        "shape": _pick(random, ("fractal", "fractal", "noise", *fields.SHAPES)),
        "seed": int(random.integers(2**31)),
        "height": _pick(random, (1.0, 1.0, 1e-3, 100.0, _between(random, 1e-4, 1e3))),
        "base": _pick(random, (0.0, 0.0, 0.0, -400.0, 8848.0)),
        "voids": _pick(random, (*[None] * 6, "corner", "noise", "one", "islands", "holed")),
    }
    if planet:
        return out | _planet_place(random, rows, cols)
    spacing = _pick(random, (30.0, 1.0, 100.0, _between(random, 0.01, 1e5)))
    squeeze = _pick(random, (1.0, 1.0, 4.0 / 3.0, 0.1, 60.0))
    out["spacing"] = [spacing, spacing * squeeze]
    out["origin"] = _pick(random, ([0.0, 0.0], [0.0, 0.0], [-7e5, 6.4e6], [1.25, -3.5]))
    return out


def _side(random: np.random.Generator, most: int) -> int:
    power = 2 ** int(random.integers(1, int(math.log2(most)) + 1))
    return int(_pick(random, (power, power + 1, round(_between(random, 2, most)), round(_between(random, 8, most)))))


def _planet_place(random: np.random.Generator, rows: int, cols: int) -> dict[str, Any]:
    """A globe, or a window of one: at a pole, across the equator, anywhere; of any size up to all of it."""
    out: dict[str, Any] = {"radius": _pick(random, (EARTH_RADIUS, EARTH_RADIUS, 1737400.0, 500.0))}
    out["height"] = _pick(random, (1.0, 20.0, _between(random, 1e-3, 1e2))) * out["radius"] / EARTH_RADIUS
    if random.random() < 0.3:
        return out | {"degrees": None}
    tall = _pick(random, (_between(random, 0.01, 179.0), _between(random, 1.0, 60.0)))
    wide = min(_pick(random, (tall * cols / rows, _between(random, 0.01, 350.0))), 350.0)
    north = _pick(random, (90.0, -90.0 + tall, 0.5 * tall, float(random.uniform(-90.0 + tall, 90.0))))
    west = _pick(random, (0.0, -180.0, float(random.uniform(-180.0, 180.0))))
    return out | {"degrees": [west, north, wide / (cols - 1), tall / (rows - 1)]}


def make_source(source: Mapping[str, Any]) -> HeightField | Mesh:
    """The height field or mesh of a recipe; InvalidInput when it is none."""
    if "mesh" in source:
        return meshes.make_mesh(source)
    rows, cols = source["rows"], source["cols"]
    random = np.random.default_rng(source["seed"])
    if source["shape"] == "fractal":
        heights = _core.fractal(rows, cols, 0, 0, seed=source["seed"] % 9973, roughness=0.5).astype(np.float64)
    elif source["shape"] == "noise":
        heights = 500.0 * random.normal(size=(rows, cols))
    else:
        heights = fields.SHAPES[source["shape"]](rows, cols)
    heights = _with_voids(source["base"] + source["height"] * heights, source["voids"], random).astype(np.float32)
    if "degrees" not in source:
        return HeightField(heights, spacing=tuple(source["spacing"]), origin=tuple(source["origin"]))
    degrees = source["degrees"]
    return HeightField(
        heights, planet=True, radius=source["radius"], degrees=None if degrees is None else tuple(degrees)
    )


def _with_voids(heights: np.ndarray, voids: str | None, random: np.random.Generator) -> np.ndarray:
    rows, cols = heights.shape
    if voids == "corner":
        heights[: (rows + 1) // 2, : (cols + 1) // 2] = np.nan
    elif voids == "noise":
        heights[random.random(heights.shape) < _pick(random, (0.02, 0.3, 0.7))] = np.nan
    elif voids == "one":
        heights[random.integers(rows), random.integers(cols)] = np.nan
    elif voids == "islands":
        coarse = random.random((rows // 7 + 1, cols // 7 + 1)) < 0.6
        heights[np.kron(coarse, np.ones((7, 7), bool))[:rows, :cols]] = np.nan
    elif voids == "holed":
        heights = fields.holed(heights)
    return heights


# ---- options --------------------------------------------------------------------------------------


def _options(table: Mapping[str, Any], stage: str, random: np.random.Generator) -> dict[str, Any]:
    """Some of a method's options of one stage, at ends of their ranges, or in between. Paging apart."""
    own = [o for o in table["options"] if o["stage"] == stage and o["name"] not in PAGING]
    return {o["name"]: _value(o, random) for o in own if random.random() < 0.5}


def _deep(table: Mapping[str, Any], random: np.random.Generator) -> dict[str, Any]:
    """Whole-number build options at their low ends: small nodes, so that small sources have many levels."""
    out = {}
    for option in table["options"]:
        if option["stage"] == "build" and option["type"] == "int":
            powers = [2**i for i in range(1, 31) if option["range"][0] <= 2**i <= option["range"][1]]
            out[option["name"]] = int(_pick(random, (option["default"], *powers[:3])))
    return out


def _value(option: Mapping[str, Any], random: np.random.Generator) -> Any:
    if option["type"] == "bool":
        return bool(random.random() < 0.5)
    if option["type"] == "choice":
        return str(_pick(random, option["choices"]))
    if option["type"] == "string":  # free text: some of it is a number, some a file that is not there
        return _pick(random, (option["default"], option["default"], "1", "50", "1e-9", "0", "no such thing"))
    if option["type"] == "meshes":  # balls beside whatever the source is
        balls = ("icosphere:level=1", "icosphere:level=3;icosphere:level=0", "torus:rings=9,sides=5;blob:size=5")
        return _pick(random, (option["default"], option["default"], *balls, "no such thing"))
    low, high = (end if value is None else value for value, end in zip(option["range"], (-1e4, 1e4), strict=True))
    if option["type"] == "int":
        powers = [2**i for i in range(31) if low <= 2**i <= high]
        return int(_pick(random, (int(low), int(high), option["default"], *(_pick(random, powers) for _ in range(4)))))
    inner = _between(random, max(low, 1e-3), max(min(high, 1e4), 2e-3))
    return float(_pick(random, (low, high, option["default"], min(max(inner, low), high))))


def _paging(table: Mapping[str, Any], random: np.random.Generator) -> dict[str, Any]:
    """Streaming under small caches."""
    known = {o["name"] for o in table["options"]}
    out: dict[str, Any] = {"stream": True}
    for name in ("cpu_cache_mb", "gpu_cache_mb"):
        if name in known:
            out[name] = int(_pick(random, (1, 2, 3, 6, 24, 1024)))
    if "fetch_delay_ms" in known and random.random() < 0.3:
        out["fetch_delay_ms"] = 2
    return out


# ---- frames ---------------------------------------------------------------------------------------


def _frames(
    table: Mapping[str, Any], kind: str, random: np.random.Generator, kinds: Sequence[str]
) -> list[dict[str, Any]]:
    if kind == "budgets":
        views = [random_view(random, kinds) for _ in range(2)]
        return [{"view": view, "budget": budget} for view in views for budget in _tight_budgets(table, random)]
    if kind == "tremble":
        view, budget = random_view(random, kinds), random_budget(table, random)
        steps = [[0.0, 0.0, 0.0], *random.normal(size=(4, 3)).tolist(), [0.0, 0.0, 0.0]]
        return [{"view": view | {"tremble": step}, "budget": budget} for step in steps]
    if kind == "stream":
        views = [random_view(random, kinds) for _ in range(3)]
        budget = random_budget(table, random)
        return [{"view": view, "budget": budget} for view in views for _ in range(4)]
    return [{"view": random_view(random, kinds), "budget": random_budget(table, random)} for _ in range(4)]


def random_budget(table: Mapping[str, Any], random: np.random.Generator) -> dict[str, Any]:
    """One budget of those that the method takes, or several. Counts: from the least that a view needs (0) to the most
    that it can use (1), on a logarithmic scale."""
    kinds = table["budgets"] or ["pixel_error"]
    chosen = [kind for kind in kinds if random.random() < 0.4] or [_pick(random, kinds)]
    return {kind: _pixels(random) if kind == "pixel_error" else ["share", float(random.random())] for kind in chosen}


def _pixels(random: np.random.Generator) -> float:
    return float(_pick(random, (0.5, 1.0, _between(random, 1e-2, 1e2), _between(random, 1e-4, 1e4))))


def _tight_budgets(table: Mapping[str, Any], random: np.random.Generator) -> list[dict[str, Any]]:
    """The least count that a cut needs, one less, one more; alone, and with a pixel error; both counts together."""
    counts = [kind for kind in ("triangles", "nodes") if kind in table["budgets"]]
    out: list[dict[str, Any]] = []
    for kind in counts:
        steps = (0, -1, 1, int(_between(random, 2, 1e3)))
        out += [{kind: ["least", step]} for step in steps]
        if "pixel_error" in table["budgets"]:
            out.append({kind: ["least", _pick(random, steps)], "pixel_error": _pixels(random)})
    if len(counts) == 2:
        out.append({kind: ["least", int(_between(random, 1, 1e3))] for kind in counts})
    return out or [random_budget(table, random)]


def random_view(random: np.random.Generator, kinds: Sequence[str] = VIEWS) -> dict[str, Any]:
    """The recipe of a view: where the eye stands beside a sample, and where it looks."""
    kind = _pick(random, kinds)
    sides = (1, 2, 3, 64, 96, 33, 160)
    return {
        "kind": kind,
        "at": [float(v) for v in random.random(2)],
        "to": [float(v) for v in random.random(2)],
        "way": random.normal(size=3).tolist(),
        "away": _between(random, 1e-3, 1e3),
        "fov": _pick(random, (60.0, 60.0, 90.0, 1.0, 170.0, float(random.uniform(1.0, 170.0)))),
        "size": [96, 64] if random.random() < 0.6 else [int(_pick(random, sides)), int(_pick(random, sides))],
        "near": _pick(random, (*[None] * 6, 1e-3, 1.0, _between(random, 1e-6, 1e6))),
        "up": _pick(random, (None, None, None, random.normal(size=3).tolist())),
    }


class Ground:
    """Places on and about a height field: flat, a globe, or a window of one."""

    def __init__(self, source: HeightField):
        self.core = source.core
        rows, cols = source.shape
        self.shape = (rows, cols)
        corners = self.core.position([0, 0, rows - 1, rows - 1], [0, cols - 1, 0, cols - 1])
        middle, edge = self.sample(0.5, 0.5), self.core.position([rows // 2] * 2, [0, 1])
        down = self.core.position([0, 1], [cols // 2] * 2)
        self.cell = max(float(np.linalg.norm(edge[1] - edge[0])), float(np.linalg.norm(down[1] - down[0])), 1e-9)
        self.span = max(float(np.linalg.norm(corners - middle, axis=1).max()), self.cell)
        if self.core.planet and self.core.wraps:
            self.span = 2.0 * self.core.radius
        self.relief = max(self.core.z_max - self.core.z_min, 1e-3 * self.cell)

    def sample(self, row: float, col: float) -> np.ndarray:
        """(3,) position of the sample at these shares of rows and columns."""
        r, c = (round(share * (n - 1)) for share, n in zip((row, col), self.shape, strict=True))
        return self.core.position([r], [c])[0]

    def place(self, row: float, col: float) -> tuple[np.ndarray, np.ndarray]:
        """The sample at these shares, and (3, 3) east, north, up there, as rows."""
        point = self.sample(row, col)
        return point, meshes.axes_of(point / np.linalg.norm(point)) if self.core.planet else np.eye(3)


def ground_of(source: HeightField | Mesh) -> Ground | meshes.About:
    """What views stand on."""
    return meshes.About(source) if isinstance(source, Mesh) else Ground(source)


def make_view(ground: Ground | meshes.About, view: Mapping[str, Any]) -> _core.View:
    """The view of a recipe; InvalidInput when it is none."""
    at, to, kind = list(view["at"]), view["to"], view["kind"]
    if kind == "border":
        at[int(at[0] < 0.5)] = float(round(at[1]))
    (foot, axes), (target, _) = ground.place(*at), ground.place(*to)
    way = np.array(view["way"]) @ axes
    side, up = axes[0], axes[2]
    cell, span, relief, away = ground.cell, ground.span, ground.relief, view["away"]
    if kind in PATHS:
        on_path = ground.along(kind, at[0])
        foot, target = on_path.eye, on_path.target
    eye = {
        **dict.fromkeys(PATHS, foot),
        "over": foot + (0.7 * way + (0.4 + abs(view["way"][2])) * up) * span,
        "inside": foot + 0.3 * relief * way,
        "under": foot - up * (relief + away * cell),
        "border": foot + 0.1 * away * cell * (way + 1.5 * up),
        "far": foot + (way + up) * span * (3.0 + away),
        "grazing": foot + up * (relief * 0.01 + 1e-3 * cell),
        "sample": foot,
        "down": foot + up * min(away, 10.0) * cell,
        "through": foot - way * span,
        "away": foot + (way + up) * span,
    }[kind]
    if kind == "grazing":
        target = eye + (side * view["way"][0] + axes[1] * view["way"][1]) * cell * 10.0
    elif kind in ("sample", "inside"):
        target = eye + way * cell
    elif kind == "down":
        target = foot
    elif kind == "away":
        target = 2.0 * eye - target
    if "tremble" in view:
        eye = eye + np.array(view["tremble"]) * 1e-3 * max(float(np.linalg.norm(target - eye)), 1e-9)
    near = view["near"]
    if near is not None:
        near = near * cell
    given = {} if view["up"] is None else {"up": tuple(view["up"])}
    return look(eye, target, fov=view["fov"], size=tuple(view["size"]), near=near, **given)
