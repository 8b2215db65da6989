# SPDX-License-Identifier: MIT
"""The run of the suite: scenes played on every method, source by source; their rows, pictures and verdicts.

A scene that ends in an error is a FAIL row that names it, never a gap: every scene has a row for every method.
"""

from __future__ import annotations

import csv
import gc
import io
import itertools
import json
import math
import shutil
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .. import _core, pictures
from ..disk import write_atomic
from ..errors import InvalidInput, Unsupported
from ..runs import provenance, tables
from ..sources.spec import short_source
from ..stores.methods import method_table
from . import fields, page, rules
from .rules import BY_NATURE, FAIL, NOT_APPLICABLE, PASS, badness
from .scenes import SCENES
from .stage import Bench, Figure, NotApplicable, Scene, Stage

COLUMNS = ("scene", "method", "source", "options", "figure", "value", "unit", "limit", "verdict")


@dataclass
class Stability:
    """What a run of the suite found. `table`: DataFrame of `stability.csv`; `directory`: where it lies."""

    table: Any
    directory: Path

    @property
    def failed(self) -> Any:
        """The rows whose verdict is FAIL."""
        return self.table[self.table["verdict"] == FAIL]

    @property
    def searches(self) -> dict[str, str]:
        """By method: what the random search (s20) played and found, in a sentence; empty where it was not run."""
        methods = self.table["method"][self.table["scene"] == "s20"].unique()
        files = {name: self.directory / f"search-{name}.json" for name in methods}
        return {name: json.loads(file.read_text())["summary"] for name, file in files.items() if file.exists()}

    @property
    def page(self) -> Path:
        """The page with the grid of methods and scenes."""
        return self.directory / "stability.html"


@dataclass(frozen=True)
class Part:
    """A scene of one method on one source under some draw options: a step of the progress bar."""

    scene: Scene
    method: str
    source: str
    options: dict[str, Any]


def run(
    out: Path | str,
    *,
    methods: Iterable[str] | None = None,
    scenes: Iterable[str] | None = None,
    short: bool = False,
    seed: int = 0,
    seconds: float | None = None,
    progress: bool = True,
) -> Stability:
    """Puts methods through scenes; writes `stability.csv`, `stability.html`, `provenance.json` and `images/`.

    `methods`, `scenes`: names, all when None. `short`: small sources, fewer eyes and frames: minutes; else an hour
    at most. `seed` and `seconds` are those of the random search, s20: how long it goes on, all methods together (None:
    a number of trials). Rows are written as scenes end. InvalidInput: an unknown method or scene (the known ones are
    listed), seconds that are not above 0, or a wrong row of by_nature.toml.
    """
    names = _known("method", methods, [m["name"] for m in _core.methods()])
    wanted = _known("scene", scenes, [s.name for s in SCENES])
    natures = rules.read()
    if seconds is not None and not 0.0 < seconds < math.inf:
        raise InvalidInput(f"stability: seconds is {seconds!r}; it is a number above 0")
    folder = Path(out)
    if folder.exists() and not folder.is_dir():
        raise InvalidInput(f"stability: {folder} is a file, not a directory")
    shutil.rmtree(folder / "images", ignore_errors=True)
    (folder / "images").mkdir(parents=True, exist_ok=True)
    start = provenance.now()
    rows = [
        _no_source(scene, method)
        for scene in SCENES
        for method in names
        if scene.name in wanted and not _sources(scene, method, short)
    ]
    worst: dict[tuple[str, str], float] = {}
    benches: dict[str, Bench] = {}
    _write(folder, rows)
    for part in _steps(list(_parts(wanted, names, short)), progress):
        if part.source not in benches:
            benches.clear()  # one source at a time: its references and stores fill memory
            gc.collect()
            benches[part.source] = Bench(part.source, folder / "stores")
        each = None if seconds is None else seconds / len(names)
        stage = Stage(benches[part.source], part.method, part.options, short, seed, each, progress)
        for figure, row in _play(part, stage, natures):
            rows.append(row)
            _keep_picture(folder / "images", figure, row, worst)
        rows.sort(key=lambda r: (r["scene"], names.index(r["method"])))
        _write(folder, rows)
    (folder / "provenance.json").write_text(json.dumps(_provenance(start, names, wanted, short), indent=2) + "\n")
    table = read(folder)
    page.write(folder, table)
    return Stability(table, folder)


def read(folder: Path | str) -> Any:
    """The rows of a folder's `stability.csv` as a DataFrame; InvalidInput when there is none."""
    import pandas as pd

    file = Path(folder) / "stability.csv"
    if not file.is_file():
        raise InvalidInput(f"stability: no file {file}")
    numbers = {"value": "float64", "limit": "float64"}
    text = {c: str for c in COLUMNS if c not in numbers}
    return pd.read_csv(file, dtype=text | numbers, keep_default_na=False, na_values={c: ["nan", ""] for c in numbers})


def _known(what: str, given: Iterable[str] | None, known: Sequence[str]) -> list[str]:
    """The given names in the order of the known ones, or all."""
    wanted = list(known) if given is None else [given] if isinstance(given, str) else list(given)
    for name in wanted:
        if name not in known:
            raise InvalidInput(f"stability: no {what} {name!r}; known: {', '.join(known)}")
    if not wanted:
        raise InvalidInput(f"stability: no {what} is named; known: {', '.join(known)}")
    return [name for name in known if name in wanted]


# ---- what is played -------------------------------------------------------------------------------


def _parts(scenes: Sequence[str], names: Sequence[str], short: bool) -> Iterator[Part]:
    """Source by source, so that each is loaded, built and drawn at full resolution once."""
    table = [scene for scene in SCENES if scene.name in scenes]
    played = {(s.name, m): _sources(s, m, short) for s in table for m in names}
    for source in dict.fromkeys(source for sources in played.values() for source in sources):
        for scene, method in itertools.product(table, names):
            if source not in played[scene.name, method]:
                continue
            yield Part(scene, method, source, {})
            if scene.variants and not short and source == played[scene.name, method][0]:
                yield from (Part(scene, method, source, options) for options in rules.variants(method))


def _sources(scene: Scene, method: str, short: bool) -> list[str]:
    """The sources of a scene that are there and that the method accepts."""
    accepts = method_table(method)["accepts"]
    at_hand = fields.at_hand(scene.short if short else scene.long)
    return [name for name in at_hand if name == fields.ANY or fields.kind(name) in accepts]


def _no_source(scene: Scene, method: str) -> dict[str, Any]:
    """The row of a method that accepts none of a scene's sources."""
    reason = f"the method accepts {', '.join(method_table(method)['accepts'])}: none of the scene's sources"
    values = (scene.name, method, "", "{}", reason, math.nan, "", math.nan, NOT_APPLICABLE)
    return dict(zip(COLUMNS, values, strict=True))


def _steps(parts: list[Part], progress: bool) -> Iterator[Part]:
    """The parts, with a bar that names the one being played."""
    from ..progress import tqdm

    with tqdm(total=len(parts), disable=None if progress else True, leave=False) as bar:
        for part in parts:
            bar.set_description_str(f"{part.scene.name} {part.method} {short_source(part.source)}")
            yield part
            bar.update()


def _play(part: Part, stage: Stage, natures: Sequence[rules.Rule]) -> Iterator[tuple[Figure, dict]]:
    """The figures of one part and their rows. An error that nobody expected is a FAIL row that names it."""
    options = stage.resolved_options

    def row(figure: Figure, limit: float, verdict: str) -> tuple[Figure, dict[str, Any]]:
        values = (part.scene.name, part.method, part.source, tables.options_text(options), figure.name)
        return figure, dict(zip(COLUMNS, (*values, figure.value, figure.unit, limit, verdict), strict=True))

    try:
        for figure in part.scene.play(stage):
            yield row(figure, *_verdict(part, options, figure, natures))
    except NotApplicable as reason:
        yield row(Figure(str(reason), math.nan, "", math.nan), math.nan, NOT_APPLICABLE)
    except Unsupported as refusal:  # a choice of options may refuse a budget that the method takes; defaults may not
        verdict = NOT_APPLICABLE if part.options else FAIL
        yield row(Figure(f"Unsupported: {refusal}", math.nan, "", math.nan), math.nan, verdict)
    except Exception as error:  # whatever it is: a scene that breaks is the method's failure, not a gap
        text = " ".join(f"{type(error).__name__}: {error}".split())
        yield row(Figure(text, math.nan, "", math.nan), math.nan, FAIL)


def _verdict(part: Part, options: dict[str, Any], figure: Figure, natures: Sequence[rules.Rule]) -> tuple[float, str]:
    """(limit, verdict): a row of by_nature.toml that covers the figure has the last word."""
    for rule in natures:
        if rule.covers(part.method, options, part.scene.name, figure.name):
            return rule.limit, BY_NATURE if figure.value <= rule.limit else FAIL
    return figure.limit, PASS if figure.value <= figure.limit else FAIL


# ---- what is written ------------------------------------------------------------------------------


def _keep_picture(folder: Path, figure: Figure, row: dict[str, Any], worst: dict[tuple[str, str], float]) -> None:
    key = row["scene"], row["method"]
    if figure.picture is None or badness(row) <= worst.get(key, -math.inf):
        return
    worst[key] = badness(row)
    pictures.save(folder / page.picture_name(*key), figure.picture)


def _write(folder: Path, rows: Sequence[dict[str, Any]]) -> None:
    text = io.StringIO(newline="")
    csv.writer(text).writerows([COLUMNS, *([tables.cell(row[c]) for c in COLUMNS] for row in rows)])
    write_atomic(folder / "stability.csv", text.getvalue())


def _provenance(start: str, names: list[str], scenes: list[str], short: bool) -> dict[str, Any]:
    return {
        "lodlab": provenance.version(),
        "commit": provenance.commit(),
        "start": start,
        "end": provenance.now(),
        "machine": provenance.machine(),
        "gl": _core.gl_info(),
        "methods": names,
        "scenes": scenes,
        "short": short,
    }
