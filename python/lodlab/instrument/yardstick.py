# SPDX-License-Identifier: MIT
"""What drawn cuts are measured against: `full` of the same source, built once and its pictures kept."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from .. import _core, pictures
from ..disk import temporary_folder
from ..sources.base import Source
from ..stores.build import store_for
from ..stores.methods import options_of, still
from ..stores.store import Store
from .metrics import measure

PICTURE_SAMPLES = 32_000_000  # above it the reference is not drawn and its columns are nan
REFERENCE_BYTES = 1 << 30  # of cached reference pictures, per source
MEASURES = ("all", "geometry")  # geometry: no picture is drawn to measure, and columns that need one are nan


class Yardstick:
    """The instrument of one source: `full` of it drawn as the reference, pictures cached by view."""

    def __init__(
        self,
        source: Source,
        folder: Path | None = None,
        progress: bool = True,
        options: Mapping[str, Any] | None = None,
        metrics: str = "all",
        named: bool = False,
    ):
        self.source = source
        self.metrics = metrics
        self.options = dict(options or {})
        self._folder = folder
        self._named = named
        self._progress = progress
        self._instrument: Any = None
        self._references: dict[Any, Any] = {}
        self._bytes = 0

    @property
    def pictures(self) -> bool:
        """Whether there are reference pictures; without, their columns are nan. None above 32 M samples."""
        few = not self.source.windowed and self.source.samples <= PICTURE_SAMPLES
        return few and self.metrics == "all"

    def instrument(self) -> Any:
        """The core's instrument; builds `full` on first use."""
        if self._instrument is None:
            session = None
            if self.pictures:
                if self._folder is None:
                    self._folder = temporary_folder(self)
                store = store_for(
                    self.source, "full", self.options, self._folder, progress=self._progress, named=self._named
                )
                session = store.core.session(still(store.method, {}))
            self._instrument = _core.Instrument(self.source.core, session)
        return self._instrument

    def reference(self, view: Any, cut: Any = None) -> Any:
        """The reference picture of a view, the source deformed as a cut is; None without `pictures`."""
        if not self.pictures:
            return None
        pose = None if cut is None else cut.control_positions
        key = view if pose is None else (view, pose.tobytes())
        if key not in self._references:
            made = self.instrument().reference(view, cut)
            self._bytes += made.nbytes
            while self._references and self._bytes > REFERENCE_BYTES:
                self._bytes -= self._references.pop(next(iter(self._references))).nbytes
            self._references[key] = made
        return self._references[key]

    def measure(self, session: Any, cut: Any, view: Any, before: Any = None) -> dict[str, Any]:
        """The accuracy columns of one drawn cut; `before`: the cut of the frame before."""
        reference = self.reference(view, cut)
        return measure(self.instrument(), session, cut, view, reference, pictures=reference is not None, before=before)

    def error_picture(self, session: Any, cut: Any, view: Any) -> np.ndarray:
        """(H', W', 4) uint8: a drawn cut coloured by its measured error, with a scale in pixels."""
        measurement = self.instrument().examine(session, cut, view)
        return pictures.error_picture(measurement.image, measurement.error_px())


def look_of(store: Store) -> dict[str, Any]:
    """Build options that `full` must share with a store to look like it: the colour raster, not the error."""
    return {k: store.options[k] for k in options_of("full", "build") if k in store.options and k != "finest_error"}
