# SPDX-License-Identifier: MIT
"""Charts of results. `pareto`: measured error against frame time and against triangles, the face of the
project; `timeline`: the frames of runs along their path.

Legible at 700 pixels' width: direct labels instead of legends. A method that was flown under several sets of options
has a row of panels of its own, where colour follows what varies.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from ..chart import INK, Chart, short
from ..errors import InvalidInput
from ..figures import percent
from ..instrument import statistics
from ..sources.spec import short_source
from .labels import ABOVE, Label, place
from .series import Series, budget_label, dress, series_of, studies, tables_of

RESOLVED = 0.01  # pixels: the slack of the laws; errors below it stand on the line of zero
PANEL = (232.0, 228.0)  # points: the size of one panel of `pareto`, near enough to place labels
STUDY_PANEL = (190.0, 228.0)  # the same in a figure with a legend


# ---- pareto ---------------------------------------------------------------------------------------


def pareto(result: Any) -> Chart:
    """Measured error (the worst over a run's measured frames) against median frame time and triangles.

    `result`: Run, Sweep, a list of them, or a run directory. A row of two panels for each source and path; a
    curve per method, a point per budget; a further row for each method that was flown under several sets of
    options, a curve for each. Thin bars reach from the 5th to the 95th percentile of the frames, thick
    ones over the 95 % interval of the median time. Times that chance and the noise floor do not tell apart are
    marked: dashed between neighbours of a curve, dotted between curves at one budget, hollow where it is `full`'s.
    """
    frames, summary, noise = tables_of(result)
    if summary.empty:
        raise InvalidInput("pareto: no finished run")
    if summary["measured_px_max_worst"].isna().all():
        raise InvalidInput("pareto: no run was measured (accuracy frames 0)")
    spread = frames.groupby("run")[["frame_ms", "triangles"]].quantile([0.05, 0.95]).unstack()
    clock = _Clock(frames, summary, statistics.noise_floor(noise))
    measured = summary[summary["measured_px_max_worst"].notna()]
    groups = [
        (f"{short_source(source)} · {Path(path).stem}{suffix}", part, bool(suffix))
        for (source, path), rows in measured.groupby(["source", "path"], sort=False)
        for suffix, part in studies(rows)
    ]

    panel = STUDY_PANEL if any(study for _, _, study in groups) else PANEL

    def draw(figure: Any, theme: str) -> None:
        figure.set_size_inches(7.4, 3.9 * len(groups) + 0.1)
        grid = figure.subplots(len(groups), 2, sharey="row", squeeze=False)
        for axes, (name, rows, study) in zip(grid, groups, strict=True):
            _pareto_row(axes, name, rows, spread, clock, theme, panel, study)
        figure.get_layout_engine().set(w_pad=0.08, h_pad=0.08, wspace=0.04)

    return Chart(draw, "measured error against frame time and triangles")


class _Clock:
    """Judges which runs' times differ by more than chance and this machine's noise."""

    def __init__(self, frames: Any, summary: Any, floor: float | None):
        self.floor = floor
        self._times = {run: rows["frame_ms"].to_numpy(float) for run, rows in frames.groupby("run")}
        self._rows = summary.drop_duplicates("run").set_index("run")

    @property
    def label(self) -> str:
        """The axis of times, with the noise floor where it is known."""
        known = "" if self.floor is None else f" · noise {percent(self.floor)}"
        return f"median frame time (ms){known}"

    def apart(self, a: str, b: str) -> bool:
        """Frame by frame; where the runs have not the same frames, by the intervals of their medians."""
        floor = self.floor or 1.0
        first, second = self._times[a], self._times[b]
        if len(first) == len(second):
            return statistics.told_apart(first, second, floor)
        (low, high), (other_low, other_high) = (self.interval(run) for run in (a, b))
        return bool(high * floor < other_low or other_high * floor < low)

    def interval(self, run: str) -> tuple[float, float]:
        """Of the median time of a run; nan in results that hold none."""
        ends = (self._rows.at[run, c] if c in self._rows else math.nan for c in _INTERVAL)
        low, high = ends
        return float(low), float(high)


_INTERVAL = ("frame_ms_median_low", "frame_ms_median_high")


def _pareto_row(
    axes: Any, name: str, rows: Any, spread: Any, clock: _Clock, theme: str, panel: tuple[float, float],
    study: bool,
) -> None:  # fmt: skip
    ink = INK[theme]
    series = series_of(rows)
    look = dress(series, theme)
    scale = _ErrorScale(rows["measured_px_max_worst"].to_numpy(float))
    columns = (("frame_ms", clock.label), ("triangles", "median triangles per frame"))
    for ax, (column, label) in zip(axes, columns, strict=True):
        ax.set_xscale("log")
        ax.set_yscale("log")
        ax.set_ylim(scale.low, scale.high)
        ax.grid(True, which="major", linewidth=0.6)
        ax.set_axisbelow(True)
        ax.spines[["top", "right"]].set_visible(False)
        ax.axhline(scale.floor, color=ink["faint"], linewidth=0.9, dashes=(4, 3))
        if scale.has_top:
            ax.axhline(scale.top, color=ink["faint"], linewidth=0.9, dashes=(4, 3))
        ax.set_xlabel(label)
        left, right = _limits(rows, spread, column)
        ax.set_xlim(left, right)
        judge = clock if column == "frame_ms" else None  # counts are exact
        for item in series:
            _curve(ax, item, column, scale, spread, *look[item.label], ink, judge, series)
        if judge is not None:
            _ties(ax, series, scale, judge, ink, neighbours=study)
        _label(ax, series, column, scale, look, ink, panel, study)
        _ticks(ax, scale)
    axes[0].set_ylabel("worst measured error (px)")
    axes[0].set_title(name, loc="left", fontsize=10.5, fontweight="bold")
    axes[1].set_title("down and left is better", loc="right", fontsize=8.5, color=ink["faint"])
    if study:
        _legend(axes[1], series, look, ink)


def _legend(ax: Any, series: list[Series], look: Any, ink: Any) -> None:
    """The curves of one method beside the panels: where they lie on one another, no label at a curve is legible."""
    from matplotlib.lines import Line2D

    handles = [
        Line2D([], [], color=look[s.label][0], marker=look[s.label][1], markersize=10 if s.baseline else 6.5,
               markeredgecolor=ink["page"], linewidth=0 if s.baseline else 1.8, label=s.label)
        for s in series
    ]  # fmt: skip
    ax.legend(handles=handles, loc="upper left", bbox_to_anchor=(1.02, 1.0), frameon=False, fontsize=8.5,
              borderaxespad=0.0)  # fmt: skip


class _ErrorScale:
    """A logarithmic axis with a marked floor for zero and a marked ceiling for infinity (holes)."""

    def __init__(self, errors: np.ndarray):
        shown = errors[np.isfinite(errors) & (errors >= RESOLVED)]
        small, large = (shown.min(), shown.max()) if shown.size else (0.1, 1.0)
        self.floor = 10 ** (math.log10(small) - max(0.35, 0.22 * math.log10(large / small)))
        self.has_top = bool(np.isinf(errors).any())
        self.top = large * 3.0
        self.low = self.floor / 1.6
        self.high = self.top * 1.4 if self.has_top else large * 2.4

    def place(self, errors: np.ndarray) -> np.ndarray:
        out = np.where(errors < RESOLVED, self.floor, errors)
        return np.where(np.isinf(out), self.top, out)


def _limits(rows: Any, spread: Any, column: str) -> tuple[float, float]:
    values = np.concatenate([rows[f"{column}_median"], spread.loc[rows["run"], column].to_numpy().ravel()])
    values = values[np.isfinite(values) & (values > 0)]
    low, high = values.min(), values.max()
    room = max(math.log10(high / low), 0.3)
    return low / 10 ** (0.10 * room), high * 10 ** (0.16 * room)


def _curve(
    ax: Any, item: Series, column: str, scale: _ErrorScale, spread: Any, colour: str, marker: str, ink: Any,
    clock: _Clock | None, series: list[Series],
) -> None:  # fmt: skip
    """Bars, line and points of a curve; with a clock, the marks of times that are not told apart."""
    runs = item.points["run"].tolist()
    x = item.points[f"{column}_median"].to_numpy(float)
    y = scale.place(item.points["measured_px_max_worst"].to_numpy(float))
    bars = spread.loc[runs, column].to_numpy(float)
    ax.hlines(y, np.maximum(bars[:, 0], 1e-9), bars[:, 1], color=colour, linewidth=1.0, alpha=0.45)
    if clock is not None:
        ends = np.array([clock.interval(run) for run in runs])
        ax.hlines(y, ends[:, 0], ends[:, 1], color=colour, linewidth=4.0, alpha=0.45, zorder=2.5)
    for i in range(len(runs) - 1):
        apart = clock is None or clock.apart(runs[i], runs[i + 1])
        style = {"linewidth": 1.8} if apart else {"linewidth": 1.4, "dashes": (2.2, 1.6), "alpha": 0.6}
        ax.plot(x[i : i + 2], y[i : i + 2], color=colour, clip_on=False, zorder=3, **style)
    full = [run for other in series if other.baseline and other is not item for run in other.points["run"]]
    for i, run in enumerate(runs):
        solid = clock is None or item.baseline or all(clock.apart(run, other) for other in full)
        ax.plot(
            x[i], y[i], color=colour if solid else ink["page"], marker=marker, clip_on=False, zorder=3.5,
            markersize=11 if item.baseline else 6.5 if solid else 5.6,
            markeredgecolor=ink["page"] if solid else colour, markeredgewidth=0.8 if solid else 1.6,
        )  # fmt: skip


def _ties(ax: Any, series: list[Series], scale: _ErrorScale, clock: _Clock, ink: Any, neighbours: bool) -> None:
    """Dotted lines between points of two curves at one budget whose times are not told apart; of `neighbours`
    alone where the curves are in an order."""
    keys = ["budget_pixel_error", "budget_triangles", "budget_nodes"]
    curves = [item.points for item in series if not item.baseline]
    for i, first in enumerate(curves):
        for second in curves[i + 1 : i + 2 if neighbours else None]:
            for _, tie in first.merge(second, on=keys, suffixes=("", "_other")).iterrows():
                if not clock.apart(tie["run"], tie["run_other"]):
                    errors = np.array([tie["measured_px_max_worst"], tie["measured_px_max_worst_other"]], float)
                    times = [tie["frame_ms_median"], tie["frame_ms_median_other"]]
                    ax.plot(times, scale.place(errors), color=ink["text"], linewidth=1.6, dashes=(1, 1.2), zorder=3.2)


def _label(
    ax: Any, series: list[Series], column: str, scale: _ErrorScale, look: Any, ink: Any, panel: tuple[float, float],
    study: bool,
) -> None:  # fmt: skip
    """Budgets at their points, methods at the end of their curves. In a study the legend names the curves, and
    budgets stand at the first one alone: the others have the same, in the same order."""
    (left, right), (low, high) = ax.get_xlim(), ax.get_ylim()
    first = next((item for item in series if not item.baseline), None)

    def spot(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        across = np.log(x / left) / math.log(right / left) * panel[0]
        return np.column_stack([across, np.log(y / low) / math.log(high / low) * panel[1]])

    curves, ends, budgets = [], [], []
    for item in series:
        y = scale.place(item.points["measured_px_max_worst"].to_numpy(float))
        curve = spot(item.points[f"{column}_median"].to_numpy(float), y)
        end = int(np.argmax(y))
        if not study:
            ends.append((Label(item.label, *curve[end], 10.0, ABOVE), look[item.label][0], "bold"))
        if item is first if study else not item.baseline:
            texts = [budget_label(row) for _, row in item.points.iterrows()]
            budgets += [(Label(t, *c, 8.0), ink["faint"], "normal") for t, c in zip(texts, curve, strict=True)]
        curves.append(curve)
    ends.sort(key=lambda end: -end[0].y)
    place([label for label, _, _ in budgets + ends], curves, panel)
    for label, colour, weight in budgets + ends:
        at = ((label.x + label.dx) / panel[0], (label.y + label.dy) / panel[1])
        ax.text(*at, label.text, transform=ax.transAxes, fontsize=label.size, color=colour, fontweight=weight,
                ha="center", va="center", zorder=4)  # fmt: skip


def _ticks(ax: Any, scale: _ErrorScale) -> None:
    from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullFormatter, NullLocator

    low, high = ax.get_xlim()
    ax.xaxis.set_major_locator(FixedLocator(round_numbers(low, high, 6)))
    ax.xaxis.set_major_formatter(FuncFormatter(short))
    ax.xaxis.set_minor_locator(LogLocator(subs=range(2, 10)))
    ax.xaxis.set_minor_formatter(NullFormatter())
    top = scale.top / 1.5 if scale.has_top else scale.high
    errors = round_numbers(scale.floor * 1.5, top, 8)
    names = {scale.floor: "0"} | ({scale.top: "∞"} if scale.has_top else {})
    ax.yaxis.set_major_locator(FixedLocator(sorted([*errors, *names])))
    ax.yaxis.set_major_formatter(FuncFormatter(lambda v, _: next((n for k, n in names.items() if math.isclose(k, v)),
                                                                 short(v))))  # fmt: skip
    ax.yaxis.set_minor_locator(NullLocator())


def round_numbers(low: float, high: float, most: int) -> list[float]:
    """Marks of a logarithmic axis: 1, 2, 5 a decade; fewer where that were too many, more where too few."""

    def marks(steps: tuple[float, ...]) -> list[float]:
        return [m * 10.0**e for e in range(-9, 13) for m in steps if low <= m * 10.0**e <= high]

    usual = marks((1, 2, 5))
    if len(usual) < 2:
        from matplotlib.ticker import MaxNLocator

        finer = marks((1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 8))
        even = MaxNLocator(most - 2).tick_values(low, high)
        return finer if len(finer) > 1 else [value for value in even if low <= value <= high]
    return next((found for found in (usual, marks((1, 3))) if len(found) <= most), marks((1,)))


# ---- timeline -------------------------------------------------------------------------------------


def timeline(result: Any) -> Chart:
    """Frame time and error of every frame along the path: predicted as a line, measured as points."""
    frames, summary, _ = tables_of(result)
    if summary.empty:
        raise InvalidInput("timeline: no finished run")

    wrong = bool((frames["predicted_px"] > 0).any())  # of `full` alone nothing is

    def draw(figure: Any, theme: str) -> None:
        figure.set_size_inches(7.4, 4.6 if wrong else 2.6)
        axes = figure.subplots(1 + wrong, 1, sharex=True, squeeze=False)[:, 0]
        names = summary["run"].tolist()
        colours = _shades(names, summary, theme)
        ends: list[list[tuple[float, str, str]]] = [[] for _ in axes]
        for ax, label in zip(axes, ("frame time (ms)", "error (px)"), strict=False):
            ax.set_yscale("log")
            ax.grid(True, axis="y", linewidth=0.6)
            ax.spines[["top", "right"]].set_visible(False)
            ax.set_ylabel(label)
        for name in names:
            rows = frames[frames["run"] == name]
            axes[0].plot(rows["frame"], rows["frame_ms"], color=colours[name], linewidth=1.2)
            ends[0].append((float(rows["frame_ms"].iloc[-8:].median()), name, colours[name]))
            predicted = rows["predicted_px"].to_numpy(float)
            if (predicted > 0).any():
                low = axes[1]
                low.plot(rows["frame"], np.where(predicted > 0, predicted, np.nan), color=colours[name], linewidth=1.2)
                seen = rows[rows["accuracy"] & (rows["measured_px_max"] >= RESOLVED)]
                low.plot(seen["frame"], seen["measured_px_max"], "o", color=colours[name], markersize=3.5)
                ends[1].append((float(predicted[-1]), name, colours[name]))
        axes[-1].set_xlabel("frame · lines: predicted bound, points: measured" if wrong else "frame")
        last = int(frames["frame"].max())
        for ax, names_at in zip(axes, ends, strict=True):
            ax.set_xlim(0, max(1, last))
            _plain_log(ax)
            _end_labels(ax, names_at, max(1, last))

    return Chart(draw, "frame time and error along the path")


def _shades(names: list[str], summary: Any, theme: str) -> dict[str, str]:
    """A colour per run: the method's hue, from dark to light over its budgets."""
    from matplotlib.colors import to_hex, to_rgb

    page = np.array(to_rgb(INK[theme]["page"]))
    series = series_of(summary)
    look = dress(series, theme)
    out = {}
    for item in series:
        base = np.array(to_rgb(look[item.label][0]))
        runs = item.points["run"].tolist()
        for i, run in enumerate(runs):
            out[run] = to_hex(base + (page - base) * 0.45 * i / max(1, len(runs) - 1))
    return out


def _plain_log(ax: Any) -> None:
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

    low, high = ax.get_ylim()
    ax.yaxis.set_major_locator(FixedLocator(round_numbers(low, high, 7)))
    ax.yaxis.set_major_formatter(FuncFormatter(short))
    ax.yaxis.set_minor_locator(NullLocator())


def _end_labels(ax: Any, ends: list[tuple[float, str, str]], x: float) -> None:
    """Names at the right end of their lines, pushed apart where they would overlap."""
    if not ends:
        return
    low, high = (math.log10(v) for v in ax.get_ylim())
    gap = 0.085
    placed: list[tuple[float, str, str]] = []
    for value, name, colour in sorted(ends):
        y = (math.log10(value) - low) / (high - low) if value > 0 else 0.0
        if placed:
            y = max(y, placed[-1][0] + gap)
        placed.append((y, name, colour))
    excess = max(0.0, placed[-1][0] - 1.0)
    for y, name, colour in placed:
        ax.annotate(name, (1.0, y - excess), xytext=(6, 0), xycoords="axes fraction", textcoords="offset points",
                    va="center", fontsize=8, color=colour, annotation_clip=False)  # fmt: skip
