# SPDX-License-Identifier: MIT
"""`stability.html`: the grid of scenes and methods, each with its worst figure and the picture of its worst frame.

Made from `stability.csv`, `provenance.json` and `images/` alone; self-contained, in light and dark.
"""

from __future__ import annotations

import base64
import html
import inspect
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from .. import pictures
from ..disk import write_atomic
from ..figures import number
from ..report.frame import fill
from ..sources.spec import short_source
from ..stores.methods import method_table
from .rules import BY_NATURE, FAIL, NOT_APPLICABLE, PASS, badness
from .scenes import SCENES
from .stage import Scene

WORDS = {PASS: "pass", BY_NATURE: "by nature", NOT_APPLICABLE: "not applicable", FAIL: "FAIL"}
THUMBNAIL = 320  # pixels of a picture in the page

_LEAD = (
    "Failures of level-of-detail methods that were published or reported, a scene each. A cell shows the scene's worst "
    "figure with its limit, and the frame that it comes from (colours are levels of the hierarchy where levels matter)."
)


def write(folder: Path, table: Any) -> Path:
    """Writes the page of a folder from its rows; the page's path."""
    record = json.loads((folder / "provenance.json").read_text())
    names, counts = list(dict.fromkeys(table["method"])), table["verdict"].value_counts()
    scenes = [scene for scene in SCENES if scene.name in set(table["scene"])]
    summary = ", ".join(f"{counts[v]} {WORDS[v]}" for v in (PASS, BY_NATURE, NOT_APPLICABLE, FAIL) if v in counts)
    text = fill(
        Path(__file__).with_name("stability.html"),
        title=f"lodlab stability: {', '.join(names)}",
        heading=f"Stability of {', '.join(names)}",
        subtitle=(
            f"{len(scenes)} scenes, {len(table)} figures: {summary}. "
            f"{'Short' if record['short'] else 'Long'} form, {record['gl']['renderer']}"
        ),
        lead=_LEAD,
        grid=_grid(folder, table, scenes, names),
        scenes="".join(_scene(table[table["scene"] == scene.name], scene) for scene in scenes),
        provenance=_provenance(record),
    )
    write_atomic(folder / "stability.html", text)
    return folder / "stability.html"


def _grid(folder: Path, table: Any, scenes: list[Scene], names: list[str]) -> str:
    head = "".join(f"<th>{html.escape(name)}</th>" for name in names)
    body = []
    for scene in scenes:
        rows = table[table["scene"] == scene.name]
        title = f'<td><a href="#{scene.name}"><b>{scene.name}</b> {html.escape(scene.title)}</a></td>'
        cells = "".join(_cell(folder, rows[rows["method"] == name], scene, name) for name in names)
        body.append(f"<tr>{title}{cells}</tr>")
    return f"<thead><tr><th>scene</th>{head}</tr></thead><tbody>{''.join(body)}</tbody>"


def _cell(folder: Path, rows: Any, scene: Scene, method: str) -> str:
    """The worst row of a scene and method: verdict, figure, limit, picture."""
    worst = max((row for _, row in rows.iterrows()), key=badness)
    verdict = worst["verdict"]
    text = html.escape(worst["figure"])
    if not np.isnan(worst["value"]):
        text += f"<br><b>{_value(worst)}</b> <span class='faint'>limit {_number(worst['limit'])}</span>"
    if worst["source"]:
        text += f"<br><span class='faint'>{html.escape(short_source(worst['source']))}</span>"
    file = folder / "images" / picture_name(scene.name, method)
    if file.exists():
        data = base64.b64encode(pictures.encode(pictures.load(file), THUMBNAIL, "jpeg")).decode()
        name = f"{scene.name}, {html.escape(method)}: worst frame"
        text += f'<img loading="lazy" alt="{name}" src="data:image/jpeg;base64,{data}">'
    return f'<td class="{verdict}"><span class="verdict {verdict}">{WORDS[verdict]}</span><br>{text}</td>'


def _number(value: float) -> str:
    """Counts without decimals."""
    return number(int(value) if value.is_integer() else value)


def _value(row: Any) -> str:
    return f"{_number(row['value'])} {html.escape(row['unit'])}"


def _scene(rows: Any, scene: Scene) -> str:
    """What a scene is after, and all its rows."""
    text = html.escape(inspect.getdoc(scene.play) or "").replace("\n", " ")
    for word in ("Test:", "Figure:", "Figures:", "Figures and limits"):
        text = text.replace(f" {word}", f"</p><p>{word}")
    body = "".join(
        f"<tr><td>{html.escape(row['method'])}</td><td>{html.escape(short_source(row['source']))}"
        f'<div class="options">{_options(row)}</div></td><td>{html.escape(row["figure"])}</td>'
        f'<td class="number">{_value(row)}</td><td class="number">{_number(row["limit"])}</td>'
        f'<td class="verdict {row["verdict"]}">{WORDS[row["verdict"]]}</td></tr>'
        for _, row in rows.iterrows()
    )
    head = "<tr><th>method</th><th>source</th><th>figure</th><th>value</th><th>limit</th><th>verdict</th></tr>"
    return (
        f'<h3 id="{scene.name}">{scene.name} {html.escape(scene.title)}</h3><p>{text}</p>'
        f'<div class="scroll"><table><thead>{head}</thead><tbody>{body}</tbody></table></div>'
    )


def _options(row: Any) -> str:
    """The options of a row that are not the method's defaults."""
    defaults = {o["name"]: o["default"] for o in method_table(row["method"])["options"]}
    given = json.loads(row["options"]).items()
    return html.escape(", ".join(f"{k}={v}" for k, v in given if defaults[k] != v and k not in _STILL))


_STILL = ("stream", "gpu_cache_mb")  # scenes load everything first, unless they are about paging


def _provenance(record: Mapping[str, Any]) -> str:
    host, gl = record["machine"], record["gl"]
    rows = [
        ("lodlab", f"{record['lodlab']}, commit {record['commit']}"),
        ("device", f"{gl['renderer']} ({gl['vendor']}), OpenGL {gl['version']}"),
        ("machine", f"{host['cpu']}, {host['cores']} cores, {host['system']}"),
        ("start, end", f"{record['start']} to {record['end']}"),
    ]
    return "<dl>" + "".join(f"<dt>{html.escape(k)}</dt><dd>{html.escape(str(v))}</dd>" for k, v in rows) + "</dl>"


def picture_name(scene: str, method: str) -> str:
    """The file of the worst frame of a scene and method, below `images/`."""
    return f"{scene}-{method}.png"
