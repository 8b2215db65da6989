# SPDX-License-Identifier: MIT
"""Rows of frames, runs and noise, and the tables that they make: `frames.csv`, `summary.csv`, `noise.csv`."""

from __future__ import annotations

import csv
import io
import json
import math
import warnings
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InvalidInput, StoreError
from ..instrument import statistics
from ..instrument.metrics import METRICS
from .columns import COSTS, EXTRAS, FLAG, HASHES, KEYS, NOISE, TEXT

KEY_COLUMNS = tuple(column.name for column in KEYS)
COST_COLUMNS = tuple(column.name for column in COSTS)
TIME_COLUMNS = ("select_ms", "gpu_ms", "frame_ms")
ACCURACY_COLUMNS = tuple(metric.name for metric in METRICS)
SMALLER_IS_WORSE = tuple(metric.name for metric in METRICS if metric.smaller_is_worse)
EXTRA_COLUMNS = tuple(column.name for column in EXTRAS)
HASH_COLUMNS = tuple(column.name for column in HASHES)
FRAME_COLUMNS = KEY_COLUMNS + COST_COLUMNS + ACCURACY_COLUMNS + EXTRA_COLUMNS + HASH_COLUMNS
OPTION = "option."  # `summary.csv` has a column more for every option that some run has
SUMMARY_COLUMNS = (
    tuple(c for c in KEY_COLUMNS if c != "frame")
    + tuple(f"{c}_{s}" for c in COST_COLUMNS for s in ("median", "p95", "p99"))
    + tuple(f"{c}_{s}" for c in ACCURACY_COLUMNS for s in ("worst", "median"))
    + ("store_bytes", "build_seconds", "gpu_clock", "frames", "accuracy_frames")
    + tuple(f"{c}_median_{s}" for c in TIME_COLUMNS for s in ("low", "high"))
    + HASH_COLUMNS
    + ("source_kind",)
)
NOISE_COLUMNS = tuple(column.name for column in NOISE)
_TABLES = (*KEYS, *EXTRAS, *HASHES, *NOISE)
TEXT_COLUMNS = tuple(dict.fromkeys(column.name for column in _TABLES if column.unit == TEXT))
_FLAG_COLUMNS = tuple(column.name for column in _TABLES if column.unit == FLAG)
_COLUMNS = {"frames.csv": FRAME_COLUMNS, "summary.csv": SUMMARY_COLUMNS, "noise.csv": NOISE_COLUMNS}


def cell(value: Any) -> str:
    """One CSV cell: `true`/`false`, empty when unset (None), `nan`, `inf`, shortest exact number."""
    if value is None:
        return ""
    if isinstance(value, (bool, np.bool_)):
        return "true" if value else "false"
    if isinstance(value, (int, np.integer)):
        return str(int(value))
    if isinstance(value, (float, np.floating)):
        number = float(value)
        if math.isnan(number):
            return "nan"
        if math.isinf(number):
            return "inf" if number > 0 else "-inf"
        return repr(number)
    return str(value)


def options_text(options: Mapping[str, Any]) -> str:
    """Compact JSON of all options, keys sorted: the column `options`."""
    return json.dumps(dict(options), sort_keys=True, separators=(",", ":"))


def summarize(
    rows: Sequence[Mapping[str, Any]], *, store_bytes: int, build_seconds: float, times: np.ndarray | None = None
) -> dict[str, Any]:
    """The summary row of a run's frame rows: medians and percentiles of costs, worst and median of errors.

    `times`: (passes, frames, 3) of every timing pass, for the intervals of the medians; the rows' own when left
    out. `predicted_px` is known in every frame; the other accuracy columns are taken over the frames that were
    measured, and are nan when none was.
    """
    first = rows[0]
    out: dict[str, Any] = {c: first[c] for c in KEY_COLUMNS if c != "frame"}
    out["budget_met"] = all(r["budget_met"] for r in rows)
    out["promises_bound"] = all(r["promises_bound"] for r in rows)
    for column in COST_COLUMNS:
        values = np.array([r[column] for r in rows], dtype=np.float64)
        out[f"{column}_median"] = float(np.median(values))
        out[f"{column}_p95"] = float(np.percentile(values, 95))
        out[f"{column}_p99"] = float(np.percentile(values, 99))
    for column in ACCURACY_COLUMNS:
        values = np.array([r[column] for r in rows], dtype=np.float64)
        values = values[~np.isnan(values)]
        worst = np.min if column in SMALLER_IS_WORSE else np.max
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # the median of two infinities
            out[f"{column}_worst"] = float(worst(values)) if values.size else math.nan
            out[f"{column}_median"] = float(np.median(values)) if values.size else math.nan
    out["store_bytes"] = store_bytes
    out["build_seconds"] = build_seconds
    out["gpu_clock"] = first["gpu_clock"]
    out["frames"] = len(rows)
    out["accuracy_frames"] = sum(1 for r in rows if r["accuracy"])
    if times is None:
        times = np.array([[[r[c] for c in TIME_COLUMNS] for r in rows]], dtype=np.float64)
    for column, (low, high) in zip(TIME_COLUMNS, statistics.median_intervals(times).T.tolist(), strict=True):
        out[f"{column}_median_low"], out[f"{column}_median_high"] = low, high
    out.update({column: first[column] for column in (*HASH_COLUMNS, "source_kind")})
    out.update({f"{OPTION}{name}": value for name, value in json.loads(first["options"]).items()})
    return out


def summary_columns(rows: Iterable[Mapping[str, Any]], known: Sequence[str] = ()) -> tuple[str, ...]:
    """The columns of a summary of these rows: SUMMARY_COLUMNS, those of options that are `known` already, then new
    ones in the order of their names."""
    known = [c for c in known if c.startswith(OPTION)]
    new = {c for row in rows for c in row if c.startswith(OPTION)} - set(known)
    return (*SUMMARY_COLUMNS, *known, *sorted(new))


def summary_table(rows: Sequence[Mapping[str, Any]]) -> Any:
    """Summary rows as a DataFrame that equals the one read back from `summary.csv`."""
    columns = summary_columns(rows)
    return table([{c: row.get(c) for c in columns} for row in rows], columns)


def read_table(path: Path | str) -> Any:
    """A `frames.csv`, `summary.csv` or `noise.csv` as a pandas DataFrame: bools as bool, unset and undefined as NaN.

    StoreError where it is not whole: cut off, a column missing, a row or a cell that is none.
    """
    import pandas as pd

    path = Path(path)
    if not path.is_file():
        raise InvalidInput(f"read results: no file {path} (a run directory has frames.csv and summary.csv)")
    data = path.read_bytes()
    try:
        header, *rows = csv.reader(io.StringIO(data.decode(), newline=""))
    except (ValueError, csv.Error) as error:  # not text, or empty
        why = f"it is no table ({error})" if data else "it is empty"
        raise _damaged(path, why, cut=not data) from None
    if absent := [c for c in _COLUMNS.get(path.name, ()) if c not in header]:
        raise _damaged(path, f"it has no column {absent[0]}")
    for number, row in enumerate(rows, 1):
        if len(row) != len(header):
            raise _damaged(path, f"row {number} has {len(row)} of {len(header)} cells", cut=True)
    if not data.endswith(b"\n"):
        raise _damaged(path, f"its last row, {len(rows)}, is cut off", cut=True)
    text = {c: str for c in header if c in TEXT_COLUMNS}
    missing = {c: ["", "nan"] for c in header if c not in TEXT_COLUMNS and c not in _FLAG_COLUMNS}
    table = pd.read_csv(io.BytesIO(data), dtype=text, keep_default_na=False, na_values=missing)
    for column in (c for c in _COLUMNS.get(path.name, ()) if c not in text):
        flag = column in _FLAG_COLUMNS
        if table.empty:
            table[column] = table[column].astype("bool" if flag else "float64")
        elif (table[column].dtype.kind == "b") != flag or table[column].dtype.kind not in "biuf":
            raise _damaged(path, f"column {column} holds what is no {'flag' if flag else 'number'}")
    return table


def _damaged(path: Path, why: str, *, cut: bool = False) -> StoreError:
    """`cut`: what is whole of it can be used."""
    again = "a sweep of its config.toml into this directory flies again what is not whole"
    cure = "" if not cut else "; without it the runs can still be read" if path.name == "noise.csv" else f"; {again}"
    return StoreError(f"read results: {path} is damaged, or of another version: {why}{cure}")


def read_runs(folder: Path) -> tuple[Any, Any]:
    """`frames.csv` and `summary.csv` of a run directory. StoreError where a finished run lacks frames."""
    frames, summary = (read_table(folder / name) for name in ("frames.csv", "summary.csv"))
    there = frames["run"].value_counts()
    for run, count in summary[["run", "frames"]].itertuples(index=False):
        if there.get(run, 0) < count:
            why = f"run {run} has {there.get(run, 0)} of {count} frames"
            raise _damaged(folder / "frames.csv", why, cut=True)
    return frames, summary


def read_noise(folder: Path | None) -> Any:
    """`noise.csv` of a run directory, or None where there is none."""
    file = None if folder is None else folder / "noise.csv"
    return read_table(file) if file is not None and file.is_file() else None


def table(rows: Iterable[Mapping[str, Any]], columns: Sequence[str]) -> Any:
    """Rows as a DataFrame that equals the one read back from the file."""
    import pandas as pd

    frame = pd.DataFrame([[r[c] for c in columns] for r in rows], columns=list(columns))
    for column in ("budget_pixel_error", "budget_triangles", "budget_nodes"):
        if column in frame:
            frame[column] = frame[column].astype("float64")
    return frame
