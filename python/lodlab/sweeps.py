# SPDX-License-Identifier: MIT
"""Sweeps: runs over a grid of sources, paths, methods, options and budgets, in one run directory.

A configuration (a TOML file, or a dict of the same shape):

    sources = ["jacksboro"]          # SOURCE texts
    paths = ["flyover"]              # built-in names or key-frame files
    frames = 120                     # per path
    size = [1280, 720]               # pixels
    fov = 60.0                       # horizontal, degrees; left out: key-frame files' own, or 60
    accuracy_frames = 12             # measured frames, evenly spaced
    repeat = 1                       # timing passes
    images = "worst"                 # all | worst | none
    device = ""                      # "": LODLAB_DEVICE or auto
    pixel_errors = [0.5, 1, 2]       # budgets, for every method that has none of its own;
    triangles = []                   # where several kinds are given, every combination
    nodes = []

    [[methods]]
    name = "chunked"
    pixel_errors = [1]               # optional: this method's own budgets
    options = { morph = ["true", "formula4"], finest_error = 0.0 }   # a list is a grid

Methods that ignore budgets (`full`) make one run per path. Every default is written out in `config.toml`.
"""

from __future__ import annotations

import contextlib
import html
import itertools
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from multiprocessing import connection
from pathlib import Path
from typing import Any

from . import _core, results
from .errors import InvalidInput, Unsupported
from .heightfield import HeightField
from .paths import DEFAULT_FOV, CameraPath
from .runs import (
    Flight,
    Run,
    Yardstick,
    accuracy_indices,
    budget_text,
    check_budget,
    check_capture,
    make_path,
    path_text,
    perform,
    run_name,
    store_for,
)
from .sources import as_source
from .stores import Store, method_table, options_of

BUDGET_LISTS = {"pixel_errors": "pixel_error", "triangles": "triangles", "nodes": "nodes"}
DEFAULTS: dict[str, Any] = {
    "sources": [],
    "paths": ["flyover"],
    "frames": 120,
    "size": [1280, 720],
    "fov": None,
    "accuracy_frames": 12,
    "repeat": 1,
    "images": "worst",
    "device": "",
    "pixel_errors": [],
    "triangles": [],
    "nodes": [],
    "methods": [],
}
DEFAULT_PIXEL_ERRORS = (0.5, 1.0, 2.0, 4.0, 8.0)
_KINDS = {"frames": int, "fov": float, "accuracy_frames": int, "repeat": int, "images": str, "device": str}


# ---- configuration --------------------------------------------------------------------------------


def freeze(config: Mapping[str, Any]) -> dict[str, Any]:
    """A configuration with every default written out and every value checked.

    InvalidInput names an unknown key, method or option (listing the known ones) or a value out of range;
    Unsupported a budget that a method does not have.
    """
    _known("configuration", config, DEFAULTS)
    out: dict[str, Any] = {**DEFAULTS, **config}
    for key, kind in _KINDS.items():
        if out[key] is not None or key != "fov":
            out[key] = _typed(key, out[key], kind)
    for key in ("sources", "paths"):
        out[key] = _texts(key, out[key])
    if out["fov"] is None and not any(p.endswith((".toml", ".json")) for p in out["paths"]):
        out["fov"] = DEFAULT_FOV
    if not (isinstance(out["size"], (list, tuple)) and len(out["size"]) == 2):
        raise InvalidInput(f"configuration: size is {out['size']!r}; it is [width, height] in pixels")
    out["size"] = [_typed("size", v, int) for v in out["size"]]
    Flight(
        "", "", "", {}, {}, out["frames"], images=out["images"], accuracy_frames=out["accuracy_frames"],
        repeat=out["repeat"],
    ).check()  # fmt: skip
    common = {key: _budgets(key, out.pop(key)) for key in BUDGET_LISTS}
    if not isinstance(out["methods"], list) or not out["methods"]:
        raise InvalidInput("configuration: no methods; give at least one [[methods]] with a name")
    out["methods"] = [_freeze_method(m, common) for m in out["methods"]]
    return out


def _freeze_method(given: Mapping[str, Any] | str, common: Mapping[str, list[Any]]) -> dict[str, Any]:
    given = {"name": given} if isinstance(given, str) else given
    _known("[[methods]]", given, {"name": "", "options": {}, **BUDGET_LISTS})
    if "name" not in given:
        raise InvalidInput("configuration: a [[methods]] has no name")
    table = method_table(given["name"])
    own = {key: _budgets(key, given[key]) for key in BUDGET_LISTS if key in given}
    budgets = own if any(own.values()) else dict(common)
    if not table["budgets"]:
        budgets = {}
    method: dict[str, Any] = {"name": given["name"], **{k: v for k, v in budgets.items() if v}}
    for budget in _budget_grid(method):
        check_budget(method["name"], budget)
    method["options"] = _freeze_options(given["name"], given.get("options", {}))
    return method


def _freeze_options(method: str, given: Mapping[str, Any]) -> dict[str, Any]:
    """All options of a method, defaults written out; lists stay lists. Sweeps load everything first."""
    build, draw = options_of(method, "build"), options_of(method, "draw")
    given = {"stream": False, **given} if "stream" in draw else dict(given)
    for name in given:
        if name not in build and name not in draw:
            known = ", ".join(build + draw) or "none"
            raise InvalidInput(f"options of {method}: no option {name!r}; it has {known}")
    out: dict[str, Any] = {}
    for stage, names in (("build", build), ("draw", draw)):
        out.update(_core.resolve_options(method, stage, {}))
        for name in (n for n in names if n in given):
            values = given[name] if isinstance(given[name], (list, tuple)) else [given[name]]
            if not values:
                raise InvalidInput(f"options of {method}: {name} is an empty list")
            checked = [_core.resolve_options(method, stage, {name: v})[name] for v in values]
            out[name] = checked if len(checked) > 1 else checked[0]
    return dict(sorted(out.items()))


def _known(where: str, given: Mapping[str, Any], known: Mapping[str, Any]) -> None:
    for key in given:
        if key not in known:
            raise InvalidInput(f"{where}: no key {key!r}; it has {', '.join(known)}")


def _typed(key: str, value: Any, kind: type) -> Any:
    fits = isinstance(value, (int, float) if kind is float else kind) and not isinstance(value, bool)
    if not fits:
        raise InvalidInput(f"configuration: {key} is {value!r}; it is {kind.__name__}")
    return kind(value)


def _texts(key: str, values: Any) -> list[str]:
    values = [values] if isinstance(values, str) else list(values)
    if not values or not all(isinstance(v, str) and v for v in values):
        raise InvalidInput(f"configuration: {key} is {values!r}; it is a list of at least one text")
    if len(set(values)) != len(values):
        raise InvalidInput(f"configuration: {key} names one twice: {', '.join(values)}")
    return values


def _budgets(key: str, values: Any) -> list[Any]:
    kind = float if key == "pixel_errors" else int
    values = list(values) if isinstance(values, (list, tuple)) else [values]
    out = [_typed(key, v, kind) for v in values]
    for value in out:
        if not value > 0:
            raise InvalidInput(f"configuration: {key} holds {value}; a budget is above 0")
    return out


def _budget_grid(method: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """Every combination of a method's budget lists."""
    lists = [[(name, v) for v in method[key]] for key, name in BUDGET_LISTS.items() if method.get(key)]
    for values in itertools.product(*lists):
        yield dict(values)


def flight_config(store: Store, flight: Flight, device: str | None) -> dict[str, Any]:
    """The configuration of a single run, in the schema of sweeps."""
    budget = flight.budget if method_table(store.method)["budgets"] else {}
    lists = {key: [budget[name]] for key, name in BUDGET_LISTS.items() if name in budget}
    return {
        "sources": [flight.source],
        "paths": [flight.path],
        "frames": flight.frames,
        "size": list(flight.size),
        "fov": flight.fov,
        "accuracy_frames": flight.accuracy_frames,
        "repeat": flight.repeat,
        "images": flight.images,
        "device": device or "",
        "methods": [
            {
                "name": store.method,
                **lists,
                "options": dict(sorted({**store.options, **flight.options}.items())),
            }
        ],
    }


# ---- the plan -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Task:
    """A flight and the store that it needs."""

    flight: Flight
    method: str
    build_options: dict[str, Any]


def plan(config: Mapping[str, Any]) -> list[Task]:
    """The runs of a frozen configuration, in order, with readable names that differ."""
    grid = []
    for source, path, method in itertools.product(config["sources"], config["paths"], config["methods"]):
        options = method["options"]
        names = list(options)
        for values in itertools.product(*(v if isinstance(v, list) else [v] for v in options.values())):
            chosen = dict(zip(names, values, strict=True))
            for budget in _budget_grid(method):
                grid.append((source, path, method["name"], chosen, budget))
    seen: dict[tuple[str, str], set[str]] = {}
    for _, _, name, chosen, _ in grid:
        for option, value in chosen.items():
            seen.setdefault((name, option), set()).add(results.options_text({"": value}))
    tasks, names_used = [], set()
    for source, path, method, chosen, budget in grid:
        varied = [f"{k}={results.cell(v)}" for k, v in chosen.items() if len(seen[method, k]) > 1]
        many = [v for v, several in ((source, config["sources"]), (Path(path).stem, config["paths"])) if several[1:]]
        name = run_name(*many, method, *varied, budget_text(budget))
        unique, n = name, 2
        while unique in names_used:
            unique, n = f"{name}_{n}", n + 1
        names_used.add(unique)
        draw = {k: chosen[k] for k in options_of(method, "draw")}
        flight = Flight(
            unique, source, path, budget, draw, config["frames"], tuple(config["size"]), config["fov"],
            config["accuracy_frames"], config["repeat"], config["images"],
        )  # fmt: skip
        tasks.append(Task(flight, method, {k: chosen[k] for k in options_of(method, "build")}))
    return tasks


# ---- doing it -------------------------------------------------------------------------------------


class Workshop:
    """Makes runs, one after the other; keeps the source, its yardstick and its stores between them."""

    def __init__(
        self, folder: Path, sources: Mapping[str, HeightField], paths: Mapping[str, CameraPath], progress: bool
    ):
        self.folder = folder
        self.sources = dict(sources)
        self._paths = dict(paths)
        self._progress = progress
        self._name: str | None = None
        self._source: HeightField | None = None
        self._yardstick: Yardstick | None = None

    def source(self, name: str) -> HeightField:
        """The source of a task, loaded once while tasks of the same source follow each other."""
        if self._name != name or self._source is None:
            self._yardstick = None
            self._source = self.sources[name] if name in self.sources else as_source(name)
            self._name = name
        return self._source

    def path(self, flight: Flight) -> CameraPath:
        """The path of a task."""
        named = self._paths.get(flight.path, flight.path)
        return make_path(named, self.source(flight.source), flight.frames, flight.fov)

    def prepare(self, task: Task) -> Store:
        """The store of a task, built when it is not there."""
        source = self.source(task.flight.source)
        stores = self.folder / "stores"
        return store_for(source, task.method, task.build_options, stores, progress=self._progress)

    def make(self, task: Task, tick: Callable[[], Any]) -> dict[str, Any]:
        """One run: its rows, and what the provenance wants to know."""
        store = self.prepare(task)
        flight = task.flight
        if self._yardstick is None:
            self._yardstick = Yardstick(store.source, self.folder / "stores", self._progress)
        flown = perform(store, self.path(flight), flight, yardstick=self._yardstick, folder=self.folder, tick=tick)
        return {
            "rows": flown.rows,
            "summary": results.summarize(flown.rows, store_bytes=store.bytes, build_seconds=store.build_seconds),
            "source_hash": store.source_hash,
            "gl": dict(_core.gl_info()),
        }


_workshop: Workshop | None = None


def _worker_start(folder: str, sources: Mapping[str, HeightField], device: str, threads: int) -> None:
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
    _workshop = Workshop(Path(folder), sources, {}, progress=False)


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
        workshop.prepare(task)
        if task.flight.accuracy_frames and "full" != task.method:
            full = _core.resolve_options("full", "build", {})
            store_for(workshop.source(task.flight.source), "full", full, workshop.folder / "stores", progress=False)
    bar.set_postfix_str(f"{jobs} jobs")
    in_memory = {name: source for name, source in workshop.sources.items() if not source.spec}
    before = set(multiprocessing.active_children())
    pool = ProcessPoolExecutor(
        max_workers=min(jobs, len(tasks)),
        mp_context=multiprocessing.get_context("spawn"),
        initializer=_worker_start,
        initargs=(os.fspath(workshop.folder), in_memory, device, max(1, _core.thread_count() // jobs)),
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

    `frames`, `summary`: DataFrames (`frames.csv`, `summary.csv`); `directory`: where they lie on disk.
    """

    def __init__(self, directory: Path | None, frames: Any, summary: Any, keep: Any = None):
        self.directory = directory
        self.frames = frames
        self.summary = summary
        self._keep = keep

    @classmethod
    def load(cls, directory: str | os.PathLike[str]) -> Sweep:
        """Reads a run directory."""
        folder = Path(directory)
        if not folder.is_dir():
            raise InvalidInput(f"read results: no directory {folder}")
        return cls(folder, results.read_table(folder / "frames.csv"), results.read_table(folder / "summary.csv"))

    @classmethod
    def of(cls, runs: Sequence[Run]) -> Sweep:
        """Runs made one by one, as one result."""
        import pandas as pd

        if not runs:
            raise InvalidInput("sweep: no runs")
        frames = pd.concat([run.frames for run in runs], ignore_index=True)
        return cls(None, frames, pd.DataFrame([run.summary for run in runs]))

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
        from .report import summary_table

        return f"<div>{html.escape(repr(self)[1:-1])}{summary_table(self.summary)}</div>"


def sweep(
    config: Any,
    *,
    out: str | os.PathLike[str] | None = None,
    jobs: int = 1,
    sources: Mapping[str, Any] | None = None,
    paths: Mapping[str, CameraPath] | None = None,
    progress: bool = True,
) -> Sweep:
    """Makes every run of a configuration.

    `config`: a dict or TOML file as above; or a list of Run, which are put together. `out`: the run
    directory; a sweep that was stopped goes on where it stopped, another configuration in it is refused;
    without it, results live as long as the Sweep. `jobs`: spawned worker processes. `sources`,
    `paths`: those in memory, by their names in the configuration.
    """
    if isinstance(config, (list, tuple)):
        if not all(isinstance(run, Run) for run in config):
            raise InvalidInput("sweep: a list holds runs made by lodlab.fly; give a configuration as a dict or file")
        return Sweep.of(config)
    if jobs < 1:
        raise InvalidInput(f"sweep: jobs is {jobs}; it is at least 1")
    if jobs > 1 and paths:
        raise InvalidInput(f"sweep: jobs is {jobs}, but path {next(iter(paths))!r} is in memory; save it to a file")
    given = {name: as_source(value) for name, value in (sources or {}).items()}
    frozen = freeze(config if isinstance(config, Mapping) else results.read_config(config))
    if frozen["device"]:
        _core.choose_device(frozen["device"])
    tasks = plan(frozen)
    owner = _Owner()
    with results.RunDirectory(results.temporary_folder(owner) if out is None else out, frozen) as directory:
        workshop = Workshop(directory.path, given, paths or {}, progress)
        _check_tasks(tasks, workshop)
        _make_all(tasks, directory, workshop, jobs, frozen, progress)
        result = Sweep.load(directory.path)
        if out is not None:
            from .report import write

            write(directory.path)
        result._keep = owner
    check_capture(result.frames)
    return result


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
    kind, accepted = kind_of(source), method_table(method)["accepts"]
    if kind not in accepted:
        raise Unsupported(f"method {method} does not accept a {kind}; it accepts {', '.join(accepted)}")


def kind_of(source: HeightField) -> str:
    """What a method's `accepts` calls this source."""
    return "planet" if source.planet else "heightfield"


def _make_all(
    tasks: Sequence[Task],
    directory: results.RunDirectory,
    workshop: Workshop,
    jobs: int,
    config: Mapping[str, Any],
    progress: bool,
) -> None:
    from tqdm.auto import tqdm

    order = [task.flight.name for task in tasks]
    todo = [task for task in tasks if task.flight.name not in directory.done]
    directory.provenance(libraries=dict(_core.libraries()), options_hash=results.short_hash(dict(config)))
    total, done = sum(map(_frames_of, tasks)), sum(map(_frames_of, tasks)) - sum(map(_frames_of, todo))
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
                directory.append(result["rows"], result["summary"])
                directory.provenance(
                    gl=result["gl"], libraries=dict(_core.libraries()),
                    sources={task.flight.source: result["source_hash"]},
                )  # fmt: skip
    directory.arrange(order)


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
    device: str | None = None,
    out: str | os.PathLike[str] | None = None,
    jobs: int = 1,
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
    chosen = {k: list(v) for k, v in budgets.items() if v is not None and len(v)}
    chosen = chosen or {"pixel_errors": list(DEFAULT_PIXEL_ERRORS)}
    if methods is None:
        wanted = [BUDGET_LISTS[key] for key in chosen]
        methods = [
            m["name"]
            for m in _core.methods()
            if kind_of(field) in m["accepts"] and (not m["budgets"] or set(wanted) <= set(m["budgets"]))
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
        "size": list(size),
        "fov": fov,
        "accuracy_frames": accuracy_frames,
        "repeat": repeat,
        "images": images,
        "device": device or "",
        **chosen,
        "methods": [{"name": m, "options": dict((options or {}).get(m, {}))} for m in methods],
    }
    paths = {path.name: path} if isinstance(path, CameraPath) else {}
    return sweep(config, out=out, jobs=jobs, sources={name: field}, paths=paths, progress=progress)
