# SPDX-License-Identifier: MIT
"""The gate for a user's own CI: figures of a run directory against limits.

A limit on a column of `frames.csv` holds in every frame (of an accuracy column: in every frame that was
measured), one on a column of `summary.csv` in every run. What is not there passes no gate: an undefined
figure, a run without measured frames, and a run of the configuration that never ended are violations.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import InvalidInput, close_to
from . import tables
from .configs import freeze, plan
from .toml import read_config

#: Undefined in the first frame of a run, which no frame goes before.
_FROM_SECOND_FRAME = ("pop_px_max", "pop_area")
#: Known in every frame, measured or not.
_ALWAYS_KNOWN = ("predicted_px",)


@dataclass(frozen=True)
class Violation:
    """A figure outside its limit. `frame`: None for a figure of the whole run; `value`: nan where undefined or
    missing; `bound`: max or min."""

    run: str
    frame: int | None
    column: str
    value: float
    bound: str
    limit: float
    missing: bool = False  # there is no such figure at all

    def __str__(self) -> str:
        where = f"run {self.run}" + ("" if self.frame is None else f", frame {self.frame}")
        limit = f"{'at most' if self.bound == 'max' else 'at least'} {self.limit:g}"
        if self.missing:
            return f"{where}: {self.column} is missing (limit: {limit})"
        return f"{where}: {self.column} is {self.value:.6g} (limit: {limit})"


def check(
    run_directory: str | os.PathLike[str],
    *,
    max: Mapping[str, float] | None = None,
    min: Mapping[str, float] | None = None,
) -> list[Violation]:
    """Every figure of a run directory that is outside its limits, undefined or missing; empty when all hold.

    `max`, `min`: column -> limit, of `frames.csv` or `summary.csv`; flags count as 0 and 1, an infinite
    `psnr_db` passes every `min`. Frames that were not measured count for no accuracy column, a run's first
    frame for no `pop_` column. InvalidInput: no run directory, no finished run, no limits, a limit that is no
    number, an unknown column (naming those that are close to it, or all).
    """
    folder = Path(run_directory)
    if not folder.is_dir():
        raise InvalidInput(f"check: no directory {folder}")
    frames, summary = (tables.read_table(folder / name) for name in ("frames.csv", "summary.csv"))
    planned = [task.flight.name for task in plan(freeze(read_config(folder / "config.toml")))]
    if summary.empty:
        raise InvalidInput(f"check: {folder} holds no finished run")
    limits = [*_limits("max", max, frames, summary), *_limits("min", min, frames, summary)]
    if not limits:
        raise InvalidInput("check: no limits; give at least one, as max={'measured_px_max': 1}")
    never_ended = [name for name in planned if name not in set(summary["run"])]
    out: list[Violation] = []
    for column, bound, limit in limits:
        found = _in_frames if column in frames else _in_summary
        for run, frame, value in found(column, frames, summary):
            if value is None:
                out.append(Violation(run, frame, column, math.nan, bound, limit, missing=True))
            elif not (value <= limit if bound == "max" else value >= limit):
                out.append(Violation(run, frame, column, value, bound, limit))
        out += [Violation(name, None, column, math.nan, bound, limit, missing=True) for name in never_ended]
    return out


def _limits(
    bound: str, given: Mapping[str, float] | None, frames: Any, summary: Any
) -> Iterator[tuple[str, str, float]]:
    """(column, bound, limit), checked."""
    known = [
        name
        for name in dict.fromkeys([*frames.columns, *summary.columns])
        if name not in tables.TEXT_COLUMNS and name not in ("frame", "accuracy")
    ]
    for column, value in (given or {}).items():
        try:
            limit = float(value)
        except (TypeError, ValueError):
            limit = math.nan
        if math.isnan(limit):
            raise InvalidInput(f"check: the {bound} of {column} is {value!r}, no number")
        if column not in known:
            close = close_to(column, known)
            cure = f"close to it: {', '.join(close)}" if close else f"there are {', '.join(known)}"
            raise InvalidInput(f"check: no column {column!r} to limit; {cure} (lodlab check --help says what they are)")
        yield column, bound, limit


def _in_frames(column: str, frames: Any, summary: Any) -> Iterator[tuple[str, int | None, float | None]]:
    """(run, frame, value) for every frame that must have this figure; (run, None, None) where one has none."""
    measured = column in tables.ACCURACY_COLUMNS and column not in _ALWAYS_KNOWN
    for run, expected in summary[["run", "accuracy_frames" if measured else "frames"]].itertuples(index=False):
        rows = frames[frames["run"] == run]
        if measured:
            rows = rows[rows["accuracy"]]
        whole = len(rows) >= expected
        if column in _FROM_SECOND_FRAME:
            rows = rows[rows["frame"] > 0]
        if rows.empty or not whole:
            yield run, None, None
        for frame, value in zip(rows["frame"], rows[column], strict=True):
            yield run, int(frame), float(value)


def _in_summary(column: str, frames: Any, summary: Any) -> Iterator[tuple[str, None, float]]:
    for run, value in zip(summary["run"], summary[column], strict=True):
        yield run, None, float(value)
