# SPDX-License-Identifier: MIT
"""Stores: open one, and select, draw and capture through a session.

`Store` is a thin face over the core's store: it keeps the source at hand (the instrument needs it), shows
progress, and hands out sessions. A session owns GL objects and belongs to the thread that first draws
with it; `store.select` and its like use a default session, made on first use.
"""

from __future__ import annotations

import html
import os
from pathlib import Path
from typing import Any

import numpy as np

from .. import _core
from ..disk import is_store
from ..errors import InvalidInput, StoreError
from ..sources.base import Source
from ..sources.datasets import as_source, load
from ..sources.mesh import Mesh
from ..sources.polygons import MeshData
from .session import Cut, Frame, Session, checked_cut, points_of

_PASS = "pass it (source=SOURCE), or measure nothing (accuracy_frames=0)"


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
    def source_kind(self) -> str:
        """The kind of source that it was built from: heightfield, planet, mesh."""
        return self.frame["kind"]

    @property
    def frame(self) -> dict[str, Any]:
        """Where the source lies: rows, columns, spacing, origin, planet or not."""
        return self.core.frame

    @property
    def nodes(self) -> np.ndarray:
        """Structured array `id, parent, level, resolution, triangles, error, box_min, box_max`."""
        return self.core.nodes

    @property
    def control_positions(self) -> np.ndarray:
        """(V, 3) float64: the control points at rest, source units; `select` takes where they are moved to.

        Unsupported where the method has none.
        """
        return self.core.control_positions

    def deformed(self, control_positions: Any) -> Mesh:
        """The source as these control positions, (V, 3), deform it: what cuts of that pose are measured against.

        InvalidInput and Unsupported as `Session.select`.
        """
        source, pose = self.source, points_of("deformed", control_positions)
        positions = self.core.carry(source.core, pose)
        return Mesh.made(MeshData(positions, source.faces, source.colors), f"{source.name}, deformed", "")

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

    def select(self, view: Any, budget: Any, control_positions: Any = None) -> Cut:
        """`Session.select` of the default session."""
        return self.default_session.select(view, budget, control_positions)

    def cut(self, ids: Any, resolutions: Any = None) -> Cut:
        """`Session.cut` of the default session."""
        return self.default_session.cut(ids, resolutions)

    def draw(self, cut: Cut, view: Any = None, show: str = "shade") -> Frame:
        """Draws a cut with the session that it came from."""
        return checked_cut("draw", cut)._session.draw(cut, view, show)

    def capture(self, cut: Cut, view: Any = None, everything: bool = True) -> Any:
        """`Session.capture` with the session that the cut came from."""
        return checked_cut("capture", cut)._session.capture(cut, view, everything)

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
