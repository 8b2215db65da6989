# SPDX-License-Identifier: MIT
"""A session on a store: cuts by view and budget or by hand, their pictures and triangles as the GPU emits them."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import _core
from ..errors import InvalidInput, check_one_of

if TYPE_CHECKING:
    from .store import Store

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

    @property
    def control_positions(self) -> np.ndarray | None:
        """(V, 3) float64: the control positions that it was selected for; None: at rest."""
        return self.core.control_positions

    @property
    def digest(self) -> str:
        """Equal texts: two cuts of a store draw the same, whatever view draws them."""
        return self._session.core.digest(self.core)

    def to_trimesh(self, view: Any = None, *, colors: bool = True) -> Any:
        """The whole cut as a `trimesh.Trimesh` in source coordinates.

        The surface is the one that the GPU emits for `view` (default: the cut's own). Fillers are left
        out, equal vertices are merged bit for bit, triangles without area dropped. Height fields with
        voids: triangles over a void are kept. A store with a colour raster, or of a mesh with colours, gives its
        vertices theirs, unless `colors` is False; StoreError when they cannot be read any more.
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
        shades = export.colors(self._session.store, vertices, self.control_positions) if colors else None
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


def points_of(what: str, value: Any) -> np.ndarray:
    """Control positions as float64; the core looks at their shape."""
    try:
        return np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise InvalidInput(f"{what}: control_positions is {type(value).__name__}, no array of numbers") from None


def checked_cut(what: str, value: Any) -> Cut:
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

    def select(self, view: Any, budget: Any, control_positions: Any = None) -> Cut:
        """The cut for a view under a budget (a dict will do). Unsupported: one that the method does not list.

        `control_positions`: (V, 3), where the store's control points are (`Store.control_positions` at rest). The cut
        is drawn, captured and measured as they deform the mesh. InvalidInput for another shape and for what is not
        finite; Unsupported where the method has no control points.
        """
        pose = None if control_positions is None else points_of("select", control_positions)
        return Cut(self.core.select(_view("select", view), as_budget(budget), pose), self)

    def cut(self, ids: Any, resolutions: Any = None) -> Cut:
        """A cut by hand from node ids (N,) and, where nodes have several, resolutions (N,).

        InvalidInput names the first gap, overlap or broken rule.
        """
        numbers = _whole_numbers("node ids", ids, np.int64)
        chosen = None if resolutions is None else _whole_numbers("resolutions", resolutions, np.int32)
        return Cut(self.core.cut(numbers, chosen), self)

    def draw(self, cut: Cut, view: Any = None, show: str = "shade") -> Frame:
        """Draws a cut; `show` is one of shade, normal, level, wire. `view` defaults to the cut's own."""
        view = _view("draw", checked_cut("draw", cut).view if view is None else view)
        check_one_of("draw: show", show, SHOWS)
        if show == "wire":
            return Frame(self.core.wire(cut.core, view).image)
        drawn = self.core.draw(cut.core, view, show)
        return Frame(drawn.image, drawn.depth)

    def capture(self, cut: Cut, view: Any = None, everything: bool = True) -> Any:
        """The triangles as the GPU emits them: `triangles` (T, 3, 3) float64, `kind` (T,), `node` (T,).

        `everything=False` leaves out the nodes outside the view.
        """
        view = _view("capture", checked_cut("capture", cut).view if view is None else view)
        return self.core.capture(cut.core, view, everything)

    def reset(self) -> None:
        """Forgets adaptation state; caches stay warm."""
        self.core.reset()

    def settle(self) -> None:
        """Waits until everything requested so far is resident."""
        self.core.settle()
