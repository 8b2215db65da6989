# SPDX-License-Identifier: MIT
"""Sweeps and comparisons: runs over a grid (see `configs`), in one run directory, in this process or in spawned
workers. A sweep that was stopped goes on where it stopped."""

from __future__ import annotations

import contextlib
import html
import multiprocessing
import os
import signal
import threading
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import connection
from pathlib import Path
from typing import Any

from .. import _core, disk
from ..errors import InvalidInput, Unsupported
from ..instrument import statistics
from ..paths.path import CameraPath
from ..sources.heightfield import HeightField
from ..sources.spec import as_source, parse
from ..stores.store import Store, method_table
from . import results
from .configs import BUDGET_LISTS, DEFAULT_PIXEL_ERRORS, Task, enter, freeze, plan
from .identity import (
    KEPT_MB,
    hash_list,
    keep_array,
    keep_file,
    kept_array,
    path_in,
    poses_hash,
    rasters,
    source_in,
    take_path,
)
from .passes import (
    Flight,
    Yardstick,
    accuracy_indices,
    check_capture,
    look_of,
    make_path,
    path_text,
    perform,
    store_for,
    summary_of,
    timed,
)
from .run import Run


class Workshop:
    """Makes runs, one after the other; keeps the source, its yardstick and its stores between them. `stores`: the
    user's own folder of stores, or None for the run directory's."""

    def __init__(self, folder: Path, sources: Mapping[str, HeightField], progress: bool, stores: Path | None = None):
        self.folder = folder
        self.sources = dict(sources)
        self.stores = stores
        self._shelf = (folder / "stores" if stores is None else stores, stores is not None)  # and: the user's own
        self._progress = progress
        self._name: str | None = None
        self._source: HeightField | None = None
        self._yardsticks: dict[str, Yardstick] = {}

    def source(self, name: str) -> HeightField:
        """The source of a task, loaded once while tasks of the same source follow each other."""
        if self._name != name or self._source is None:
            self._yardsticks.clear()
            self._source = self.sources[name] if name in self.sources else source_in(self.folder, name)
            self._name = name
        return self._source

    def path(self, flight: Flight) -> CameraPath:
        """The path of a task: a built-in one, or key frames that the directory keeps."""
        named = path_in(self.folder, flight.path)
        return make_path(named, self.source(flight.source), flight.frames, flight.fov)

    def store_of(self, source: HeightField, method: str, options: Mapping[str, Any]) -> Store:
        """A store, built when it is not there."""
        folder, named = self._shelf
        return store_for(source, method, options, folder, progress=self._progress, named=named)

    def prepare(self, task: Task) -> Store:
        """The store of a task, built when it is not there."""
        return self.store_of(self.source(task.flight.source), task.method, task.build_options)

    def yardstick(self, store: Store, metrics: str) -> Yardstick:
        """What a store's cuts are measured against; one for all stores that look alike."""
        look = look_of(store)
        key = results.options_text(look)
        if key not in self._yardsticks:
            folder, named = self._shelf
            self._yardsticks[key] = Yardstick(store.source, folder, self._progress, look, metrics, named)
        return self._yardsticks[key]

    def make(self, task: Task, tick: Callable[[], Any]) -> dict[str, Any]:
        """One run: its rows, and what the provenance wants to know."""
        store = self.prepare(task)
        flight = task.flight
        yardstick = self.yardstick(store, flight.metrics)
        flown = perform(store, self.path(flight), flight, yardstick=yardstick, folder=self.folder, tick=tick)
        return {
            "rows": flown.rows,
            "summary": summary_of(flown, store),
            "complaint": flown.complaint,
            "source_hash": store.source_hash,
            "gl": dict(_core.gl_info()),
        }

    def compare_with_itself(self, task: Task, frames: Any, tick: Callable[[], Any]) -> list[dict[str, Any]]:
        """The rows of `noise.csv`: a finished run timed once more, against its rows in `frames`."""
        flight = task.flight
        views = list(self.path(flight).views(flight.size, flight.fov))
        _, again = timed(self.prepare(task), views, flight, tick=tick)
        first = frames[frames["run"] == flight.name]
        rows = []
        for i, column in enumerate(results.TIME_COLUMNS):
            found = statistics.ratio(first[column].to_numpy(float), again.times[:, :, i])
            ends = dict(zip(("ratio", "low", "high"), found, strict=True))
            rows.append({"run": flight.name, "column": column, **ends, "passes": flight.repeat})
        return rows


_workshop: Workshop | None = None


def _worker_start(
    folder: str, sources: Mapping[str, HeightField], stores: Path | None, device: str, threads: int
) -> None:
    """In a spawned process: leave Ctrl-C to the parent, and end with it."""
    global _workshop
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()

    def follow() -> None:
        connection.wait([parent.sentinel])
        os._exit(1)

    threading.Thread(target=follow, daemon=True).start()
    _core.set_thread_count(threads)
    if device:
        _core.choose_device(device)
    _workshop = Workshop(Path(folder), sources, False, stores)


def _worker_make(task: Task) -> dict[str, Any]:
    return _workshop.make(task, lambda: None)


def _frames_of(task: Task) -> int:
    flight = task.flight
    return flight.frames * flight.repeat + len(accuracy_indices(flight.frames, flight.accuracy_frames))


def _in_turn(tasks: Sequence[Task], workshop: Workshop, bar: Any) -> Iterator[tuple[Task, dict[str, Any]]]:
    for task in tasks:
        bar.set_postfix_str(task.flight.name)
        yield task, workshop.make(task, bar.update)


def _side_by_side(
    tasks: Sequence[Task], workshop: Workshop, bar: Any, jobs: int, device: str
) -> Iterator[tuple[Task, dict[str, Any]]]:
    """Runs in spawned processes, each with its own GL context, as they finish."""
    for task in tasks:  # builds use every core by themselves, and no two workers build the same store
        bar.set_postfix_str(f"store of {task.flight.name}")
        store = workshop.prepare(task)
        if task.flight.accuracy_frames and task.flight.metrics == "all":
            workshop.store_of(store.source, "full", look_of(store))
    bar.set_postfix_str(f"{jobs} jobs")
    in_memory = {name: source for name, source in workshop.sources.items() if not source.spec}
    before = set(multiprocessing.active_children())
    pool = ProcessPoolExecutor(
        max_workers=min(jobs, len(tasks)),
        mp_context=multiprocessing.get_context("spawn"),
        initializer=_worker_start,
        initargs=(
            os.fspath(workshop.folder),
            in_memory,
            workshop.stores,
            device,
            max(1, _core.thread_count() // jobs),
        ),
    )
    try:
        futures = {pool.submit(_worker_make, task): task for task in tasks}
        for future in as_completed(futures):
            task = futures[future]
            made = future.result()
            bar.update(_frames_of(task))
            yield task, made
        pool.shutdown()
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        for child in set(multiprocessing.active_children()) - before:
            child.terminate()
        raise


class _Owner:
    """A Sweep keeps it, and it keeps the folder of results that nobody asked to be written."""


class Sweep:
    """The results of a comparison or sweep.

    `frames`, `summary`: DataFrames (`frames.csv`, `summary.csv`); `noise`: that of `noise.csv` (one run timed
    twice), None where there is none; `directory`: where they lie on disk.
    """

    def __init__(self, directory: Path | None, frames: Any, summary: Any, noise: Any = None):
        self.directory = directory
        self.frames = frames
        self.summary = summary
        self.noise = noise
        self._keep: Any = None

    @classmethod
    def load(cls, directory: str | os.PathLike[str]) -> Sweep:
        """Reads a run directory."""
        folder = Path(directory)
        if not folder.is_dir():
            raise InvalidInput(f"read results: no directory {folder}")
        frames, summary = results.read_runs(folder)
        return cls(folder, frames, summary, results.read_noise(folder))

    @classmethod
    def of(cls, runs: Sequence[Run]) -> Sweep:
        """Runs made one by one, as one result."""
        import pandas as pd

        if not runs:
            raise InvalidInput("sweep: no runs")
        frames = pd.concat([run.frames for run in runs], ignore_index=True)
        return cls(None, frames, results.summary_table([run.summary for run in runs]))

    @property
    def runs(self) -> list[str]:
        """The names of the runs."""
        return self.summary["run"].tolist()

    def run(self, name: str) -> Run:
        """One run by its name."""
        if name not in self.runs:
            raise InvalidInput(f"run {name!r} is not here; there are {', '.join(self.runs)}")
        frames = self.frames[self.frames["run"] == name].reset_index(drop=True)
        row = self.summary[self.summary["run"] == name].iloc[0].to_dict()
        return Run(frames, row, self.directory)

    def __repr__(self) -> str:
        return f"<lodlab.Sweep of {len(self.runs)} runs{f' in {self.directory}' if self.directory else ''}>"

    def _repr_html_(self) -> str:
        from ..report.page import summary_table

        return f"<div>{html.escape(repr(self)[1:-1])}{summary_table(self.summary)}</div>"


def sweep(
    config: Any,
    *,
    out: str | os.PathLike[str] | None = None,
    jobs: int = 1,
    metrics: str | None = None,
    sources: Mapping[str, Any] | None = None,
    paths: Mapping[str, CameraPath] | None = None,
    stores: str | os.PathLike[str] | None = None,
    keep_mb: float = KEPT_MB,
    progress: bool = True,
) -> Sweep:
    """Makes every run of a configuration.

    `config`: a dict or TOML file as above; or a list of Run, which are put together. `out`: the run
    directory; a sweep that was stopped goes on where it stopped, and a directory's grid grows by more sources,
    paths, methods, options and budgets: what is done stays. What contradicts is refused: another number of frames,
    size and the like, a source, path or colour raster that has changed under its name. Without `out`, results live
    as long as the Sweep. `jobs`: spawned worker processes. `metrics`: all or geometry, instead of the
    configuration's. `sources`, `paths`: those in memory, by their names in the configuration; the directory keeps
    the paths, and sources of up to `keep_mb` (MiB), so that its `config.toml` is enough to fly it again. `stores`: a
    folder of stores to be reused, and where new ones go.

    Warns of every law that a run breaks (BrokenPromise), after the results are written.
    """
    from ..instrument.laws import tell_broken

    if isinstance(config, (list, tuple)):
        if not all(isinstance(run, Run) for run in config):
            raise InvalidInput("sweep: a list holds runs made by lodlab.fly; give a configuration as a dict or file")
        return Sweep.of(config)
    if jobs < 1:
        raise InvalidInput(f"sweep: jobs is {jobs}; it is at least 1")
    given = {name: as_source(value) for name, value in (sources or {}).items()}
    wanted = config if isinstance(config, Mapping) else results.read_config(config)
    frozen = freeze(wanted if metrics is None else {**wanted, "metrics": metrics})
    beside = None if isinstance(config, Mapping) else Path(config).parent
    if frozen["device"]:
        _core.choose_device(frozen["device"])
    owner = _Owner()
    with results.RunDirectory(disk.temporary_folder(owner) if out is None else out) as directory:
        workshop = Workshop(directory.path, given, progress, None if stores is None else Path(stores))
        frozen = _take_in(frozen, directory, workshop, paths or {}, beside)
        _check_tasks(plan(frozen), workshop)
        called = f"configuration{f' {config}' if beside else ''}"
        grown, tasks = enter(directory, frozen, lambda made: _hashes(made, workshop), called)
        for text in frozen["sources"]:
            keep_array(directory.path, text, workshop.source(text), keep_mb)
        _make_all(tasks, directory, workshop, jobs, grown, progress)
        result = Sweep.load(directory.path)
        if out is not None:
            from ..report.page import write

            write(directory.path)
        result._keep = owner
    tell_broken(result.frames)
    check_capture(result.frames)
    return result


def _take_in(
    config: Mapping[str, Any],
    directory: results.RunDirectory,
    workshop: Workshop,
    paths: Mapping[str, CameraPath],
    beside: Path | None,
) -> dict[str, Any]:
    """The configuration by names that hold in any folder: files by absolute names, key frames and what lies in memory
    as the copies that the run directory keeps. `beside`: the folder of a configuration file."""
    out = dict(config)
    texts = {}
    for text in config["sources"]:
        kept = kept_array(beside, text) if beside is not None and text not in workshop.sources else None
        if kept is not None:
            workshop.sources[text] = kept
        texts[text] = text if text in workshop.sources else _portable(text, workshop.source(text))
    out["sources"] = list(dict.fromkeys(texts.values()))
    out["hashes"] = [{**h, "name": texts.get(h["name"], h["name"])} for h in config["hashes"]]
    out["paths"] = []
    for text in config["paths"]:
        if text in paths:
            fields = [workshop.source(source) for source in config["sources"]]
            text = take_path(directory, paths[text], fields, tuple(config["size"]), config["fov"])
        elif text.lower().endswith((".toml", ".json")):
            inside = None if beside is None else beside / text
            file = inside if inside is not None and inside.is_file() else Path(text)
            text = keep_file(directory.path, file, directory.config is None)
        if text in out["paths"]:
            raise InvalidInput(f"configuration: two paths have the name {Path(text).stem}; give one of them another")
        out["paths"].append(text)
    return out


def _portable(text: str, field: HeightField) -> str:
    """A SOURCE text that holds in any folder; a data set's stays as it was written."""
    return field.spec if field.spec and parse(text).is_file else text


def _hashes(tasks: Sequence[Task], workshop: Workshop) -> list[dict[str, str]]:
    """What these runs rest on: sources, paths over them, colour rasters."""
    found: dict[tuple[str, str], str] = {}
    for task in sorted(tasks, key=lambda task: task.flight.source):
        flight = task.flight
        over = f"{flight.path} over {flight.source}"
        if ("path", over) not in found:
            found["source", flight.source] = workshop.source(flight.source).hash()
            found["path", over] = poses_hash(workshop.path(flight).views(flight.size, flight.fov))
        found |= rasters(task.build_options)
    return hash_list(found)


def _check_tasks(tasks: Sequence[Task], workshop: Workshop) -> None:
    """Finds mistakes before anything is built: sources, what methods accept, paths, views."""
    seen = set()
    for task in tasks:
        flight = task.flight
        source = workshop.source(flight.source)
        check_accepts(source, task.method)
        if (flight.source, flight.path) not in seen:
            seen.add((flight.source, flight.path))
            workshop.path(flight).view(0, flight.size, flight.fov)


def check_accepts(source: HeightField, method: str) -> None:
    """Unsupported when a method does not accept a source."""
    kind, accepted = source.kind, method_table(method)["accepts"]
    if kind not in accepted:
        raise Unsupported(f"method {method} does not accept a {kind}; it accepts {', '.join(accepted)}")


def _make_all(
    tasks: Sequence[Task],
    directory: results.RunDirectory,
    workshop: Workshop,
    jobs: int,
    config: Mapping[str, Any],
    progress: bool,
) -> None:
    from ..progress import tqdm

    order = [task.flight.name for task in tasks]
    said: set[str] = set()
    todo = [task for task in tasks if task.flight.name not in directory.done]
    directory.provenance(
        libraries=dict(_core.libraries()), options_hash=disk.short_hash(dict(config)), jobs=[jobs] if todo else []
    )  # fmt: skip
    noise = directory.path / "noise.csv"
    if todo:
        noise.unlink(missing_ok=True)
    twice = _timed_twice(tasks)
    again = 0 if noise.exists() else twice.flight.frames * twice.flight.repeat
    total = sum(map(_frames_of, tasks)) + again
    done = total - sum(map(_frames_of, todo)) - again
    shown = None if progress else True
    with tqdm(total=total, initial=done, desc="runs", unit="frame", disable=shown, leave=False) as bar:
        if not todo:
            made: Iterator[tuple[Task, dict[str, Any]]] = iter(())
        elif jobs == 1:
            made = _in_turn(todo, workshop, bar)
        else:
            made = _side_by_side(todo, workshop, bar, jobs, config["device"])
        with contextlib.closing(made) if hasattr(made, "close") else contextlib.nullcontext():
            for task, result in made:
                if (complaint := result["complaint"]) and complaint not in said:  # once for all methods
                    said.add(complaint)
                    warnings.warn(f"{task.flight.source}: {complaint}", stacklevel=4)
                directory.append(result["rows"], result["summary"])
                directory.provenance(
                    gl=result["gl"], libraries=dict(_core.libraries()),
                    sources={task.flight.source: result["source_hash"]},
                )  # fmt: skip
        directory.arrange(order)
        if not noise.exists():
            bar.set_postfix_str(f"{twice.flight.name} once more")
            frames = results.read_table(directory.path / "frames.csv")
            rows = workshop.compare_with_itself(twice, frames, bar.update)
            directory.write_noise([{**row, "jobs": jobs} for row in rows])


def _timed_twice(tasks: Sequence[Task]) -> Task:
    """The run of the null comparison: the first with a budget, so that whatever drifts has drifted when it is
    timed again at the end."""
    return next((task for task in tasks if task.flight.budget), tasks[0])


def _several(values: Any) -> list[Any]:
    """One value or several, as a list."""
    return [values] if isinstance(values, str) or not hasattr(values, "__iter__") else list(values)


def compare(
    source: Any,
    *,
    methods: Sequence[str] | None = None,
    pixel_errors: Sequence[float] | None = None,
    triangles: Sequence[int] | None = None,
    nodes: Sequence[int] | None = None,
    options: Mapping[str, Mapping[str, Any]] | None = None,
    path: Any = "flyover",
    frames: int = 120,
    size: tuple[int, int] = (1280, 720),
    fov: float | None = None,
    accuracy_frames: int = 12,
    repeat: int = 1,
    images: str = "worst",
    metrics: str = "all",
    device: str | None = None,
    out: str | os.PathLike[str] | None = None,
    jobs: int = 1,
    stores: str | os.PathLike[str] | None = None,
    keep_mb: float = KEPT_MB,
    progress: bool = True,
) -> Sweep:
    """Every method that accepts the source, and `full`, over a grid of budgets.

    `source`: SOURCE text, HeightField or 2-D array. Budgets default to pixel errors 0.5, 1, 2, 4, 8; where
    several kinds are given, every combination is flown, and methods that lack one of them are left out unless
    named in `methods` (then Unsupported). `options`: per method, build and draw options; a list is a grid.
    Other parameters as `lodlab.fly` and `lodlab.sweep`.
    """
    field = as_source(source)
    name = field.spec or f"array:{field.hash()[:8]}"
    budgets = {"pixel_errors": pixel_errors, "triangles": triangles, "nodes": nodes}
    chosen = {k: _several(v) for k, v in budgets.items() if v is not None and _several(v)}
    chosen = chosen or {"pixel_errors": list(DEFAULT_PIXEL_ERRORS)}
    methods = None if methods is None else _several(methods)
    if methods is None:
        wanted = [BUDGET_LISTS[key] for key in chosen]
        methods = [
            m["name"]
            for m in _core.methods()
            if field.kind in m["accepts"] and (not m["budgets"] or set(wanted) <= set(m["budgets"]))
        ]
    elif "full" not in methods:
        methods = ["full", *methods]
    for method in options or {}:
        if method not in methods:
            raise InvalidInput(f"compare: options for {method!r}, which is not compared ({', '.join(methods)} are)")
    config = {
        "sources": [name],
        "paths": [path_text(path)],
        "frames": len(path) if isinstance(path, CameraPath) else frames,
        "size": size,
        "fov": path.fov if fov is None and isinstance(path, CameraPath) else fov,
        "accuracy_frames": accuracy_frames,
        "repeat": repeat,
        "images": images,
        "metrics": metrics,
        "device": device or "",
        **chosen,
        "methods": [{"name": m, "options": dict((options or {}).get(m, {}))} for m in methods],
    }
    paths = {path.name: path} if isinstance(path, CameraPath) else {}
    return sweep(
        config, out=out, jobs=jobs, sources={name: field}, paths=paths, stores=stores, keep_mb=keep_mb,
        progress=progress,
    )  # fmt: skip
