# SPDX-License-Identifier: MIT
"""What people do in the laboratory: fly a store, sweep a grid, compare methods, fit a store to a path. Runs of the
room `runs`, with their report, and a warning of every law that they break."""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from . import _core
from .disk import short_hash, temporary_folder
from .errors import InvalidInput
from .instrument.laws import tell_broken
from .instrument.yardstick import Yardstick, look_of
from .paths.path import CameraPath, joined, make_path, named_or_default, over_source, parts_of, path_text
from .report.page import write
from .runs import tables
from .runs.configs import BUDGET_LISTS, DEFAULT_PIXEL_ERRORS, enter, freeze, plan
from .runs.directory import RunDirectory
from .runs.fitting import Fit, check_out, search
from .runs.flight import Flight, budget_of, budget_text, check_budget, run_name
from .runs.identity import KEPT_MB, keep_array
from .runs.passes import accuracy_indices, check_capture, perform, summary_of
from .runs.run import Run, load
from .runs.sweep import Sweep
from .runs.toml import read_config
from .runs.workshop import Workshop, check_tasks, enter_flight, hashes_of, make_all, take_in
from .sources.datasets import as_source
from .stores.methods import check_deforms, lacking, method_table
from .stores.store import Store, as_store

__all__ = ["compare", "fit", "fly", "sweep"]


def fly(
    store: Store | str | os.PathLike[str],
    path: Any = "",
    budget: Any = None,
    *,
    size: tuple[int, int] = (1280, 720),
    frames: int = 120,
    fov: float | None = None,
    accuracy_frames: int = 12,
    repeat: int = 1,
    images: str | None = None,
    metrics: str = "all",
    deform: Any = None,
    out: str | os.PathLike[str] | None = None,
    stores: str | os.PathLike[str] | None = None,
    device: str | None = None,
    source: Any = None,
    progress: bool = True,
    **options: Any,
) -> Run:
    """Flies a store (or the file of one) along a path under a budget and measures it; without a path the flyover of
    fields, the orbit of meshes.

    `path`: a CameraPath, a built-in name or a key-frame file (`frames` and `fov`, degrees, are for names and
    files). `budget`: lodlab.Budget or a dict. `size`: pixels. `accuracy_frames`: how many evenly spaced frames are
    measured; 0 needs no source. `repeat`: timing passes. `images`: all, worst or none (default worst with `out`,
    else none). `metrics`: all, or geometry, for which no picture is drawn to measure (columns that need one are
    nan, and whether the capture is what was drawn is not looked at). `deform`: what deforms the mesh on the way, in
    place of the path's own (`CameraPath.with_deform`); it is measured against the source deformed alike. `out`: run
    directory; `stores`: a folder of stores to be reused, for the reference (by default the run directory's).
    `options`: the method's draw options.

    Raises InvalidInput and Unsupported for what the user got wrong, CaptureMismatch (after the results are
    written) when a capture was not what was drawn. Warns of every law that the rows break (BrokenPromise), after the
    results are written. A directory that holds this very run already is read; one of other runs grows by it, unless
    they contradict (`lodlab.sweep`).
    """
    from .progress import tqdm

    store = as_store(store)
    if source is not None:
        store.attach(as_source(source))
    if device:
        _core.choose_device(device)
    if images not in (None, "none") and out is None:
        raise InvalidInput(f"fly: images={images!r} needs a run directory (out=)")
    path = named_or_default(path, store.source_kind)
    track = make_path(path, store.source if over_source(path) else None, frames, fov)
    if deform is not None:
        track = track.with_deform(deform)
    if track.deform is not None:
        check_deforms(store.method, track.name)
        track = track.with_deform(track.deform.sampled(store.control_positions, len(track)))
    moved = "" if track.deform is None else track.deform.name
    camera = track.with_deform(None).name if isinstance(path, CameraPath) else parts_of(path_text(path))[0]
    limits = budget_text(budget_of(budget)) if method_table(store.method)["budgets"] else ""
    flight = Flight(
        name=run_name(moved, store.method, limits),
        source=store.source_spec or f"array:{store.source_hash[:8]}",
        path=joined(camera, moved),
        budget=budget_of(budget),
        options=_core.resolve_options(store.method, "draw", options),
        frames=len(track),
        size=track.view(0, size, fov).size,
        fov=fov,
        accuracy_frames=accuracy_frames,
        repeat=repeat,
        images=images or ("none" if out is None else "worst"),
        metrics=metrics,
    )
    flight.check()
    check_budget(store.method, flight.budget)
    yardstick = None
    if accuracy_frames > 0:
        folder = Path(stores) if stores is not None else Path(out) / "stores" if out is not None else None
        yardstick = Yardstick(store.source, folder, progress, look_of(store), metrics, stores is not None)

    total = len(track) * repeat + len(accuracy_indices(len(track), accuracy_frames))
    with tqdm(total=total, desc=flight.name, unit="frame", disable=None if progress else True, leave=False) as bar:
        if out is None:
            flown = perform(store, track, flight, yardstick=yardstick, tick=bar.update)
            summary = summary_of(flown, store)
        else:
            with RunDirectory(out) as directory:
                flight = enter_flight(directory, store, track, flight, device)
                if flight.name in directory.done:
                    run = load(directory.path, flight.name)
                    tell_broken(run.frames)
                    return run
                directory.provenance(gl=_core.gl_info(), libraries=_core.libraries(), jobs=[1])
                flown = perform(store, track, flight, yardstick=yardstick, folder=directory.path, tick=bar.update)
                summary = summary_of(flown, store)
                directory.append(flown.rows, summary)
                directory.provenance(
                    sources={flight.source: store.source_hash},
                    options_hash=short_hash({"options": flown.rows[0]["options"]}),
                )
                write(directory.path)
    if flown.complaint:
        warnings.warn(flown.complaint, stacklevel=2)
    run = Run(tables.table(flown.rows, tables.FRAME_COLUMNS), summary, Path(out) if out is not None else None, flown)
    tell_broken(run.frames)
    check_capture(run.frames)
    return run


class _Owner:
    """A Sweep keeps it, and it keeps the folder of results that nobody asked to be written."""


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

    `config`: a dict or TOML file (its keys: `runs.configs`); or a list of Run, which are put together. `out`: the run
    directory; a sweep that was stopped goes on where it stopped, and a directory's grid grows by more sources,
    paths, methods, options and budgets: what is done stays. What contradicts is refused: another number of frames,
    size and the like, a source, path or colour raster that has changed under its name. Without `out`, results live
    as long as the Sweep. `jobs`: spawned worker processes. `metrics`: all or geometry, instead of the
    configuration's. `sources`, `paths`: those in memory, by their names in the configuration; the directory keeps
    the paths, and sources of up to `keep_mb` (MiB), so that its `config.toml` is enough to fly it again. `stores`: a
    folder of stores to be reused, and where new ones go.

    Warns of every law that a run breaks (BrokenPromise), after the results are written.
    """
    if isinstance(config, (list, tuple)):
        if not all(isinstance(run, Run) for run in config):
            raise InvalidInput("sweep: a list holds runs made by lodlab.fly; give a configuration as a dict or file")
        return Sweep.of(config)
    if jobs < 1:
        raise InvalidInput(f"sweep: jobs is {jobs}; it is at least 1")
    given = {name: as_source(value) for name, value in (sources or {}).items()}
    wanted = config if isinstance(config, Mapping) else read_config(config)
    frozen = freeze(wanted if metrics is None else {**wanted, "metrics": metrics})
    beside = None if isinstance(config, Mapping) else Path(config).parent
    if frozen["device"]:
        _core.choose_device(frozen["device"])
    owner = _Owner()
    with RunDirectory(temporary_folder(owner) if out is None else out) as directory:
        workshop = Workshop(directory.path, given, progress, None if stores is None else Path(stores))
        if "paths" not in wanted:
            frozen["paths"] = [workshop.path_of(frozen["sources"])]
        frozen = take_in(frozen, directory, workshop, paths or {}, beside)
        check_tasks(plan(frozen), workshop)
        called = f"configuration{f' {config}' if beside else ''}"
        grown, tasks = enter(directory, frozen, lambda made: hashes_of(made, workshop), called)
        for text in frozen["sources"]:
            keep_array(directory.path, text, workshop.source(text), keep_mb)
        make_all(tasks, directory, workshop, jobs, grown, progress)
        result = Sweep.load(directory.path)
        if out is not None:
            write(directory.path)
        result._keep = owner
    tell_broken(result.frames)
    check_capture(result.frames)
    return result


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
    path: Any = "",
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
    """Every method that accepts the source, and `full`, over a grid of budgets. Methods that need what a mesh lacks
    are left out, and a warning says so with counts.

    `source`: SOURCE text, HeightField or 2-D array. Budgets default to pixel errors 0.5, 1, 2, 4, 8; where
    several kinds are given, every combination is flown, and methods that lack one of them are left out unless
    named in `methods` (then Unsupported). `options`: per method, build and draw options; a list is a grid.
    Other parameters as `lodlab.fly` and `lodlab.sweep`.
    """
    field = as_source(source)
    path = named_or_default(path, field.kind)
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
        faults = {m: lacking(field, m) for m in methods}
        for fault in filter(None, faults.values()):
            warnings.warn(f"compare: left out: {fault}", stacklevel=2)
        methods = [m for m in methods if not faults[m]]
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


def fit(
    source: Any,
    method: str,
    store_path: str | os.PathLike[str],
    *,
    pixel_error: float,
    path: Any = "",
    frames: int = 120,
    size: tuple[int, int] = (1280, 720),
    fov: float | None = None,
    out: str | os.PathLike[str] | None = None,
    force: bool = False,
    progress: bool = True,
    **options: Any,
) -> Fit:
    """Searches the smallest store of a source, then the cheapest budget, whose measured error stays within
    `pixel_error` (pixels) on every frame of the path, and writes that store to `store_path`.

    `path`, `frames`, `size`, `fov`: as `fly`. `out`: a run directory in which the answer is then flown and measured in
    every frame (`Fit.run`). `force`: replace an existing file. `options`: the method's other options, build and draw.
    Where nothing reaches it, `reached` is False and the best store is written. Measured with everything loaded: data
    still on its way is drawn coarser.

    InvalidInput: a limit that is no positive number, an unknown method or option, `finest_error` or `stream` among
    the options, a file or finished runs in the way, a path that never sees the source. Unsupported: the method does
    not accept it.
    """
    check_out(out, force)
    found = search(
        source, method, store_path, pixel_error=pixel_error, path=path, frames=frames, size=size, fov=fov, force=force,
        progress=progress, **options,
    )  # fmt: skip
    if out is None:
        return found
    run = fly(
        found.store, path, found.budget, size=size, frames=frames, fov=fov, accuracy_frames=found.frames, out=out,
        progress=progress, **found.fly_options,
    )  # fmt: skip
    return replace(found, run=run)
