# SPDX-License-Identifier: MIT
"""Results as curves: the tables of whatever holds runs, one curve for each method and set of options, their colours and
marks, and how a budget is written."""

from __future__ import annotations

import json
import math
import os
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..chart import COLOURS, INK, MARKERS, short
from ..errors import InvalidInput
from ..instrument.metrics import BASELINE
from ..runs.run import Run
from ..runs.sweep import Sweep
from ..runs.tables import read_noise, summary_table


def tables_of(result: Any) -> tuple[Any, Any, Any]:
    """(frames, summary, noise or None) of a Run, Sweep, list of them, or run directory."""
    import pandas as pd

    if isinstance(result, Run):
        return result.frames, summary_table([result.summary]), read_noise(result.directory)
    if isinstance(result, Sweep):
        return result.frames, result.summary, result.noise
    if isinstance(result, (list, tuple)) and result:
        parts = list(zip(*(tables_of(item) for item in result), strict=True))
        join = [None if any(p is None for p in part) else pd.concat(part, ignore_index=True) for part in parts]
        return join[0], join[1], join[2]
    if isinstance(result, (str, os.PathLike)):
        return tables_of(Sweep.load(result))
    raise InvalidInput(f"chart: {type(result).__name__} is no run, sweep or run directory")


@dataclass
class Series:
    """A curve: one method under one set of options, its budgets in the order of growing error."""

    label: str
    method: str
    points: Any  # DataFrame, rows of the summary
    baseline: bool


def series_of(summary: Any) -> list[Series]:
    """Curves of a summary table. A method with several option sets gets a curve for each, named by what varies."""
    sets: dict[str, list[str]] = {}
    for method, options in zip(summary["method"], summary["options"], strict=True):
        known = sets.setdefault(method, [])
        if options not in known:
            known.append(options)
    out: list[Series] = []
    several = len([m for m in sets if m != BASELINE]) > 1
    for method, option_sets in sets.items():
        parsed = [json.loads(text) for text in option_sets]
        varied = [k for k in parsed[0] if len({json.dumps(p.get(k)) for p in parsed}) > 1]
        for text, values in zip(option_sets, parsed, strict=True):
            rows = summary[(summary["method"] == method) & (summary["options"] == text)]
            rows = rows.sort_values(["budget_pixel_error", "budget_triangles", "budget_nodes"])
            label = ", ".join([*([method] if several or not varied else []), *(f"{k} {values[k]}" for k in varied)])
            baseline = rows[["budget_pixel_error", "budget_triangles", "budget_nodes"]].isna().all(axis=None)
            out.append(Series(label, method, rows, bool(baseline)))
    return out


def dress(series: list[Series], theme: str) -> dict[str, tuple[str, str]]:
    """Colour and marker for each label; the baseline takes the ink and a star. The curves of one method, or more
    of them than there are colours, take a scale of colours in their order."""
    out, n = {}, 0
    curves = [item for item in series if not item.baseline]
    colours = COLOURS[theme]
    if len(curves) > len(colours) or (len(curves) > 2 and len({item.method for item in curves}) == 1):
        colours = _scale_of_colours(len(curves), theme)
    for item in series:
        if item.baseline:
            out[item.label] = (INK[theme]["full"], "*")
        else:
            out[item.label] = (colours[n], MARKERS[n % len(MARKERS)])
            n += 1
    return out


def _scale_of_colours(count: int, theme: str) -> list[str]:
    """So many colours of viridis, which orders them for every reader, without its end that the page swallows."""
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    low, high = (0.0, 0.85) if theme == "light" else (0.25, 1.0)
    return [to_hex(colormaps["viridis"](at)) for at in np.linspace(low, high, count)]


def studies(rows: Any) -> list[tuple[str, Any]]:
    """A group's rows as (suffix of its name, rows of one row of panels): methods of one set of options together,
    without a suffix; each other method, which is studied, by itself; the baseline with all."""
    sets = rows.groupby("method", sort=False)["options"].nunique()
    baseline = rows["method"] == BASELINE
    studied = [method for method, count in sets.items() if count > 1 and method != BASELINE]
    others = rows[~rows["method"].isin(studied)]
    together = [("", others)] if not studied or (others["method"] != BASELINE).any() else []
    return together + [(f" · {method}", rows[baseline | (rows["method"] == method)]) for method in studied]


def budget_label(row: Any) -> str:
    """A budget as written at its point: `2 px`, `100k tri`, `400 nodes`."""
    parts = []
    if not math.isnan(row["budget_pixel_error"]):
        parts.append(f"{row['budget_pixel_error']:g} px")
    if not math.isnan(row["budget_triangles"]):
        parts.append(f"{short(row['budget_triangles'])} tri")
    if not math.isnan(row["budget_nodes"]):
        parts.append(f"{short(row['budget_nodes'])} nodes")
    return ", ".join(parts)
