# SPDX-License-Identifier: MIT
"""The report of a run directory: one self-contained HTML page and the charts beside it.

Everything is read back from the directory, so that a report can be made again at any time. Pictures and
charts stand inside the page; it opens from disk without a network, in light and dark.
"""

from __future__ import annotations

import base64
import html
import json
import os
import re
from collections.abc import Iterable
from pathlib import Path
from string import Template
from typing import Any

import numpy as np

from . import charts, pictures
from .errors import InvalidInput
from .figures import number
from .laws import judge
from .results import HEAD, short_source, write_atomic
from .sweeps import Sweep

STRIP_WIDTH = 480  # pixels of a picture in the page; full size lies in images/


# ---- tables ---------------------------------------------------------------------------------------

COLUMNS = (
    ("run", "run", "text"),
    ("frame_ms_median", "ms<br>median", "number"),
    ("frame_ms_p95", "ms<br>p95", "number"),
    ("triangles_median", "triangles<br>median", "count"),
    ("nodes_median", "nodes<br>median", "count"),
    ("predicted_px_worst", "predicted<br>px", "number"),
    ("measured_px_max_worst", "measured<br>px", "number"),
    ("measured_px_p99_worst", "measured<br>px, p99", "number"),
    ("measured_max_worst", "measured<br>m", "number"),
    ("psnr_db_worst", "PSNR<br>dB", "number"),
    ("crack_pixels_worst", "crack<br>pixels", "count"),
    ("hole_samples_worst", "hole<br>samples", "count"),
    ("budget_met", "budget<br>met", "number"),
    ("store_bytes", "store<br>MB", "megabytes"),
)


def summary_table(summary: Any) -> str:
    """The runs as an HTML table."""
    head = "".join(f"<th>{title}</th>" for _, title, _ in COLUMNS)
    forms = {
        "text": lambda v: html.escape(str(v)),
        "number": number,
        "count": lambda v: number(round(v)) if np.isfinite(v) and v >= 1 else number(v),
        "megabytes": lambda v: number(v / 1e6),
    }
    body = []
    for _, row in summary.iterrows():
        cells = "".join(f"<td>{forms[kind](row[column])}</td>" for column, _, kind in COLUMNS)
        body.append(f"<tr>{cells}</tr>")
    return f"<table><thead><tr>{head}</tr></thead><tbody>{''.join(body)}</tbody></table>"


# ---- pictures -------------------------------------------------------------------------------------


def _inline(data: bytes, kind: str) -> str:
    return f"data:image/{kind};base64,{base64.b64encode(data).decode()}"


def _chart(chart: charts.Chart, caption: str) -> str:
    """A chart in both dresses; the reader's colour scheme chooses."""
    light, dark = (_inline(chart.svg(theme).encode(), "svg+xml") for theme in ("light", "dark"))
    return (
        f'<figure class="chart"><picture><source media="(prefers-color-scheme: dark)" srcset="{dark}">'
        f'<img alt="{html.escape(chart.title)}" src="{light}"></picture><figcaption>{caption}</figcaption></figure>'
    )


def _strip(folder: Path, run: Any, seen: dict[Path, str]) -> str:
    """Shade, reference, difference and levels of a run's worst frame; empty when it wrote none."""
    found = sorted(folder.glob("*-level.png"))
    if not found:
        return ""
    number_text = found[0].name.split("-")[0]
    reference = folder / f"{number_text}-reference.png"
    deltas = sorted(folder.glob(f"{number_text}-difference-x*.png"))
    items = [(folder / f"{number_text}.png", "drawn")]
    if reference.exists():
        items.append((reference, "reference: everything drawn"))
    if deltas:
        factor = re.search(r"-x(\d+)\.png$", deltas[0].name)[1]
        items.append((deltas[0], f"difference × {factor}"))
    items.append((found[0], "levels of the hierarchy"))
    cells = []
    for file, caption in items:
        if file not in seen:
            kind = "png" if "level" in file.name else "jpeg"
            seen[file] = _inline(pictures.encode(pictures.load(file), STRIP_WIDTH, kind), kind)
        cells.append(f'<figure><img loading="lazy" alt="{caption}" src="{seen[file]}"><figcaption>{caption}'
                     "</figcaption></figure>")  # fmt: skip
    error = number(run["measured_px_max_worst"])
    head = f"<h3>{html.escape(run['run'])} <span class='faint'>· frame {int(number_text)}, {error} px</span></h3>"
    return f'{head}<div class="strip">{"".join(cells)}</div>'


def _strips(result: Sweep) -> str:
    seen: dict[Path, str] = {}
    parts = [_strip(result.directory / "images" / row["run"], row, seen) for _, row in result.summary.iterrows()]
    text = "".join(parts)
    if not text:
        return '<p class="faint">These runs kept no pictures (images = none).</p>'
    note = (
        "The measured frame of each run with the largest error. The difference is the absolute difference to the "
        "reference in each colour, brightened by the factor that is named. Full size: <code>images/</code>."
    )
    return f"<p>{note}</p>{text}"


# ---- the page -------------------------------------------------------------------------------------


def _provenance(folder: Path, summary: Any) -> str:
    file = folder / "provenance.json"
    record = json.loads(file.read_text()) if file.exists() else {}
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
        ("options hash", record.get("options_hash", "?")),
        ("start, end", f"{record.get('start', '?')} to {record.get('end', '?')}"),
    ]
    return "<dl>" + "".join(f"<dt>{html.escape(k)}</dt><dd>{html.escape(str(v))}</dd>" for k, v in rows) + "</dl>"


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
        chart.save(folder / "pareto.svg")
        pareto = _chart(chart, _PARETO_CAPTION)
    page = Template((Path(__file__).parent / "templates" / "report.html").read_text(encoding="utf-8"))
    sources, methods = _join(summary["source"].map(short_source)), _join(summary["method"])
    size, fov = _viewport(config)
    text = page.substitute(
        title=html.escape(f"lodlab: {methods} on {sources}"),
        heading=html.escape(f"{methods} on {sources}"),
        subtitle=html.escape(
            f"{len(summary)} runs, path {_join(Path(p).stem for p in summary['path'])}, "
            f"{int(summary['frames'].max())} frames of {size[0]} × {size[1]}, {_join(summary['device'])}"
        ),
        lead=_LEAD,
        pareto=pareto,
        table_note=_TABLE_NOTE,
        table=summary_table(summary),
        laws="".join(
            f'<li class="{v.verdict}">{html.escape(v.sentence)}</li>' for v in judge(result.frames, size[0], fov)
        ),
        strips=_strips(result),
        timeline=_timeline(result),
        provenance=_provenance(folder, summary),
        config=html.escape(config.removeprefix(HEAD)),
    )
    write_atomic(folder / "report.html", text)
    return folder / "report.html"


def _timeline(result: Sweep) -> str:
    """A timeline for each source and path."""
    parts = []
    for (source, path), rows in result.summary.groupby(["source", "path"], sort=False):
        frames = result.frames[result.frames["run"].isin(rows["run"])]
        several = len(result.summary.groupby(["source", "path"])) > 1
        title = f"{html.escape(short_source(source))}, {html.escape(Path(path).stem)}. " if several else ""
        parts.append(_chart(charts.timeline(Sweep(None, frames, rows)), title + _TIMELINE_CAPTION))
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
    "of the source. <b>full</b> draws everything, always: the reference, and the speed to beat."
)
_PARETO_CAPTION = (
    "A point is a run, labelled with its budget; logarithmic axes. Height: the largest distance on screen between a "
    "sample of the source and the drawn surface, over the measured frames. Thin bars reach from the 5th to the 95th "
    "percentile of the run's frames. Runs on the dashed line measure zero (below the slack of 0.01 px)."
)
_TIMELINE_CAPTION = "The stronger the colour, the smaller the error budget. A point below its line: the promise holds."
_TABLE_NOTE = (
    "Times and counts are medians over the frames of a run; errors are the worst over its measured frames. "
    "Every figure of every frame is in <code>frames.csv</code>."
)
