# SPDX-License-Identifier: MIT
"""What a scene stands on: one method on one source, its store, its sessions and the instrument.

A scene is a function of a `Stage` that yields `Figure`s; its docstring says failure, test, figure and limit.
Scenes know methods through the method table alone (accepts, budgets, options), never by name, so that a
method added later is put through all of them. A figure holds when its value is at most its limit; nan never does.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from .. import _core
from ..errors import InvalidInput
from ..instrument.metrics import pixel_slack
from ..instrument.yardstick import Yardstick
from ..paths.path import CameraPath
from ..sources.base import Source
from ..sources.mesh import Mesh
from ..stores.build import store_for
from ..stores.methods import lacking, method_table, still
from ..stores.session import Cut, Session
from ..stores.store import Store
from . import fields, meshes
from .tree import Tree

SHORT_SIZE, LONG_SIZE = (320, 200), (640, 360)
FLYOVER_FRAMES = 120
FLAWS = ("inverted_triangles", "slanted_filler_triangles", "raised_filler_triangles", "capture_mismatch_pixels")
NO_LIMIT = 10**15  # a count that no hard budget of a scene reaches


class NotApplicable(Exception):
    """The scene makes no sense for this method; the message says why."""


@dataclass
class Figure:
    """What a scene found. `picture` is (H, W, 4) uint8: the worst frame, where there is one."""

    name: str
    value: float
    unit: str
    limit: float
    picture: np.ndarray | None = field(default=None, repr=False)


class Worst:
    """The largest of many values, and how to draw the frame that it comes from. A nan stays."""

    def __init__(self) -> None:
        self.value: float | None = None
        self._draw: Callable[[], np.ndarray] | None = None

    def see(self, value: float, draw: Callable[[], np.ndarray] | None = None) -> None:
        """Takes a value; `draw` gives the picture of its frame, should it be the worst."""
        value = float(value)
        if self.value is None or value > self.value or (math.isnan(value) and not math.isnan(self.value)):
            self.value, self._draw = value, draw

    def figure(self, name: str, unit: str, limit: float) -> Figure:
        """The figure of the worst value. RuntimeError when there was none: nothing measured proves nothing."""
        if self.value is None:
            raise RuntimeError(f"{name}: nothing was measured")
        return Figure(name, self.value, unit, limit, self._draw() if self._draw else None)


@dataclass(frozen=True)
class Scene:
    """A row of the table: its number, its title, the function, the sources of the long and the short form."""

    name: str
    title: str
    play: Callable[[Stage], Iterator[Figure]]
    long: tuple[str, ...]
    short: tuple[str, ...]
    variants: bool = False  # the long form also plays every choice of draw options, on the first source


class Bench:
    """A source with its yardstick and its stores, shared by the methods that are put on it."""

    def __init__(self, name: str, folder: Path, source: Source | None = None):
        self.name = name
        self.folder = folder
        self._source = source
        self._stores: dict[str, Store] = {}

    @cached_property
    def source(self) -> Source:
        """The source; InvalidInput when its arrays are none."""
        return self._source if self._source is not None else fields.load(self.name)

    @cached_property
    def yardstick(self) -> Yardstick:
        return Yardstick(self.source, self.folder, progress=False)

    def store(self, method: str) -> Store:
        """The method's store of this source, built once, default build options."""
        if method not in self._stores:
            self._stores[method] = store_for(self.source, method, {}, self.folder, progress=False)
        return self._stores[method]


class Stage:
    """One method on one source."""

    def __init__(
        self,
        bench: Bench,
        method: str,
        options: Mapping[str, Any],
        short: bool,
        seed: int = 0,
        seconds: float | None = None,
        progress: bool = False,
    ):
        self.seed, self.seconds, self.progress = seed, seconds, progress  # of the random search (None: some trials)
        self.bench = bench
        self.method = method
        self.table = method_table(method)
        self.options = dict(options)
        self.short = short
        self.size = SHORT_SIZE if short else LONG_SIZE

    # ---- what is at hand

    @property
    def source(self) -> Any:
        return self.bench.source

    @property
    def on_mesh(self) -> bool:
        return isinstance(self.source, Mesh)

    @property
    def unit(self) -> str:
        """Of lengths: a mesh has its own."""
        return "units" if self.on_mesh else "m"

    @property
    def store(self) -> Store:
        """NotApplicable when the mesh lacks what the method needs: scene s16 is about those."""
        if self.lacking:
            raise NotApplicable(self.lacking)
        return self.bench.store(self.method)

    @cached_property
    def lacking(self) -> str:
        return lacking(self.source, self.method)

    @cached_property
    def tree(self) -> Tree:
        return Tree(self.store.nodes)

    @property
    def resolved_options(self) -> dict[str, Any]:
        """All options, defaults written out, as the rows name them."""
        draw = _core.resolve_options(self.method, "draw", still(self.method, self.options))
        return {**_core.resolve_options(self.method, "build", {}), **draw}

    def session(self, **options: Any) -> Session:
        """A fresh session; everything is loaded first, unless `options` say otherwise."""
        return self.store.session(**{**still(self.method, self.options), **options})

    def other(self, name: str, source: Source) -> Stage:
        """The same method on another source, one that the scene made."""
        return Stage(Bench(name, self.bench.folder, source), self.method, self.options, self.short)

    # ---- budgets

    @property
    def budgets(self) -> list[str]:
        """The kinds of budget that the method lists; empty: it ignores them."""
        return list(self.table["budgets"])

    def need_budgets(self, *kinds: str) -> None:
        """NotApplicable when the method ignores budgets, or lists none of these kinds."""
        if not self.budgets:
            raise NotApplicable("the method ignores budgets")
        if kinds and not set(kinds) & set(self.budgets):
            raise NotApplicable(f"the method has no budget of {', '.join(kinds)}")

    def pixel_error(self, value: float) -> _core.Budget:
        """A budget of this pixel error; NotApplicable when the method has budgets but not this one."""
        if self.budgets and "pixel_error" not in self.budgets:
            raise NotApplicable("the method has no budget pixel_error")
        return _core.Budget(pixel_error=value)

    def extent(self, session: Session, view: _core.View, kind: str) -> tuple[int, int]:
        """Least and most triangles or nodes that the method can submit in a view."""
        spent = {"triangles": lambda c: c.triangles, "nodes": lambda c: c.visible_nodes}[kind]
        return tuple(spent(session.select(view, _core.Budget(**{kind: n}))) for n in (1, NO_LIMIT))

    def budget_kinds(self, session: Session, view: _core.View) -> dict[str, _core.Budget]:
        """One budget of every kind that the method has, half-way in its range, and all of them together."""
        if not self.budgets:
            return {"budgets ignored": _core.Budget(pixel_error=1.0)}
        values: dict[str, Any] = {}
        for kind in self.budgets:
            if kind == "pixel_error":
                values[kind] = 1.0
            else:
                least, most = self.extent(session, view, kind)
                values[kind] = max(1, round(math.sqrt(max(least, 1) * max(most, 1))))
        kinds = {kind: _core.Budget(**{kind: value}) for kind, value in values.items()}
        if len(values) > 1:
            kinds["all budgets"] = _core.Budget(**values)
        return kinds

    # ---- views

    @cached_property
    def path(self) -> CameraPath:
        """The flyover; of a mesh the way close by."""
        return CameraPath.named("flyby" if self.on_mesh else "flyover", self.source, FLYOVER_FRAMES)

    def views(self, count: int) -> list[_core.View]:
        """Views evenly spaced along the path."""
        return [self.path.view_at((i + 0.5) / count, self.size) for i in range(count)]

    def over(self, height: float = 0.4, fov: float = 60.0, size: tuple[int, int] | None = None) -> _core.View:
        """An oblique view of the whole source from beyond its south-west corner."""
        low, high = self.box
        span = float((high - low)[:2].max())
        middle = 0.5 * (low + high)
        if self.on_mesh:  # from beside it: a mesh may stand on end
            eye = middle + self.source.extent * np.array([-0.7, -0.7, height + 0.1])
            return look(eye, middle, fov=fov, size=size or self.size)
        eye = np.array([middle[0] - 0.7 * span, middle[1] - 0.7 * span, high[2] + height * span])
        return look(eye, middle, fov=fov, size=size or self.size)

    @cached_property
    def box(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper corner of a mesh or a flat field, (3,) each, source units."""
        if self.on_mesh:
            return tuple(self.source.bounds)
        rows, cols = self.source.shape
        (dx, dy), (x0, y0) = self.source.spacing, self.source.origin
        heights = self.source.filled
        low = np.array([x0, y0 - (rows - 1) * dy, float(heights.min())])
        return low, np.array([x0 + (cols - 1) * dx, y0, float(heights.max())])

    @cached_property
    def foot(self) -> tuple[np.ndarray, np.ndarray]:
        """(3,) a place on the source and the way up there: in the middle of a field, a corner of a mesh."""
        if self.on_mesh:
            point, axes = meshes.About(self.source).place(0.5, 0.0)
            return point, axes[2]
        x, y, _ = 0.5 * (self.box[0] + self.box[1])
        return np.array([x, y, self.height(x, y)]), np.array([0.0, 0.0, 1.0])

    def height(self, x: float, y: float, around: float = 0.0) -> float:
        """The height of the nearest sample; with `around`, the largest within so many metres."""
        (dx, dy), (x0, y0) = self.source.spacing, self.source.origin
        rows, cols = self.source.shape
        c0, c1 = (int(np.clip(round((x + s * around - x0) / dx), 0, cols - 1)) for s in (-1, 1))
        r0, r1 = (int(np.clip(round((y0 - y - s * around) / dy), 0, rows - 1)) for s in (1, -1))
        return float(self.source.filled[r0 : r1 + 1, c0 : c1 + 1].max())

    # ---- frames

    def frame(self, session: Session, view: _core.View, budget: _core.Budget) -> Cut:
        """The cut that a frame of a run draws: selected and submitted, nothing read back."""
        return Cut(session.core.time_frame(view, budget, True)[0], session)

    def examine(
        self, session: Session, cut: Cut, view: _core.View, before: Cut | None = None, pictures: bool = True
    ) -> Any:
        """The instrument's `Measurement` of a drawn cut; `before`: the cut of the frame before, for pops.

        Without `pictures`, figures that need a pass over the source at full resolution are nan: much cheaper.
        """
        yardstick = self.bench.yardstick
        reference = yardstick.reference(view) if pictures else None
        earlier = None if before is None else before.core
        return yardstick.instrument().examine(session.core, cut.core, view, reference, reference is not None, earlier)

    def excess(self, session: Session, cut: Cut, view: _core.View) -> float:
        """How far the worst node of a cut lies beyond its bound as drawn and the slack, metres; negative: within."""
        nodes, errors = self.examine(session, cut, view, pictures=False).node_errors()
        if not len(nodes):
            return math.inf  # nothing is drawn
        bounds = np.full(int(self.tree.ids.max()) + 1, np.nan)
        bounds[cut.nodes["node"]] = cut.nodes["error"]
        return float(np.max(errors - bounds[nodes])) - self.bench.yardstick.instrument().slack(view)

    def flaws(self, found: Any, cut: Cut) -> float:
        """What no drawn cut may have, counted: uncovered samples, cracks (pixels where the method draws fillers, edges
        where it does not), inverted surface, fillers that could pass for it, pixels and triangles drawn otherwise than
        captured and counted. No edges where triangles of a mesh lie on others, and an approximation may have the rim of
        the second sheet anywhere."""
        columns = ["hole_samples", *FLAWS]
        if not (meshes.doubled(self.source) and cut.nodes["error"].max() > 2.0 * self.store.info()["quantum"]):
            columns.append("crack_pixels" if cut.filler_triangles else "crack_edges")
        count = sum(zero_if_unseen(float(getattr(found, column))) for column in columns)
        return count + zero_if_unseen(abs(found.drawn_triangles - cut.triangles))

    @staticmethod
    def pixel_slack(view: _core.View) -> float:
        return pixel_slack(view)

    def picture(self, session: Session, cut: Cut, view: _core.View, show: str = "shade") -> Callable[[], np.ndarray]:
        """Draws a cut when it is asked to."""
        return lambda: session.draw(cut, view, show).image


def look(eye: Any, target: Any, **values: Any) -> _core.View:
    """A view from arrays (3,)."""
    eye, target = (tuple(float(v) for v in p) for p in (eye, target))
    return _core.View(eye, target, **values)


def chosen(cut: Cut) -> frozenset[tuple[int, int]]:
    """The (node, resolution) pairs of a cut."""
    return frozenset(zip(cut.nodes["node"].tolist(), cut.nodes["resolution"].tolist(), strict=True))


def refuses(act: Callable[[], Any], error: type[Exception] = InvalidInput) -> bool:
    """Whether a call ends in this typed error."""
    try:
        act()
    except error:
        return True
    return False


def zero_if_unseen(value: float) -> float:
    """0 for the nan of a column that the view sees nothing for."""
    return 0.0 if math.isnan(value) else value
