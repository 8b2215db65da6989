# SPDX-License-Identifier: MIT
"""The runs of a configuration, made one after the other or in spawned workers, into a run directory. A sweep that was
stopped goes on where it stopped."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import threading
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import replace
from multiprocessing import connection
from pathlib import Path
from typing import Any

from .. import _core
from ..disk import rasters, short_hash
from ..errors import InvalidInput
from ..instrument import statistics
from ..instrument.yardstick import Yardstick, look_of
from ..paths.path import NAMES, CameraPath, default_path, joined, label_of, make_path, of_keys, poses_hash
from ..sources.base import Source
from ..sources.datasets import DATASETS
from ..sources.spec import parse
from ..stores.build import store_for
from ..stores.methods import check_accepts, check_deforms
from ..stores.store import Store
from . import tables
from .configs import Task, enter, flight_config
from .directory import RunDirectory
from .flight import Flight
from .identity import (
    KEPT_MB,
    hash_list,
    keep_array,
    keep_deform,
    keep_file,
    keep_parts,
    kept_array,
    path_in,
    source_in,
    take_path,
)
from .passes import accuracy_indices, perform, summary_of, timed


class Workshop:
    """Makes runs, one after the other; keeps the source, its yardstick and its stores between them. `stores`: the
    user's own folder of stores, or None for the run directory's."""

    def __init__(self, folder: Path, sources: Mapping[str, Source], progress: bool, stores: Path | None = None):
        self.folder = folder
        self.sources = dict(sources)
        self.stores = stores
        self._shelf = (folder / "stores" if stores is None else stores, stores is not None)  # and: the user's own
        self._progress = progress
        self._name: str | None = None
        self._source: Source | None = None
        self._yardsticks: dict[str, Yardstick] = {}

    def path_of(self, names: Iterable[str]) -> str:
        """The path of sources for which none is named: their own, and the orbit, which all have, where those differ."""
        own = {default_path(self.source(name).kind) for name in names}
        return own.pop() if len(own) == 1 else "orbit"

    def source(self, name: str) -> Source:
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

    def store_of(self, source: Source, method: str, options: Mapping[str, Any]) -> Store:
        """A store, built when it is not there."""
        folder, named = self._shelf
        return store_for(source, method, options, folder, progress=self._progress, named=named)

    def prepare(self, task: Task) -> Store:
        """The store of a task, built when it is not there."""
        return self.store_of(self.source(task.flight.source), task.method, task.build_options)

    def yardstick(self, store: Store, metrics: str) -> Yardstick:
        """What a store's cuts are measured against; one for all stores that look alike."""
        look = look_of(store)
        key = tables.options_text(look)
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
        _, again = timed(self.prepare(task), self.path(flight), flight, tick=tick)
        first = frames[frames["run"] == flight.name]
        rows = []
        for i, column in enumerate(tables.TIME_COLUMNS):
            found = statistics.ratio(first[column].to_numpy(float), again.times[:, :, i])
            ends = dict(zip(("ratio", "low", "high"), found, strict=True))
            rows.append({"run": flight.name, "column": column, **ends, "passes": flight.repeat})
        return rows


_workshop: Workshop | None = None  # of a worker process


def _worker_start(folder: str, sources: Mapping[str, Source], stores: Path | None, device: str, threads: int) -> None:
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


def take_in(
    config: Mapping[str, Any],
    directory: RunDirectory,
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
        else:
            text = keep_parts(directory, text, beside)
        if text in out["paths"]:
            name = "+".join(filter(None, label_of(text)))
            raise InvalidInput(f"configuration: two paths have the name {name}; give one of them another")
        out["paths"].append(text)
    return out


def _portable(text: str, field: Source) -> str:
    """A SOURCE text that holds in any folder; a data set's stays as it was written."""
    return field.spec if field.spec and parse(text, DATASETS).is_file else text


def hashes_of(tasks: Sequence[Task], workshop: Workshop) -> list[dict[str, str]]:
    """What these runs rest on: sources, paths over them, colour rasters."""
    found: dict[tuple[str, str], str] = {}
    for task in sorted(tasks, key=lambda task: task.flight.source):
        flight = task.flight
        over = f"{flight.path} over {flight.source}"
        if ("path", over) not in found:
            found["source", flight.source] = workshop.source(flight.source).hash()
            track = workshop.path(flight)
            found["path", over] = poses_hash(track.views(flight.size, flight.fov), track.deform)
        found |= rasters(task.build_options)
    return hash_list(found)


def check_tasks(tasks: Sequence[Task], workshop: Workshop) -> None:
    """Finds mistakes before anything is built: sources, what methods accept, paths, views."""
    accepted: set[tuple[str, str]] = set()
    tracks: dict[tuple[str, str], CameraPath] = {}
    for task in tasks:
        flight = task.flight
        source = workshop.source(flight.source)
        if (flight.source, task.method) not in accepted:
            check_accepts(source, task.method)
            accepted.add((flight.source, task.method))
        key = (flight.source, flight.path)
        if key not in tracks:
            tracks[key] = workshop.path(flight)
            tracks[key].view(0, flight.size, flight.fov)
        if tracks[key].deform is not None:
            check_deforms(task.method, tracks[key].name)


def make_all(
    tasks: Sequence[Task],
    directory: RunDirectory,
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
        libraries=dict(_core.libraries()), options_hash=short_hash(dict(config)), jobs=[jobs] if todo else []
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
            frames = tables.read_table(directory.path / "frames.csv")
            rows = workshop.compare_with_itself(twice, frames, bar.update)
            directory.write_noise([{**row, "jobs": jobs} for row in rows])


def _timed_twice(tasks: Sequence[Task]) -> Task:
    """The run of the null comparison: the first with a budget, so that whatever drifts has drifted when it is
    timed again at the end."""
    return next((task for task in tasks if task.flight.budget), tasks[0])


def enter_flight(
    directory: RunDirectory, store: Store, track: CameraPath, flight: Flight, device: str | None
) -> Flight:
    """The flight under the names that the directory has for it, which keeps what it rests on."""
    field = store._source  # at hand, or not needed
    fresh, camera = directory.config is None, track.with_deform(None).name
    text = flight.path if track.deform is None else flight.path.removesuffix(f"+{track.deform.name}")
    if of_keys(text) and camera == Path(text).stem:
        path = joined(keep_file(directory.path, Path(text), fresh), keep_deform(directory.path, track.deform, fresh))
    elif text in NAMES and field is None:
        # by its name, or like it: there is nothing to compare it over
        path = joined(text, keep_deform(directory.path, track.deform, fresh))
    else:
        path = take_path(directory, track, [] if field is None else [field], flight.size, flight.fov)
    flight = replace(flight, path=path)
    found = {
        ("source", flight.source): store.source_hash,
        ("path", f"{path} over {flight.source}"): poses_hash(track.views(flight.size, flight.fov), track.deform),
        **rasters(store.options),
    }
    _, tasks = enter(directory, flight_config(store, flight, device), lambda _: hash_list(found))
    if field is not None:
        keep_array(directory.path, flight.source, field, KEPT_MB)
    key = Task(flight, store.method, store.options).key
    return next(task.flight for task in tasks if task.key == key)
