# SPDX-License-Identifier: MIT
"""Benchmarks: each figure beside a reference that was measured in the same process, interleaved with it.

``run(["draw"])`` returns records ``{bench, case, value, unit, reference, reference_value, ratio, device, commit,
options, seed}``; ``ratio`` is always "larger is better" and carries the ends of its bootstrap 95 % interval
(``ratio_low``, ``ratio_high``), ``details`` says what else was seen. ``check(records)`` compares them with
``benchmarks/bars.toml``, in which the promises stand.

Times are taken inside the core, so that no interpreter stands between the two clocks. Nothing is measured on
fewer than five repeats, and medians are compared, never means.
"""

from __future__ import annotations

import fnmatch
import json
import math
import os
import tempfile
import tomllib
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InvalidInput
from ..sources.spec import find_file
from . import meshes, multigrain, subdivision, windowed
from .costs import build, demo, draw, memory, select
from .lab import Lab, Record, Say
from .measuring import accuracy, measure_frames

BENCHES: dict[str, tuple[Callable[[Lab], Iterable[Record]], ...]] = {
    "draw": (draw, multigrain.draw, meshes.draw),
    "select": (select, multigrain.select),
    "build": (build, multigrain.build, meshes.build),
    "memory": (memory, windowed.memory, subdivision.memory),
    "measure": (measure_frames, meshes.measure),
    "accuracy": (accuracy, multigrain.accuracy, meshes.accuracy, subdivision.accuracy),
    "cuts": (multigrain.cuts,),
    "size": (subdivision.size,),
    "refine": (subdivision.refine,),
    "demo": (demo,),
}


def names() -> dict[str, str]:
    """Every benchmark's name with one sentence on it."""
    return {name: (parts[0].__doc__ or "").strip().splitlines()[0] for name, parts in BENCHES.items()}


def run(which: Sequence[str] | None = None, *, say: Say | None = None) -> list[Record]:
    """Runs the named benchmarks, all when none is named.

    Args:
        which: Names of ``names()``.
        say: Called with a line before each case.

    Returns:
        One record a case, in order.

    Raises:
        InvalidInput: An unknown name; the known ones are listed.
    """
    wanted = list(which or BENCHES)
    for name in wanted:
        if name not in BENCHES:
            raise InvalidInput(f"bench: no benchmark {name!r}; known: {', '.join(BENCHES)}")
    out: list[Record] = []
    with tempfile.TemporaryDirectory(prefix="lodlab-bench-") as folder:
        lab = Lab(Path(folder), say or (lambda text: None))
        for name in wanted:
            for part in BENCHES[name]:
                out.extend(part(lab))
    return out


def to_json(records: Sequence[Record]) -> str:
    """Records as JSON text; a figure that is not there (nan) is null."""

    def clean(value: Any) -> Any:
        if isinstance(value, dict):
            return {k: clean(v) for k, v in value.items()}
        if isinstance(value, (float, np.floating)):
            return float(value) if math.isfinite(value) else None
        return value.item() if isinstance(value, np.generic) else value

    return json.dumps([clean(r) for r in records], indent=2)


def bars_file() -> Path:
    """Where the promises stand: the source tree's benchmarks/bars.toml, or the copy that was installed."""
    here = Path(__file__).resolve().parent
    tree = here.parents[2] / "benchmarks" / "bars.toml"
    return tree if tree.exists() else here.parent / "bars.toml"


def _field(record: Record, name: str) -> float:
    """A figure of a record, nan where it is not there; `details.NAME` is one of its details."""
    group, _, detail = name.rpartition(".")
    value = (record.get(group, {}) if group else record).get(detail)
    return math.nan if value is None else float(value)


def check(records: Sequence[Record], bars: Path | None = None) -> list[str]:
    """One line for each bar that does not hold among the benchmarks that ran; empty when all hold.

    A bar whose case was not measured, or measured as nan, does not hold; one that names a `file` of the folder of
    further data stands only where that is there, or LODLAB_REQUIRE_DATA is 1.

    Raises:
        InvalidInput: A bar without bench, case, field or a limit.
    """
    file = bars or bars_file()
    ran = {r["bench"] for r in records}
    failures = []
    for bar in tomllib.loads(file.read_text(encoding="utf-8"))["bar"]:
        if not {"bench", "case", "field"} <= bar.keys() or not {"min", "max"} & bar.keys():
            raise InvalidInput(f"{file}: a bar needs bench, case, field and min or max, not {sorted(bar)}")
        if bar["bench"] not in ran or not _stands(bar):
            continue
        found = [r for r in records if r["bench"] == bar["bench"] and fnmatch.fnmatchcase(r["case"], bar["case"])]
        if not found:
            failures.append(f"{bar['bench']} {bar['case']}: not measured")
        for one in found:
            value = _field(one, bar["field"])
            where = f"{one['bench']} {one['case']}: {bar['field']} {value:.4g} ({one['unit']})"
            if "min" in bar and not value >= bar["min"]:
                failures.append(f"{where} is below {bar['min']:g}")
            if "max" in bar and not value <= bar["max"]:
                failures.append(f"{where} is above {bar['max']:g}")
    return failures


def _stands(bar: dict[str, Any]) -> bool:
    """Whether the file is there whose cases a bar judges."""
    file = bar.get("file")
    return file is None or os.environ.get("LODLAB_REQUIRE_DATA") == "1" or find_file(file) is not None


def table(records: Sequence[Record]) -> str:
    """Records as a text table for people."""
    head = ("bench", "case", "value", "unit", "reference", "reference value", "ratio", "95 % interval")
    rows = [head]
    for r in records:
        interval = "" if math.isnan(r["ratio_low"]) else f"{r['ratio_low']:.3f} to {r['ratio_high']:.3f}"
        numbers = ["" if math.isnan(v) else f"{v:.4g}" for v in (r["value"], r["reference_value"], r["ratio"])]
        rows.append((r["bench"], r["case"], numbers[0], r["unit"], r["reference"], numbers[1], numbers[2], interval))
    widths = [max(len(row[i]) for row in rows) for i in range(len(head))]
    return "\n".join("  ".join(c.ljust(w) for c, w in zip(row, widths, strict=True)).rstrip() for row in rows)
