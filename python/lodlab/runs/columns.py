# SPDX-License-Identifier: MIT
"""What every column of `frames.csv`, `summary.csv` and `noise.csv` says: name, unit and one sentence.

The tables here and `instrument.metrics.METRICS` are all there is: results take their columns from them, and
`docs/columns.md`, the tooltips of the report and `lodlab check --help` their sentences. Columns only grow, at the end
of their table.
`python -c "from lodlab.runs import columns; print(columns.markdown(), end='')" > docs/columns.md` writes that page.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from ..instrument.metrics import METRICS

FLAG, TEXT = "true or false", "text"


@dataclass(frozen=True)
class Column:
    """A column of a result table: `unit` and `text` tell what it is. `FLAG` and `TEXT` are units, too."""

    name: str
    unit: str
    text: str


_UNSET = "empty where it was not set"
KEYS: tuple[Column, ...] = (
    Column("run", TEXT, "Name of the run: method, what varies, budget."),
    Column("source", TEXT, "The source, as a SOURCE of the command line; one that lay in memory by its name."),
    Column("method", TEXT, "The method."),
    Column("options", TEXT, "All options of build and draw, defaults too: compact JSON, keys sorted."),
    Column("budget_pixel_error", "px", f"Target for the projected error; {_UNSET}."),
    Column("budget_triangles", "count", f"Hard limit on triangles, fillers included; {_UNSET}."),
    Column("budget_nodes", "count", f"Hard limit on nodes; {_UNSET}."),
    Column("path", TEXT, "The camera path: a built-in name, or the key frames that the run directory keeps; behind a + "
           "what deforms the mesh."),
    Column("frame", "count", "Number of the frame along the path, from 0."),
    Column("budget_met", FLAG, "predicted_px is within the pixel error, and hard budgets held."),
    Column("promises_bound", FLAG, "predicted_px is an upper bound of the measured error."),
    Column("stream", FLAG, "Data was read while flying; false: all was loaded before."),
    Column("device", TEXT, "The device that drew, GL_RENDERER."),
)  # fmt: skip
COSTS: tuple[Column, ...] = (
    Column("select_ms", "ms", "Time to select the cut, requests for data included."),
    Column("gpu_ms", "ms", "Time of all work on the GPU, by the clock that gpu_clock names."),
    Column("frame_ms", "ms", "Wall time from the start of selecting until all is drawn."),
    Column("triangles", "count", "Triangles submitted, fillers included."),
    Column("vertices", "count", "Vertices submitted."),
    Column("nodes", "count", "Nodes submitted."),
    Column("draw_calls", "count", "Draw calls."),
    Column("upload_bytes", "bytes", "Bytes moved to the GPU in this frame."),
    Column("resident_bytes", "bytes", "Bytes held on the GPU after this frame."),
    Column("page_misses", "count", "Nodes drawn coarser than selected, as their data was not there yet."),
    Column("adapt_steps", "count", "Steps of selecting: moves made or tried, nodes looked at; 0: not counted."),
    Column("processed_triangles", "count", "Triangles tested by any pass or thread; 0 where whole nodes are."),
)  # fmt: skip
EXTRAS: tuple[Column, ...] = (
    Column("accuracy", FLAG, "The frame was measured; accuracy columns of others are nan, but for predicted_px."),
    Column("gpu_clock", TEXT, "Clock of gpu_ms: query (GL_TIME_ELAPSED) or wall (first GL call to glFinish)."),
    Column("filler_triangles", "count", "Triangles that only hide cracks, of the visible nodes."),
    Column("slack_px", "px", "What laws allow beside a bound in this view: 0.01 px and the rounding of positions."),
    Column("source_kind", TEXT, "Kind of the source: heightfield, planet, mesh; it says which columns mean something."),
)  # fmt: skip
HASHES: tuple[Column, ...] = (
    Column("source_hash", TEXT, "Hash of the source's heights, voids and placement."),
    Column(
        "poses_hash",
        TEXT,
        "Hash of every frame's eye, target, up, field of view, near plane, size, and of what deforms the mesh.",
    ),
    Column("attribute_hash", TEXT, "Hash of the colour raster's bytes; empty without one."),
)
OF_RUNS: tuple[Column, ...] = (
    Column("store_bytes", "bytes", "Bytes of the store's pages and arrays, the same for equal builds."),
    Column("build_seconds", "s", "Time to build the store; a resumed build counts all its parts."),
    Column("frames", "count", "Frames of the run."),
    Column("accuracy_frames", "count", "Frames that were measured."),
)
NOISE: tuple[Column, ...] = (
    Column("run", TEXT, "The run that was timed twice."),
    Column("column", TEXT, "The column of times that is compared."),
    Column("ratio", "1", "Second time over first: the median over the frames."),
    Column("low", "1", "Lower end of its bootstrap 95 % interval."),
    Column("high", "1", "Upper end of its bootstrap 95 % interval."),
    Column("passes", "count", "Timing passes of the second time."),
    Column("jobs", "count", "Runs that shared the machine the first time."),
)
ACCURACY: tuple[Column, ...] = tuple(Column(metric.name, metric.unit, metric.text) for metric in METRICS)
_SMALLER_IS_WORSE = {metric.name for metric in METRICS if metric.smaller_is_worse}
_FRAMES = {column.name: column for column in (*KEYS, *COSTS, *ACCURACY, *EXTRAS, *HASHES)}
_EVERY_FRAME = ("predicted_px",)  # known without measuring

_INTERVAL = "end of the bootstrap 95 % interval of the median, over frames and timing passes."
#: Endings of figures over the frames of a run: the columns that have them, and what they say.
STATISTICS: dict[str, tuple[str, str]] = {
    "_worst": ("accuracy", "{worst} over the {frames}."),
    "_median": ("cost and accuracy", "Median over the {frames}."),
    "_p95": ("cost", "95th percentile over the {frames}."),
    "_p99": ("cost", "99th percentile over the {frames}."),
    "_median_low": ("times", f"Lower {_INTERVAL}"),
    "_median_high": ("times", f"Upper {_INTERVAL}"),
}


def describe(name: str) -> Column:
    """The column of that name of `frames.csv` or `summary.csv`. KeyError: there is none."""
    found = _FRAMES.get(name) or next((column for column in OF_RUNS if column.name == name), None)
    if found:
        return found
    if name.startswith("option."):
        return Column(name, TEXT, f"The option {name.removeprefix('option.')}; empty in runs that have none.")
    for end, (_, text) in STATISTICS.items():
        column = _FRAMES.get(name.removesuffix(end)) if name.endswith(end) else None
        if column is not None:
            measured = column in ACCURACY and column.name not in _EVERY_FRAME
            worst = "Smallest" if column.name in _SMALLER_IS_WORSE else "Largest"
            said = text.format(frames="measured frames" if measured else "frames", worst=worst)
            return Column(name, column.unit, f"{column.text} {said}")
    raise KeyError(name)


def tooltip(name: str) -> str:
    """Name, unit and sentence of a column, for a table's head."""
    column = describe(name)
    unit = "" if column.unit in (FLAG, TEXT, "1") else f" ({column.unit})"
    return f"{name}{unit}: {column.text}"


# ---- pages ------------------------------------------------------------------------------------------

_PARTS: tuple[tuple[str, Sequence[Column]], ...] = (
    ("What a row is about", KEYS),
    ("Cost, timed in a pass that reads nothing back", COSTS),
    ("Accuracy, measured in a second pass over the same views", ACCURACY),
    ("Besides", EXTRAS),
    ("What the row rests on", HASHES),
)
_SUMMARY_NOTE = (
    "The columns that say what a row is about, without `frame`; `budget_met` and `promises_bound` are true when they "
    "are in every frame, `gpu_clock`, `source_kind` and the hashes stand here too; every option that some run has is a "
    "column `option.NAME`. Then figures over the frames of the run, named by their endings:"
)


def markdown() -> str:
    """`docs/columns.md`: every column of the result tables, with unit and sentence."""
    lines = [
        "# Columns",
        "",
        "<!-- Written by lodlab.runs.columns.markdown() from the tables in python/lodlab; edit those. -->",
        "",
        "What the tables of a run directory hold. `nan`: undefined; `inf`: a hole, or, for `psnr_db`, equal pictures.",
        "Columns only grow, at the end. `lodlab check RUN --max COLUMN=VALUE` sets a limit to any that is a number.",
        "",
        "## frames.csv: a row a frame",
    ]
    for title, columns in _PARTS:
        lines += ["", f"### {title}", "", *_rows(columns)]
    lines += ["", "## summary.csv: a row a run", "", _SUMMARY_NOTE, "", "| ending | of | what |", "|---|---|---|"]
    lines += [f"| `{end}` | {of} | {text} |" for end, of, text in _endings()]
    lines += ["", *_rows(OF_RUNS), "", "## noise.csv: one run timed twice", "", *_rows(NOISE)]
    return "\n".join(lines) + "\n"


def _endings() -> list[tuple[str, str, str]]:
    """(ending, columns that have it, sentence)."""
    frames = {"accuracy": "measured frames", "cost and accuracy": "frames (accuracy: those that were measured)"}
    worst = f"Largest (smallest of {', '.join(sorted(_SMALLER_IS_WORSE))})"
    return [
        (end, of, text.format(frames=frames.get(of, "frames"), worst=worst)) for end, (of, text) in STATISTICS.items()
    ]


def _rows(columns: Iterable[Column]) -> list[str]:
    return ["| column | unit | what |", "|---|---|---|", *(f"| `{c.name}` | {c.unit} | {c.text} |" for c in columns)]


def listing(width: int = 77) -> str:
    """The columns that can have a limit, for a terminal."""
    numbers = [c for part in (COSTS, ACCURACY, EXTRAS) for c in part if c.unit != TEXT and c.name != "accuracy"]
    flags = [c for c in KEYS if c.unit == FLAG]
    runs = [Column(f"*{end}", of, text) for end, of, text in _endings()]
    lines = ["Columns of frames.csv:"]
    for column in (*numbers, *flags):
        lines += _entry(column, width)
    lines.append("Columns of summary.csv:")
    for column in (*runs, *OF_RUNS):
        lines += _entry(column, width)
    return "\n".join(lines)


def _entry(column: Column, width: int) -> list[str]:
    unit = f"[{column.unit}] " if column.unit not in (FLAG, "1") else ""
    return textwrap.wrap(
        unit + column.text,
        width,
        initial_indent=f"  {column.name:25} ",
        subsequent_indent=" " * 28,
        break_on_hyphens=False,
    )
