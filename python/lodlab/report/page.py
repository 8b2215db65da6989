# SPDX-License-Identifier: MIT
"""The report of a run directory: one self-contained HTML page and the charts beside it.

Everything is read back from the directory, so that a report can be made again at any time. Pictures and
charts stand inside the page; it opens from disk without a network, in light and dark.
"""

from __future__ import annotations

import base64
import html
import math
import os
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from .. import pictures
from ..chart import Chart
from ..disk import write_atomic
from ..errors import InvalidInput
from ..figures import number, percent
from ..instrument.laws import broken_by_run, judge
from ..instrument.metrics import BASELINE
from ..instrument.statistics import noise_floor
from ..runs.columns import tooltip
from ..runs.directory import HEAD
from ..runs.passes import worst_folder
from ..runs.provenance import read_provenance
from ..runs.sweep import Sweep
from ..sources.spec import short_source
from . import charts
from .frame import fill
from .series import series_of

STRIP_WIDTH = 480  # pixels of a picture in the page; full size lies in images/


# ---- tables ---------------------------------------------------------------------------------------

COLUMNS = (
    ("run", "run", "text"),
    ("frame_ms_median", "ms<br>median", "interval"),
    ("frame_ms_p95", "ms<br>p95", "number"),
    ("triangles_median", "triangles<br>median", "count"),
    ("predicted_px_worst", "predicted<br>px", "number"),
    ("measured_px_max_worst", "measured<br>px", "number"),
    ("measured_px_p99_worst", "px<br>p99", "number"),
    ("pop_px_max_worst", "pop<br>px", "number"),
    ("measured_max_worst", "measured<br>$unit", "ways"),
    ("measured_rms_worst", "RMS<br>$unit", "ways"),
    ("psnr_db_worst", "PSNR<br>dB", "number"),
    ("ssim_worst", "SSIM", "number"),
    ("flip_worst", "FLIP", "number"),
    ("crack_pixels_worst", "crack<br>pixels", "count"),
    ("budget_met", "budget<br>met", "number"),
    ("store_bytes", "store<br>MB", "megabytes"),
)


def units_of(summary: Any) -> str:
    """What `source units` are in these runs: metres of heights, a mesh's own."""
    meshes = summary["source_kind"] == "mesh"
    return "units" if meshes.all() else "m, units" if meshes.any() else "m"


def summary_table(summary: Any, broken: Mapping[str, Sequence[str]] | None = None) -> str:
    """The runs as an HTML table; columns that these results do not have, or that are undefined in all of them, are left
    out. `broken`: the laws that runs break, which mark their rows."""
    unit = units_of(summary)
    columns = [(c, title.replace("$unit", unit), kind) for c, title, kind in COLUMNS
               if c in summary and summary[c].notna().any()]  # fmt: skip
    head = "".join(f'<th title="{html.escape(tooltip(column))}">{title}</th>' for column, title, _ in columns)
    body = []
    for _, row in summary.iterrows():
        cells = "".join(f"<td>{_cell(row, column, kind)}</td>" for column, _, kind in columns)
        laws = (broken or {}).get(row["run"])
        mark = f' class="broken" title="breaks: {html.escape(", ".join(laws))}"' if laws else ""
        body.append(f"<tr{mark}>{cells}</tr>")
    return f"<table><thead><tr>{head}</tr></thead><tbody>{''.join(body)}</tbody></table>"


def _cell(row: Any, column: str, kind: str) -> str:
    value = row[column]
    if kind == "text":
        return html.escape(str(value))
    if kind == "count" and np.isfinite(value) and value >= 1:
        return number(round(value))
    if kind == "megabytes":
        return number(value / 1e6)
    if kind == "interval":
        return number(value) + _small(" – ", (row.get(f"{column}_{end}", math.nan) for end in ("low", "high")))
    if kind == "ways":
        ends = (f"{column.removesuffix('_worst')}_{way}_worst" for way in ("source_to_drawn", "drawn_to_source"))
        return number(value) + _small(" · ", (row.get(end, math.nan) for end in ends))
    return number(value)


def _small(between: str, values: Iterable[float]) -> str:
    """A second line of a cell; empty where one of the values is not known."""
    known = list(values)
    text = between.join(map(number, known))
    return "" if any(map(math.isnan, known)) else f'<br><small class="faint">{text}</small>'


def noise_text(noise: Any) -> str:
    """What the null comparison says, as HTML; `noise`: the rows of `noise.csv`, or None."""
    floor = noise_floor(noise)
    if floor is None:
        return "No null comparison is here (one method timed twice), so how well this machine repeats is not known."
    names = (("select_ms", "selecting"), ("gpu_ms", "on the GPU"))
    parts = ", ".join(f"{percent(part)} {name}" for column, name in names if (part := noise_floor(noise, column)))
    row = noise.iloc[0]
    shared = ""
    if row["jobs"] > 1:
        shared = f" The runs shared the machine, {row['jobs']} at a time; the second time this one had it to itself."
    return (
        f"The same method twice differs by up to <b>{percent(floor)}</b> in frame time"
        f"{f' ({parts})' if parts else ''}: <code>{html.escape(row['run'])}</code>, timed once more after "
        f"everything else. That is this machine's noise floor; no smaller difference of times is a finding.{shared}"
    )


# ---- pictures -------------------------------------------------------------------------------------


def _inline(data: bytes, kind: str) -> str:
    return f"data:image/{kind};base64,{base64.b64encode(data).decode()}"


def _chart(chart: Chart, caption: str, light: str | None = None) -> str:
    """A chart in both dresses; the reader's colour scheme chooses. `light`: its SVG, where it is drawn already."""
    light, dark = (_inline(svg.encode(), "svg+xml") for svg in (light or chart.svg("light"), chart.svg("dark")))
    return (
        f'<figure class="chart"><picture><source media="(prefers-color-scheme: dark)" srcset="{dark}">'
        f'<img alt="{html.escape(chart.title)}" src="{light}"></picture><figcaption>{caption}</figcaption></figure>'
    )


def _strip(directory: Path, run: Any, seen: dict[Path, str]) -> str:
    """Shade, reference, difference, error and levels of a run's worst frame; empty when it wrote none."""
    folder = worst_folder(directory, run["run"])
    found = sorted(folder.glob("*-level.png"))
    if not found:
        return ""
    number_text = found[0].name.split("-")[0]
    deltas = sorted(folder.glob(f"{number_text}-difference-x*.png"))
    factor = re.search(r"-x(\d+)\.png$", deltas[0].name)[1] if deltas else ""
    items = [
        (directory / "images" / run["run"] / f"{number_text}.png", "drawn"),
        (folder / f"{number_text}-reference.png", "reference: everything drawn"),
        *((file, f"difference × {factor}") for file in deltas),
        (folder / f"{number_text}-error.png", "measured error"),
        (found[0], "levels of the hierarchy"),
    ]
    cells = []
    for file, caption in items:
        if not file.exists():
            continue
        if file not in seen:
            kind = "png" if "level" in file.name else "jpeg"
            seen[file] = _inline(pictures.encode(pictures.load(file), STRIP_WIDTH, kind), kind)
        cells.append(f'<figure><a href="{_link(file)}"><img loading="lazy" alt="{caption}" src="{seen[file]}"></a>'
                     f"<figcaption>{caption}</figcaption></figure>")  # fmt: skip
    error = number(run["measured_px_max_worst"])
    frame = f'<a href="{_link(items[0][0])}">frame {int(number_text)}</a>'
    head = f"<h3>{html.escape(run['run'])} <span class='faint'>· {frame}, {error} px</span></h3>"
    return f'{head}<div class="strip">{"".join(cells)}</div>'


def _link(picture: Path) -> str:
    """A picture of `images/` as the page, beside that folder, points at it."""
    return html.escape(quote("/".join(("images", picture.parent.name, picture.name))))


def _strips(result: Sweep) -> str:
    seen: dict[Path, str] = {}
    parts = [_strip(result.directory, row, seen) for _, row in result.summary.iterrows()]
    text = "".join(parts)
    if not text:
        return '<p class="faint">These runs kept no pictures (images = none).</p>'
    note = (
        "The measured frame of each run with the largest error; a picture opens in full size. The difference is the "
        "absolute difference to the reference in each colour, brightened by the factor that is named. The measured "
        "error is coloured on the drawn surface, in pixels of distance to the source."
    )
    return f"<p>{note}</p>{text}"


# ---- the page -------------------------------------------------------------------------------------


def _jobs_note(folder: Path) -> str:
    """Beside the table of times, where they were not taken one run at a time."""
    jobs = read_provenance(folder).get("jobs", [])
    return f" These are {_jobs_text(jobs)}." if jobs and max(jobs) > 1 else ""


def _provenance(folder: Path, summary: Any) -> str:
    record = read_provenance(folder)
    gl, host = record.get("gl", {}), record.get("machine", {})
    memory = host.get("memory_bytes", 0) / 2**30
    libraries = ", ".join(f"{k} {v}" for k, v in sorted(record.get("libraries", {}).items()))
    rows = [
        ("lodlab", f"{record.get('lodlab', '?')}, commit {record.get('commit', 'unknown')}"),
        ("device", f"{gl.get('renderer', '?')} ({gl.get('vendor', '?')}), OpenGL {gl.get('version', '?')}"),
        ("GPU clock", ", ".join(_CLOCKS.get(c, c) for c in summary["gpu_clock"].unique())),
        (
            "machine",
            f"{host.get('cpu', '?')}, {host.get('cores', '?')} cores, {memory:.1f} GiB, {host.get('system', '')}",
        ),
        ("Python", host.get("python", "?")),
        ("libraries", libraries),
        *(("source", f"{name}, hash {value}") for name, value in record.get("sources", {}).items()),
        ("jobs", _jobs_text(record.get("jobs", []))),
        ("options hash", record.get("options_hash", "?")),
        ("start, end", f"{record.get('start', '?')} to {record.get('end', '?')}"),
    ]
    return "<dl>" + "".join(f"<dt>{html.escape(k)}</dt><dd>{html.escape(str(v))}</dd>" for k, v in rows) + "</dl>"


def _jobs_text(jobs: list[int]) -> str:
    """With how many runs at a time the times of a directory were taken."""
    if not jobs:
        return "not known"
    many = _join(map(str, jobs))
    shared = "; runs that share the machine slow one another, so compare their times with care" if max(jobs) > 1 else ""
    return f"times taken with {many} run{'s' if max(jobs) > 1 else ''} at a time{shared}"


_CLOCKS = {
    "wall": "wall time from the first GL call to glFinish (software device)",
    "query": "GL_TIME_ELAPSED",
}


def write(directory: str | os.PathLike[str]) -> Path:
    """(Re)writes `report.html`, `pareto.png` and `pareto.svg` of a run directory; the report's path.

    InvalidInput when the directory holds no finished run.
    """
    result = Sweep.load(directory)
    if result.summary.empty:
        raise InvalidInput(f"report: {directory} holds no finished run")
    folder, summary = result.directory, result.summary
    config = (folder / "config.toml").read_text() if (folder / "config.toml").exists() else ""
    pareto = '<p class="faint">No frame was measured, so there is no chart of error.</p>'
    if summary["measured_px_max_worst"].notna().any():
        chart = charts.pareto(result)
        chart.save(folder / "pareto.png")
        light = chart.svg()
        write_atomic(folder / "pareto.svg", light)
        pareto = _chart(chart, _PARETO_CAPTION, light)
    sources, methods = _join(summary["source"].map(short_source)), _join(summary["method"])
    size, fov = _viewport(config)
    verdicts = judge(result.frames, size[0], fov)
    text = fill(
        Path(__file__).with_name("report.html"),
        title=f"lodlab: {methods} on {sources}",
        heading=f"{methods} on {sources}",
        subtitle=(
            f"{len(summary)} run{'s' if len(summary) > 1 else ''}, "
            f"path {_join(Path(p).stem for p in summary['path'])}, "
            f"{int(summary['frames'].max())} frames of {size[0]} × {size[1]}, {_join(summary['device'])}"
        ),
        lead=_LEAD,
        pareto=pareto,
        table_note=_TABLE_NOTE + (_MESH_NOTE if (summary["source_kind"] == "mesh").any() else "") + _jobs_note(folder),
        noise=noise_text(result.noise),
        table=summary_table(summary, broken_by_run(verdicts)),
        laws="".join(f'<li class="{v.verdict}">{html.escape(v.sentence)}</li>' for v in verdicts),
        strips=_strips(result),
        timeline=_timeline(result),
        provenance=_provenance(folder, summary),
        config=html.escape(config.removeprefix(HEAD)),
    )
    write_atomic(folder / "report.html", text)
    return folder / "report.html"


MOST_LINES = 8  # of a timeline; with more, every curve of the chart above has one of its own


def _timeline(result: Sweep) -> str:
    """A timeline for each source and path, and where that is many lines for each curve, the baseline beside it."""
    parts = []
    groups = result.summary.groupby(["source", "path"], sort=False)
    for (source, path), rows in groups:
        named = [f"{short_source(source)}, {Path(path).stem}"] if len(groups) > 1 else []
        series = series_of(rows)
        split = len(rows) > MOST_LINES
        for item in [s for s in series if not s.baseline] if split else [None]:
            runs = rows if item is None else rows[rows["run"].isin(item.points["run"]) | (rows["method"] == BASELINE)]
            frames = result.frames[result.frames["run"].isin(runs["run"])]
            title = ". ".join([*named, *([item.label] if item else []), ""]).strip()
            caption = f"{html.escape(title)} {_TIMELINE_CAPTION}".strip()
            parts.append(_chart(charts.timeline(Sweep(None, frames, runs)), caption))
    return "".join(parts)


def _viewport(config: str) -> tuple[list[int], float]:
    import tomllib

    values = tomllib.loads(config)
    return values.get("size", [1280, 720]), values.get("fov", 60.0)


def _join(values: Iterable[str]) -> str:
    names = list(dict.fromkeys(values))
    return names[0] if len(names) == 1 else ", ".join(names[:-1]) + " and " + names[-1]


_LEAD = (
    "Each run flies a camera along a path under a budget. What a frame cost was timed in a pass that reads nothing "
    "back; how wrong it was, was measured afterwards on the triangles that the GPU really emitted, at every sample "
    "of the source (of a mesh: at every vertex, and both ways over the surfaces). <b>full</b> draws everything, "
    "always: the reference, and the speed to beat."
)
_PARETO_CAPTION = (
    "A point is a run, labelled with its budget; logarithmic axes. Height: the largest distance on screen between a "
    "sample of the source and the drawn surface, over the measured frames. Thin bars reach from the 5th to the 95th "
    "percentile of the run's frames, thick ones over the 95 % interval of its median time. Times that chance and the "
    "noise of this machine do not tell apart, frame by frame, are marked: dashed between two budgets of a curve, "
    "dotted between two curves at one budget, hollow against <b>full</b>. Runs on the dashed line measure zero "
    "(below the slack of 0.01 px)."
)
_TIMELINE_CAPTION = "The stronger the colour, the smaller the error budget. A point below its line: the promise holds."
_MESH_NOTE = (
    " Distances of meshes are in the units of their files; under the larger one stand both ways, from the source to "
    "what is drawn · from what is drawn to the source."
)
_TABLE_NOTE = (
    "Times and counts are medians over the frames of a run, under the median time its 95 % interval (frames and "
    "timing passes drawn again); errors are the worst over its measured frames. "
    "Every figure of every frame is in <code>frames.csv</code>."
)
