# SPDX-License-Identifier: MIT
"""`lodlab calibrate`: every metric against values known on paper.

Cases (`cases/`) go the way of any source: a store is built, a cut selected, drawn and captured, and only then
measured. What is drawn in a case's place are stores of other fields, so that the error is known beforehand.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from .. import _core
from ..errors import InvalidInput
from ..sources.base import Source
from ..stores.build import build
from .cases.case import Case, Drawn
from .metrics import METRICS, Metric

COLUMNS = ("metric", "case", "expected", "returned", "deviation", "tolerance", "pass")
SHARE = 1e-3  # of the paper value
PIXELS = 0.01  # where the paper value is 0 pixels
ANYTHING = 1e9  # pixels: a budget that the coarsest cut meets


def all_cases() -> list[Case]:
    """Every case, in the order of the table."""
    from .cases.cracks import crack_cases  # not at start-up: they make height fields
    from .cases.meshes import mesh_cases
    from .cases.pixels import pixel_cases
    from .cases.planet import planet_cases
    from .cases.samples import sample_cases

    return [*sample_cases(), *planet_cases(), *crack_cases(), *pixel_cases(), *mesh_cases()]


def calibrate(progress: bool = True) -> Any:
    """Measures every case: a DataFrame, a row per metric and case, in the order of `METRICS`.

    Columns: `metric`, `case`, `expected` (the paper value), `returned`, `deviation` (returned less expected; 0
    where both are inf or both nan), `tolerance` (the same unit) and `pass`. Tolerances: 0.1 % of the paper value;
    where that is 0, 0.01 pixel, and in source units the slack of float positions; counts are exact. Takes seconds.
    """
    return calibrate_cases(all_cases(), progress=progress)


def calibrate_cases(cases: Sequence[Case], *, progress: bool = False) -> Any:
    """The table of `calibrate` for these cases. InvalidInput when a case expects a metric that there is not."""
    import pandas as pd

    from ..progress import tqdm

    rank = {metric.name: i for i, metric in enumerate(METRICS)}
    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory(prefix="lodlab-calibrate-") as folder:
        bench = _Bench(Path(folder))
        for case in tqdm(cases, desc="calibrate", unit="case", disable=not progress):
            rows.extend(bench.rows(case))
    rows.sort(key=lambda row: rank[row["metric"]])
    return pd.DataFrame(rows, columns=list(COLUMNS))


class _Bench:
    """Stores, sessions and instruments of the cases' fields; equal fields share them."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._metrics = {metric.name: metric for metric in METRICS}
        self._stores: dict[Any, Any] = {}
        self._sessions: dict[Any, Any] = {}
        self._instruments: dict[str, Any] = {}

    def rows(self, case: Case) -> list[dict[str, Any]]:
        measured = self._measure(case)
        return [self._row(case, name, float(value), measured) for name, value in case.expected.items()]

    def _row(self, case: Case, name: str, expected: float, measured: Any) -> dict[str, Any]:
        if name not in self._metrics:
            raise InvalidInput(f"calibrate: case {case.name!r} expects {name!r}, which is no metric")
        metric = self._metrics[name]
        returned = float(metric.of(measured))
        same = returned == expected or (math.isnan(returned) and math.isnan(expected))
        deviation = 0.0 if same else returned - expected
        tolerance = _tolerance(metric, expected, self._instrument(case.source).slack(case.view))
        return {
            "metric": name,
            "case": case.name,
            "expected": expected,
            "returned": returned,
            "deviation": deviation,
            "tolerance": tolerance,
            "pass": abs(deviation) <= tolerance,
        }

    def _measure(self, case: Case) -> Any:
        instrument = self._instrument(case.source)
        parts = [self._part(drawn, case.view) for drawn in case.drawn]
        before = [self._part(drawn, case.view) for drawn in case.before]
        return instrument.examine_parts(parts, case.view, instrument.reference(case.view), True, before)

    def _instrument(self, source: Source) -> Any:
        key = source.hash()
        if key not in self._instruments:
            self._instruments[key] = _core.Instrument(source.core, self._session(Drawn(source)))
        return self._instruments[key]

    def _part(self, drawn: Source | Drawn, view: Any) -> tuple[Any, Any]:
        """(session, cut): all of it, or the nodes that it names."""
        if not isinstance(drawn, Drawn):
            drawn = Drawn(drawn)
        session = self._session(drawn)
        if drawn.nodes is not None:
            return session, session.cut(list(drawn.nodes))
        anything = {} if drawn.method == "full" else {"pixel_error": ANYTHING}
        return session, session.select(view, _core.Budget(**(drawn.budget or anything)))

    def _session(self, drawn: Drawn) -> Any:
        key = (drawn.field.hash(), drawn.method, tuple(sorted(drawn.build.items())))
        if key not in self._stores:
            path = self._folder / f"{len(self._stores)}.lod"
            self._stores[key] = build(drawn.field, drawn.method, path, progress=False, **drawn.build).core
        session = (key, tuple(sorted(drawn.draw.items())))
        if session not in self._sessions:
            self._sessions[session] = self._stores[key].session(dict(drawn.draw))
        return self._sessions[session]


def _tolerance(metric: Metric, expected: float, slack: float) -> float:
    counts = metric.unit == "count" or metric.name.endswith("_pixels")
    if counts or not math.isfinite(expected):
        return 0.0
    if expected != 0.0:
        return SHARE * abs(expected)
    return {"px": PIXELS, "source units": slack}.get(metric.unit, 0.0)
