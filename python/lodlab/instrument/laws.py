# SPDX-License-Identifier: MIT
"""The laws that a run's rows can show, one row each in LAWS, and what `judge` says of them.

A law is `holds`; `missed`: not reached in some frames, each of which says so; `broken` (the first frame that breaks
it is named); or `open`: not put to the test, not decided (nan), or a figure that some options show on purpose
(cracks). A law over columns that the source's kind has none of (`source_kind`) does not apply to those rows, and is
left out where all are such. The only slack is the instrument's, from the core: float steps at the distance to the
eye, and a hundredth of a pixel.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from .. import _core
from ..errors import BrokenPromise
from ..figures import number
from .metrics import BASELINE

HOLDS, MISSED, BROKEN, OPEN = "holds", "missed", "broken", "open"

Found = tuple[str, str] | tuple[str, str, tuple[str, ...]]  # verdict, sentence, and the runs that break it


@dataclass(frozen=True)
class Verdict:
    """What the rows say of one law: `holds`, `missed`, `broken` or `open`, a sentence with the figures, and the
    names of the runs that break it."""

    law: str
    verdict: str
    sentence: str
    runs: tuple[str, ...] = ()


@dataclass(frozen=True)
class Law:
    """One law. `of(frames)` returns (verdict, sentence, runs that break it), or None where no row concerns it.
    `columns`: what it cannot do without. `measured`: it sees the rows that the instrument measured. `not_on`: kinds
    of sources whose rows it does not see, as its columns mean nothing there."""

    name: str
    text: str
    columns: tuple[str, ...]
    of: Callable[[Any], Found | None]
    measured: bool = True
    not_on: tuple[str, ...] = ()


def judge(frames: Any, width: int = 1280, fov: float = 60.0) -> list[Verdict]:
    """The verdict of every law on the rows of `frames.csv` (a DataFrame of one run or several).

    A law that no row concerns is left out; one whose columns an older version did not write is open. `width` (pixels)
    and `fov` (degrees) of the viewport turn float steps into pixels where such a version wrote no `slack_px`.
    """
    pixels_per_unit = width / (2.0 * math.tan(math.radians(fov) / 2.0))
    usual = _core.SLACK_PIXELS + pixels_per_unit * _core.world_slack(1.0)
    frames = frames.assign(slack_px=frames["slack_px"].fillna(usual) if "slack_px" in frames else usual)
    out = []
    for law in LAWS:
        missing = [c for c in law.columns if c not in frames]
        if missing:
            out.append(Verdict(law.name, OPEN, f"{law.text}: these rows have no column {', '.join(missing)}."))
            continue
        rows = frames[frames["accuracy"]] if law.measured else frames
        if law.not_on and "source_kind" in rows:
            rows = rows[~rows["source_kind"].isin(law.not_on)]
        found = law.of(rows)
        if found is not None:
            out.append(Verdict(law.name, *found))
    return out


def tell_broken(frames: Any) -> None:
    """Warns of every law that rows of `frames.csv` break: a BrokenPromise each, with run, frame and figures."""
    for verdict in judge(frames):
        if verdict.verdict == BROKEN:
            warnings.warn(f"law {verdict.law}: {verdict.sentence}", BrokenPromise, stacklevel=3)


def broken_by_run(verdicts: Iterable[Verdict]) -> dict[str, list[str]]:
    """The names of the laws that each run breaks."""
    out: dict[str, list[str]] = {}
    for verdict in verdicts:
        for run in verdict.runs:
            out.setdefault(run, []).append(verdict.law)
    return out


def _verdict(text: str, bad: Any, what: Callable[[Any], str]) -> Found:
    if not len(bad):
        return HOLDS, text + "."
    row = bad.iloc[0]
    sentence = f"{text}: not in {len(bad)}, first in {row['run']}, frame {row['frame']} ({what(row)})."
    return BROKEN, sentence, tuple(bad["run"].unique())


def _reached(text: str, rows: Any, within: Any, what: Callable[[Any], str]) -> Found:
    """A budget's verdict: broken where a frame that is not `within` says that it is; else missed openly, or held."""
    bad, open_ = rows[~within & rows["budget_met"]], rows[~within & ~rows["budget_met"]]
    if len(bad) or not len(open_):
        return _verdict(f"{text} ({len(rows)} frames)", bad, what)
    worst = open_.iloc[0]
    where = f"first in {worst['run']}, frame {worst['frame']} ({what(worst)})"
    return MISSED, f"{text}: missed openly in {len(open_)} of {len(rows)} frames, each of which says so, {where}."


def _undecided(rows: Any, *columns: str) -> str:
    """What a sentence adds for columns that are nan in some rows."""
    counts = {column: int(rows[column].isna().sum()) for column in columns}
    return "".join(f"; {column} was not decided in {count}" for column, count in counts.items() if count)


def _count(row: Any, column: str) -> str:
    return number(int(row[column])) if math.isfinite(row[column]) else number(row[column])


def _error(measured: Any) -> Found:
    rows = measured[measured["promises_bound"] & measured["measured_px_max"].notna()]
    if not len(rows):
        return OPEN, "No measured frame that sees the source promises a bound."
    bad = rows[~(rows["measured_px_max"] <= rows["predicted_px"] + rows["slack_px"])]  # a nan promises nothing
    told = rows[rows["predicted_px"] > rows["slack_px"]]  # below it both are rounding
    ratio = (told["measured_px_max"] / told["predicted_px"]).replace([np.inf, -np.inf], np.nan).dropna()
    tight = f"; in the median it is {100 * ratio.median():.0f} % of it" if len(ratio) else ""
    text = f"The measured error stays within the predicted one in all {len(rows)} frames that promise it{tight}"
    return _verdict(text, bad, lambda r: f"{number(r['measured_px_max'])} over {number(r['predicted_px'])} px")


def _finite(measured: Any) -> Found | None:
    rows = measured[measured["measured_px_max"].notna()]
    if not len(rows):
        return None
    text = f"Every measured error is finite ({len(rows)} frames)"

    def what(row: Any) -> str:
        holes = row["hole_samples"]
        return "an infinite error" if math.isnan(holes) else f"{_count(row, 'hole_samples')} holes"

    return _verdict(text, rows[np.isinf(rows["measured_px_max"])], what)


def _budgets(frames: Any) -> Found:
    names = ("triangles", "nodes")
    rows = frames[frames["budget_triangles"].notna() | frames["budget_nodes"].notna()]
    if not len(rows):
        return OPEN, "No hard budget (triangles, nodes) was set."
    triangles, nodes = (rows[f"budget_{n}"].isna() | (rows[n] <= rows[f"budget_{n}"]) for n in names)

    def what(row: Any) -> str:
        return f"{_count(row, 'triangles')} triangles, {_count(row, 'nodes')} nodes"

    return _reached("Triangles and nodes stay within their budgets", rows, triangles & nodes, what)


def _pixel_error(frames: Any) -> Found | None:
    """No slack: a method compares the very numbers that stand in the row."""
    rows = frames[frames["budget_pixel_error"].notna()]
    if not len(rows):
        return None

    def what(row: Any) -> str:
        return f"{number(row['predicted_px'])} px predicted under {number(row['budget_pixel_error'])} px"

    return _reached("The error budget is reached", rows, rows["predicted_px"] <= rows["budget_pixel_error"], what)


def _counts(measured: Any) -> Found | None:
    """The method counts what it submits, in every frame; the GPU counts in those that are measured."""
    rows = measured[measured["drawn_triangles"].notna()]
    if not len(rows):
        return None
    text = f"The triangles that a frame reports are those that the GPU counted ({len(rows)} frames)"
    bad = rows[rows["triangles"] != rows["drawn_triangles"]]
    return _verdict(text, bad, lambda r: f"{_count(r, 'triangles')} reported, {_count(r, 'drawn_triangles')} counted")


def _met(frames: Any) -> Found:
    missed = frames[~frames["budget_met"]]
    if not len(missed):
        return HOLDS, f"Every frame met its budget ({len(frames)} frames)."
    names = ", ".join(missed["run"].unique())
    return MISSED, f"{len(missed)} of {len(frames)} frames say that they did not meet their budget: {names}."


#: What drawing everything measures 0 of, but for the slack, and how a sentence says it.
_NOTHING = {
    "measured_px_max": "zero error",
    "crack_edges": "no crack edges",
    "crack_pixels": "no crack pixels",
    "pop_px_max": "no pops",
}


def _baseline(measured: Any) -> Found | None:
    full = measured[measured["method"] == BASELINE]
    if not len(full):
        return None
    known = {c: text for c, text in _NOTHING.items() if c in full and full[c].notna().any()}
    if "measured_px_max" not in known:
        return OPEN, f"Drawing everything measures zero: no measured frame saw the source ({len(full)} frames)."
    off = np.logical_or.reduce([full[c] > (full["slack_px"] if c.endswith("_px_max") else 0) for c in known])
    unknown = ", ".join(c for c in _NOTHING if c not in known)
    text = f"Drawing everything measures {', '.join(known.values())} ({len(full)} frames"
    text += f"; {unknown} not decided)" if unknown else f"{_undecided(full, 'measured_px_max', 'crack_pixels')})"

    def what(row: Any) -> str:
        return ", ".join(f"{c} {number(row[c])}" for c in known if row[c] > 0)

    return _verdict(text, full[off], what)


def _none_of(column: str, text: str, what: str) -> Callable[[Any], Found | None]:
    """The law that a column is 0 in every measured frame where it is known."""

    def of(measured: Any) -> Found | None:
        if not len(measured):
            return None
        rows = measured[measured[column].notna()]
        if not len(rows):
            return OPEN, f"{text}: not decided, {column} is nan in all {len(measured)} frames."
        sentence = f"{text} ({len(rows)} frames{_undecided(measured, column)})"
        return _verdict(sentence, rows[~(rows[column] == 0)], lambda r: f"{_count(r, column)} {what}")

    return of


def _still(measured: Any) -> Found | None:
    """Adaptation and paging may take k frames; a surface that still moves in the last frame never comes to rest, but
    for one whose data may yet be on its way."""
    rows = measured[(measured["path"] == "still") & measured["pop_px_max"].notna()]
    if not len(rows):
        return None
    last = rows.loc[rows.groupby("run")["frame"].idxmax()]
    moving = rows[rows["pop_px_max"] > rows["slack_px"]]
    settled = int(moving["frame"].max()) + 1 if len(moving) else 0
    text = f"Under a still camera the surface comes to rest ({rows['run'].nunique()} runs"
    late = last[last["pop_px_max"] > last["slack_px"]]
    bad = late[~late["stream"]]
    if len(late) and not len(bad):
        return OPEN, f"{text}): not decided, data was read until the last frame of {', '.join(late['run'])}."
    text += ")" if len(bad) else f", after {settled} frames at most)"
    return _verdict(text, bad, lambda r: f"it still jumps by {number(r['pop_px_max'])} px")


def _cracks(measured: Any) -> Found | None:
    """Cracks are measured, not forbidden: some options show them on purpose."""
    if not len(measured):
        return None
    rows = measured[measured["crack_pixels"].notna()]
    bad = rows[rows["crack_pixels"] > 0]
    if not len(rows):
        return OPEN, "No frame could be looked at for cracks."
    rest = _undecided(measured, "crack_pixels")
    if not len(bad):
        return HOLDS, f"No picture shows a crack ({len(rows)} frames{rest})."
    worst = bad.loc[bad["crack_pixels"].idxmax()]
    where = f"most in {worst['run']}, frame {worst['frame']}: {_count(worst, 'crack_pixels')} pixels"
    return OPEN, f"{len(bad)} of {len(rows)} pictures show cracks, {where}{rest}."


_CAPTURE = "The captured triangles are the ones that were drawn, depth compared"
_COVERED = "Every sample of the source is covered"
_WOUND = "Every surface triangle shows its outside"
_UPRIGHT = "Fillers stand upright, so that no surface hides among them"
_BELOW = "Fillers stay below the surface, so that they hide none of it"

LAWS: tuple[Law, ...] = (
    Law("error", "The measured error stays within the predicted one", ("measured_px_max", "predicted_px"), _error),
    Law("finite", "Every measured error is finite", ("measured_px_max", "hole_samples"), _finite),
    Law(
        "budgets",
        "Triangles and nodes stay within their budgets",
        ("budget_triangles", "budget_nodes", "triangles", "nodes"),
        _budgets,
        measured=False,
    ),
    Law(
        "pixel_error",
        "The error budget is reached",
        ("budget_pixel_error", "predicted_px"),
        _pixel_error,
        measured=False,
    ),
    Law("met", "Every frame met its budget", ("budget_met",), _met, measured=False),
    Law(
        "baseline",
        "Drawing everything measures zero",
        ("measured_px_max", "crack_edges", "crack_pixels"),
        _baseline,
    ),
    Law(
        "capture",
        _CAPTURE,
        ("capture_mismatch_pixels",),
        _none_of("capture_mismatch_pixels", _CAPTURE, "pixels differ"),
    ),
    Law(
        "holes",
        _COVERED,
        ("hole_samples",),
        _none_of("hole_samples", _COVERED, "samples uncovered"),
        not_on=("mesh",),
    ),
    Law(
        "winding",
        _WOUND,
        ("inverted_triangles",),
        _none_of("inverted_triangles", _WOUND, "triangles inverted"),
    ),
    Law(
        "fillers",
        _UPRIGHT,
        ("slanted_filler_triangles",),
        _none_of("slanted_filler_triangles", _UPRIGHT, "fillers slant"),
        not_on=("mesh",),
    ),
    Law(
        "raised",
        _BELOW,
        ("raised_filler_triangles",),
        _none_of("raised_filler_triangles", _BELOW, "fillers rise above it"),
        not_on=("mesh",),
    ),
    Law("counts", "Reported triangles are those that the GPU counted", ("drawn_triangles",), _counts),
    Law("still", "Under a still camera the surface comes to rest", ("pop_px_max", "stream"), _still),
    Law("cracks", "No picture shows a crack", ("crack_pixels",), _cracks),
)
