# SPDX-License-Identifier: MIT
"""Stores: build one from a source, open one, and select, draw and capture through a session.

`Store` is a thin face over the core's store: it keeps the source at hand (the instrument needs it), shows
progress, and hands out sessions. A session owns GL objects and belongs to the thread that first draws
with it; `store.select` and its like use a default session, made on first use.
"""

from __future__ import annotations

import html
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from .. import _core
from ..disk import is_store
from ..errors import InvalidInput, StoreError, check_one_of
from ..sources.base import Source
from ..sources.spec import as_source, load

_PASS = "pass it (source=SOURCE), or measure nothing (accuracy_frames=0)"
SHOWS = ("shade", "normal", "level", "wire")


class Frame:
    """A drawn picture: `image` (H, W, 4) uint8 and `depth` (H, W) float32, row 0 on top.

    Depth is the distance along the view axis in source units, inf where nothing was drawn; None for
    pictures that have none (wireframes, files).
    """

    def __init__(self, image: np.ndarray, depth: np.ndarray | None = None):
        self.image = image
        self.depth = depth

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the picture; the format follows the file's ending."""
        from ..pictures import save

        save(path, self.image)

    def _repr_png_(self) -> bytes:
        from ..pictures import encode

        return encode(self.image)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        """The picture, for `np.asarray(frame)` and what takes arrays."""
        return np.array(self.image, dtype=dtype, copy=copy)

    def __repr__(self) -> str:
        return f"<lodlab.Frame {self.image.shape[1]} x {self.image.shape[0]}>"


class Cut:
    """What a method selected for a view under a budget; it covers the whole source."""

    def __init__(self, core: Any, session: Session):
        self.core = core
        self._session = session

    @property
    def nodes(self) -> np.ndarray:
        """Structured array `node, resolution, morph, visible, missing`, a row per node of the cut."""
        return self.core.nodes

    @property
    def triangles(self) -> int:
        """Triangles submitted, fillers included."""
        return self.core.triangles

    @property
    def filler_triangles(self) -> int:
        """Of `triangles`, those that only hide cracks (skirts)."""
        return self.core.filler_triangles

    @property
    def visible_nodes(self) -> int:
        """Nodes submitted: those in view, inside the frustum and not beyond a planet's horizon."""
        return self.core.visible_nodes

    @property
    def missing_nodes(self) -> int:
        """Submitted nodes that stand in for finer data which was not there yet."""
        return self.core.missing_nodes

    @property
    def tau(self) -> float:
        """The projected error, pixels, that morph weights were computed for."""
        return self.core.tau

    @property
    def predicted_px(self) -> float:
        """The method's claim: the largest projected error bound among visible nodes, pixels."""
        return self.core.predicted_px

    @property
    def promises_bound(self) -> bool:
        """True when `predicted_px` is an upper bound on the measured error."""
        return self.core.promises_bound

    @property
    def budget_met(self) -> bool:
        """True when target and hard budgets were all kept."""
        return self.core.budget_met

    @property
    def least_triangles(self) -> int | None:
        """Where a hard budget cannot be kept: triangles of the cheapest cut for the view; else None.

        Of the cuts within the budget of nodes (or with the fewest nodes, where none is within it) the cheapest is
        the one with the fewest triangles.
        """
        return self.core.least_triangles

    @property
    def least_nodes(self) -> int | None:
        """Where a hard budget cannot be kept: nodes of the cheapest cut for the view; else None."""
        return self.core.least_nodes

    @property
    def view(self) -> Any:
        """The view that the cut was selected for."""
        return self.core.view

    def to_trimesh(self, view: Any = None, *, colors: bool = True) -> Any:
        """The whole cut as a `trimesh.Trimesh` in source coordinates.

        The surface is the one that the GPU emits for `view` (default: the cut's own). Fillers are left
        out, equal vertices are merged bit for bit, triangles without area dropped. Height fields with
        voids: triangles over a void are kept. A store with a colour raster gives its vertices their colours,
        unless `colors` is False; StoreError when the raster cannot be read any more.
        """
        import trimesh

        from . import export

        captured = self._session.capture(self, view if view is not None else self.view)
        corners = np.ascontiguousarray(captured.triangles[captured.kind == 0].reshape(-1, 3)) + 0.0  # no -0.0
        keys = corners.view(np.dtype((np.void, 24))).ravel()
        _, first, inverse = np.unique(keys, return_index=True, return_inverse=True)
        faces = inverse.reshape(-1, 3)
        a, b, c = faces.T
        faces = faces[(a != b) & (b != c) & (c != a)]
        vertices = corners[first]
        shades = export.colors(self._session.store, vertices) if colors else None
        return trimesh.Trimesh(vertices=vertices, faces=faces, vertex_colors=shades, process=False)

    def __repr__(self) -> str:
        missed = "" if self.budget_met else ", budget not met"
        if self.least_triangles is not None:
            missed += f": the least is {self.least_triangles} triangles in {self.least_nodes} nodes"
        return (
            f"<lodlab.Cut {self.visible_nodes} nodes, {self.triangles} triangles drawn, "
            f"predicted {self.predicted_px:.3g} px{missed}>"
        )


def _whole_numbers(what: str, values: Any, dtype: type) -> np.ndarray:
    """(N,) integers of this dtype; InvalidInput for anything that would be rounded or would not fit."""
    given = np.asarray(values)
    numbers = given if given.size else given.astype(dtype)
    if numbers.dtype.kind not in "iu" or numbers.ndim > 1:
        raise InvalidInput(f"cut: {what} are {given.dtype} of shape {given.shape}; a list of whole numbers is needed")
    limits = np.iinfo(dtype)
    if numbers.size and not limits.min <= int(numbers.min()) <= int(numbers.max()) <= limits.max:
        raise InvalidInput(f"cut: {what} {numbers.min()} to {numbers.max()} leave {limits.min} to {limits.max}")
    return np.ascontiguousarray(numbers, dtype=dtype)


def _cut(what: str, value: Any) -> Cut:
    if not isinstance(value, Cut):
        raise InvalidInput(f"{what}: cut {value!r} is no lodlab.Cut; store.select(view, budget) makes one")
    return value


def _view(what: str, value: Any) -> Any:
    if not isinstance(value, _core.View):
        raise InvalidInput(f"{what}: view {value!r} is no lodlab.View; path.view(frame) makes one of a CameraPath")
    return value


def as_budget(value: Any) -> Any:
    """A lodlab.Budget from itself or a dict of its arguments. InvalidInput for anything else."""
    if isinstance(value, _core.Budget):
        return value
    if isinstance(value, Mapping):
        return _core.Budget(**{str(name): limit for name, limit in value.items()})
    example = f"{value:g}" if isinstance(value, (int, float)) else "1.0"
    raise InvalidInput(f"budget: {value!r} is no lodlab.Budget and no dict; as lodlab.Budget(pixel_error={example})")


class Session:
    """Caches, GL objects and adaptation state on one store, under one set of draw options."""

    def __init__(self, store: Store, options: dict[str, Any]):
        self.store = store
        self.options = _core.resolve_options(store.method, "draw", options)
        self.core = store.core.session(options)

    def select(self, view: Any, budget: Any) -> Cut:
        """The cut for a view under a budget (a dict will do). Unsupported: one that the method does not list."""
        return Cut(self.core.select(_view("select", view), as_budget(budget)), self)

    def cut(self, ids: Any, resolutions: Any = None) -> Cut:
        """A cut by hand from node ids (N,) and, where nodes have several, resolutions (N,).

        InvalidInput names the first gap, overlap or broken rule.
        """
        numbers = _whole_numbers("node ids", ids, np.int64)
        chosen = None if resolutions is None else _whole_numbers("resolutions", resolutions, np.int32)
        return Cut(self.core.cut(numbers, chosen), self)

    def draw(self, cut: Cut, view: Any = None, show: str = "shade") -> Frame:
        """Draws a cut; `show` is one of shade, normal, level, wire. `view` defaults to the cut's own."""
        view = _view("draw", _cut("draw", cut).view if view is None else view)
        check_one_of("draw: show", show, SHOWS)
        if show == "wire":
            return Frame(self.core.wire(cut.core, view).image)
        drawn = self.core.draw(cut.core, view, show)
        return Frame(drawn.image, drawn.depth)

    def capture(self, cut: Cut, view: Any = None, everything: bool = True) -> Any:
        """The triangles as the GPU emits them: `triangles` (T, 3, 3) float64, `kind` (T,), `node` (T,).

        `everything=False` leaves out the nodes outside the view.
        """
        view = _view("capture", _cut("capture", cut).view if view is None else view)
        return self.core.capture(cut.core, view, everything)

    def reset(self) -> None:
        """Forgets adaptation state; caches stay warm."""
        self.core.reset()

    def settle(self) -> None:
        """Waits until everything requested so far is resident."""
        self.core.settle()


class Store:
    """A built hierarchy: one file. Opened by `lodlab.open`, made by `lodlab.build`."""

    def __init__(self, core: Any, source: Source | None = None):
        self.core = core
        self._source = source
        self._session: Session | None = None

    @property
    def path(self) -> Path:
        """The store's file."""
        return Path(self.core.path)

    @property
    def method(self) -> str:
        """The name of the method that built it."""
        return self.core.method

    @property
    def options(self) -> dict[str, Any]:
        """Build options, every default written out."""
        return dict(self.core.options)

    @property
    def source_hash(self) -> str:
        """Hash of the source that it was built from."""
        return self.core.source_hash

    @property
    def source_spec(self) -> str:
        """How to load the source again (a SOURCE of the command line), or empty for arrays in memory."""
        return self.core.source_spec

    @property
    def frame(self) -> dict[str, Any]:
        """Where the source lies: rows, columns, spacing, origin, planet or not."""
        return self.core.frame

    @property
    def nodes(self) -> np.ndarray:
        """Structured array `id, parent, level, resolution, triangles, error, box_min, box_max`."""
        return self.core.nodes

    @property
    def build_seconds(self) -> float:
        """How long its build took; a resumed one counts all its parts."""
        return self.info()["build_seconds"]

    @property
    def bytes(self) -> int:
        """Bytes of its pages and arrays: the same for equal builds, whatever room the database file has."""
        return self.info()["bytes"]

    @property
    def source(self) -> Source:
        """The source; loaded again from `source_spec` when it is not at hand, and checked by its hash.

        Raises StoreError when there is nothing to load it from or the hash differs.
        """
        if self._source is None:
            if not self.source_spec:
                raise StoreError(f"source of {self.path}: it was built from an array in memory; {_PASS}")
            try:
                field = load(self.source_spec)
            except (ValueError, OSError) as error:
                raise StoreError(f"source of {self.path}: {error}; {_PASS}") from error
            self.attach(field)
        return self._source

    def attach(self, source: Source) -> None:
        """Gives the store its source. StoreError when the hash is not that of the source it was built from."""
        found = source.hash()
        if found != self.source_hash:
            raise StoreError(
                f"source of {self.path}: its hash is {found}, but the store was built from {self.source_hash}"
                f" ({self.source_spec or 'an array in memory'})"
            )
        self._source = source

    def info(self) -> dict[str, Any]:
        """What `lodlab info --json` prints."""
        return self.core.info()

    def verify(self) -> None:
        """Reads and checks every page; StoreError names the first that is damaged."""
        self.core.verify()

    def session(self, **options: Any) -> Session:
        """A new session; `options` are the method's draw options."""
        return Session(self, options)

    @property
    def default_session(self) -> Session:
        """The session behind `select`, `cut`, `draw` and `capture`, with default options."""
        if self._session is None:
            self._session = self.session()
        return self._session

    def select(self, view: Any, budget: Any) -> Cut:
        """`Session.select` of the default session."""
        return self.default_session.select(view, budget)

    def cut(self, ids: Any, resolutions: Any = None) -> Cut:
        """`Session.cut` of the default session."""
        return self.default_session.cut(ids, resolutions)

    def draw(self, cut: Cut, view: Any = None, show: str = "shade") -> Frame:
        """Draws a cut with the session that it came from."""
        return _cut("draw", cut)._session.draw(cut, view, show)

    def capture(self, cut: Cut, view: Any = None, everything: bool = True) -> Any:
        """`Session.capture` with the session that the cut came from."""
        return _cut("capture", cut)._session.capture(cut, view, everything)

    def __repr__(self) -> str:
        return f"<lodlab.Store {self.path} ({self.method} of {self.source_spec or 'an array'})>"

    def _repr_html_(self) -> str:
        info = self.info()
        rows = "".join(
            f"<tr><td>{level['level']}</td><td>{level['nodes']:,}</td><td>{level['triangles']:,}</td>"
            f"<td>{level['error_max']:.4g}</td></tr>"
            for level in info["levels"]
        )
        title = f"{self.path.name}: {self.method} of {self.source_spec or 'an array'}, {self.bytes / 1e6:.2f} MB"
        return (
            f"<div><b>{html.escape(title)}</b><table><thead><tr><th>level</th><th>nodes</th>"
            f"<th>triangles</th><th>error bound</th></tr></thead><tbody>{rows}</tbody></table></div>"
        )


def methods() -> list[dict[str, Any]]:
    """All methods with their option tables, as `lodlab methods --json` prints them."""
    return _core.methods()


def method_table(name: str) -> dict[str, Any]:
    """One method's entry of `methods()`; InvalidInput lists the known ones."""
    known = _core.methods()
    for entry in known:
        if entry["name"] == name:
            return entry
    raise InvalidInput(f"method {name!r} is not known; there are {', '.join(m['name'] for m in known)}")


def options_of(name: str, stage: str) -> list[str]:
    """The names of a method's options of one stage, `build` or `draw`."""
    return [o["name"] for o in method_table(name)["options"] if o["stage"] == stage]


def still(method: str, options: Mapping[str, Any]) -> dict[str, Any]:
    """Draw options with streaming turned off where the method has it: records are drawn with all data."""
    known = {option["name"]: option for option in method_table(method)["options"]}
    if "stream" not in known:
        return dict(options)
    return {**options, "stream": False, "gpu_cache_mb": known["gpu_cache_mb"]["range"][1]}


def build(
    source: Any,
    method: str,
    path: str | os.PathLike[str],
    *,
    mode: str = "new",
    progress: bool = True,
    **options: Any,
) -> Store:
    """Builds a store and opens it.

    `source`: HeightField, SOURCE text or 2-D array. `options`: the method's build options. `mode`: "new"
    (the file must not exist), "force" (replace), "resume" (take up an interrupted build). InvalidInput for
    an unknown method or option, Unsupported when the method does not accept the source, StoreError when the
    file stands in the way.
    """
    from ..progress import Progress

    by_rows = method_table(method)["by_rows"]
    field = as_source(source)
    given = field.core if by_rows else field.loaded().core
    with Progress(f"build {method}", progress) as bar:
        core = _core.build(given, method, os.fspath(path), options, mode, bar.stage)
    return Store(core, field)


def open(path: str | os.PathLike[str], source: Any = None) -> Store:
    """Opens a store; version, completeness and checksums are checked. `source` spares loading it again."""
    store = Store(_core.open(os.fspath(path)))
    if source is not None:
        store.attach(as_source(source))
    return store


def as_store(value: Any) -> Store:
    """A store as it is; the file of one opened. InvalidInput for anything else."""
    if isinstance(value, Store):
        return value
    if isinstance(value, (str, os.PathLike)) and (is_store(value) or os.path.exists(f"{os.fspath(value)}.partial")):
        return open(value)
    raise InvalidInput(f"store: {value!r} is no lodlab.Store and no file of one; lodlab.build(source, ...) makes one")
