# SPDX-License-Identifier: MIT
"""Runs: one store along one path under one budget, as a table and, where asked, as a run directory."""

from __future__ import annotations

import html
import math
import os
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

from .. import _core, disk, pictures
from ..errors import InvalidInput, check_one_of
from ..movies import FPS, Animation
from ..paths.path import CameraPath
from ..paths.terrain import BUILT_IN
from ..sources.spec import as_source
from ..stores.store import SHOWS, Frame, Store, as_store, method_table
from . import results
from .identity import KEPT_MB, hash_list, keep_array, keep_file, poses_hash, rasters, take_path
from .passes import (
    PICTURE_SAMPLES,
    CaptureMismatch,
    Flight,
    Flown,
    Yardstick,
    accuracy_indices,
    budget_of,
    budget_text,
    check_budget,
    check_capture,
    look_of,
    make_path,
    over_source,
    path_text,
    perform,
    run_name,
    summary_of,
    worst_folder,
    worst_frame,
)

__all__ = ["CaptureMismatch", "Run", "fly", "load"]


class Run:
    """The frames of one store along one path under one budget.

    `frames`: DataFrame, a row a frame (columns of `frames.csv`); `summary`: dict, the row of `summary.csv`;
    `directory`: where it lies on disk, or None.
    """

    def __init__(self, frames: Any, summary: dict[str, Any], directory: Path | None = None, flown: Flown | None = None):
        self.frames = frames
        self.summary = summary
        self.directory = directory
        self._flown = flown

    @property
    def name(self) -> str:
        """The run's name: method, what varies, budget."""
        return self.summary["run"]

    def image(self, frame: int | None = None, show: str = "shade") -> Frame:
        """The picture of a frame (default: the worst one), drawn again from its recorded cut.

        `show`: shade, normal, level, wire, reference, or error (measured, in pixels, with its scale below). A run read
        from disk shows the pictures that it wrote; others are drawn again from its source and path, and InvalidInput
        says why where that cannot be: streamed runs, arrays that were too large to keep, what has changed since.
        """
        f = worst_frame(self.frames.to_dict("records")) if frame is None else int(frame)
        if not 0 <= f < len(self.frames):
            raise InvalidInput(f"image: frame {f} of run {self.name}; it has frames 0 to {len(self.frames) - 1}")
        check_one_of("image: show", show, (*SHOWS, "reference", "error"))
        if self._flown is None:
            written = self._written(f, show)
            if written is not None:
                return written
            if self.directory is None:
                raise InvalidInput(f"image: run {self.name} is not in this process and has no run directory")
            from .replays import fly_again

            self._flown = fly_again(self)
        return self._drawn(self._flown, f, show)

    def _written(self, f: int, show: str) -> Frame | None:
        """A picture that the run wrote, or None."""
        if self.directory is None:
            return None
        shade = self.directory / "images" / self.name / f"{f:06d}.png"
        file = shade if show == "shade" else worst_folder(self.directory, self.name) / f"{f:06d}-{show}.png"
        return Frame(pictures.load(file)) if file.exists() else None

    def _drawn(self, flown: Flown, f: int, show: str) -> Frame:
        """A frame drawn again from its recorded cut."""
        cut, view = flown.recording.cuts[f], flown.recording.views[f]
        if show == "wire":
            return Frame(flown.session.wire(cut, view).image)
        if show in ("reference", "error") and flown.yardstick is None:
            raise InvalidInput(f"image: run {self.name} was not measured, so it has no picture {show!r}")
        if show == "error":
            return Frame(flown.yardstick.error_picture(flown.session, cut, view))
        if show == "reference":
            reference = flown.yardstick.reference(view)
            if reference is None:
                why = f"above {PICTURE_SAMPLES} samples" if flown.yardstick.metrics == "all" else "metrics='geometry'"
                raise InvalidInput(f"image: run {self.name} has no reference ({why})")
            return Frame(reference.image, reference.depth)
        drawn = flown.session.draw(cut, view, show)
        return Frame(drawn.image, drawn.depth)

    def animation(self, show: str = "shade", fps: float = FPS) -> Animation:
        """All frames as a moving picture, each as `image` shows it; `.save("run.mp4")` or `.gif` writes it.

        `fps`: frames a second, 1 to 100. Frames are drawn when it is saved or shown.
        """
        count = len(self.frames)
        return Animation(lambda: (self.image(f, show).image for f in range(count)), count, fps)

    def __repr__(self) -> str:
        s = self.summary
        worst = s["measured_px_max_worst"]
        seen = f"worst {worst:.3g} px" if not math.isnan(worst) else "nothing in view"
        return (
            f"<lodlab.Run {self.name}: {len(self.frames)} frames, median {s['frame_ms_median']:.3g} ms, "
            f"{s['triangles_median']:.0f} triangles, {seen if s['accuracy_frames'] else 'not measured'}>"
        )

    def _repr_html_(self) -> str:
        import base64

        from ..report import charts

        chart = base64.b64encode(charts.timeline(self)._repr_png_()).decode()
        return (
            f"<div>{html.escape(repr(self)[1:-1])}"
            f'<br><img alt="frames of {html.escape(self.name)}" style="max-width:100%" width="740" '
            f'src="data:image/png;base64,{chart}"></div>'
        )


def load(directory: str | os.PathLike[str], name: str | None = None) -> Run:
    """A run read from a run directory; `name` may be left out when it holds one run only."""
    folder = Path(directory)
    frames, summary = results.read_runs(folder)
    names = summary["run"].tolist()
    if name is None and len(names) == 1:
        name = names[0]
    if name not in names:
        raise InvalidInput(f"load: run {name!r} in {folder}; it holds {', '.join(names) or 'none'}")
    frames = frames[frames["run"] == name].reset_index(drop=True)
    run = Run(frames, summary[summary["run"] == name].iloc[0].to_dict(), folder)
    check_capture(run.frames)
    return run


def _enter(
    directory: results.RunDirectory, store: Store, track: CameraPath, flight: Flight, device: str | None
) -> Flight:
    """The flight under the names that the directory has for it, which keeps what it rests on."""
    from .configs import Task, enter, flight_config

    field = store._source  # at hand, or not needed
    if track.name == Path(flight.path).stem and flight.path.lower().endswith((".toml", ".json")):
        path = keep_file(directory.path, Path(flight.path), directory.config is None)
    elif flight.path in BUILT_IN and field is None:
        path = flight.path  # by its name, or like it: there is nothing to compare it over
    else:
        path = take_path(directory, track, [] if field is None else [field], flight.size, flight.fov)
    flight = replace(flight, path=path)
    found = {
        ("source", flight.source): store.source_hash,
        ("path", f"{path} over {flight.source}"): poses_hash(track.views(flight.size, flight.fov)),
        **rasters(store.options),
    }
    _, tasks = enter(directory, flight_config(store, flight, device), lambda _: hash_list(found))
    if field is not None:
        keep_array(directory.path, flight.source, field, KEPT_MB)
    key = Task(flight, store.method, store.options).key
    return next(task.flight for task in tasks if task.key == key)


def fly(
    store: Store | str | os.PathLike[str],
    path: Any = "flyover",
    budget: Any = None,
    *,
    size: tuple[int, int] = (1280, 720),
    frames: int = 120,
    fov: float | None = None,
    accuracy_frames: int = 12,
    repeat: int = 1,
    images: str | None = None,
    metrics: str = "all",
    out: str | os.PathLike[str] | None = None,
    stores: str | os.PathLike[str] | None = None,
    device: str | None = None,
    source: Any = None,
    progress: bool = True,
    **options: Any,
) -> Run:
    """Flies a store (or the file of one) along a path under a budget and measures it.

    `path`: a CameraPath, a built-in name or a key-frame file (`frames` and `fov`, degrees, are for names and
    files). `budget`: lodlab.Budget or a dict. `size`: pixels. `accuracy_frames`: how many evenly spaced frames are
    measured; 0 needs no source. `repeat`: timing passes. `images`: all, worst or none (default worst with `out`,
    else none). `metrics`: all, or geometry, for which no picture is drawn to measure (columns that need one are
    nan, and whether the capture is what was drawn is not looked at). `out`: run directory; `stores`: a folder of
    stores to be reused, for the reference (by default the run directory's). `options`: the method's draw options.

    Raises InvalidInput and Unsupported for what the user got wrong, CaptureMismatch (after the results are
    written) when a capture was not what was drawn. Warns of every law that the rows break (BrokenPromise), after the
    results are written. A directory that holds this very run already is read; one of other runs grows by it, unless
    they contradict (`lodlab.sweep`).
    """
    from ..instrument.laws import tell_broken
    from ..progress import tqdm

    store = as_store(store)
    if source is not None:
        store.attach(as_source(source))
    if device:
        _core.choose_device(device)
    if images not in (None, "none") and out is None:
        raise InvalidInput(f"fly: images={images!r} needs a run directory (out=)")
    track = make_path(path, store.source if over_source(path) else None, frames, fov)
    flight = Flight(
        name=run_name(store.method, budget_text(budget_of(budget)) if method_table(store.method)["budgets"] else ""),
        source=store.source_spec or f"array:{store.source_hash[:8]}",
        path=path_text(path),
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

    def finish(flown: Flown) -> tuple[list[dict[str, Any]], dict[str, Any]]:
        return flown.rows, summary_of(flown, store)

    total = len(track) * repeat + len(accuracy_indices(len(track), accuracy_frames))
    with tqdm(total=total, desc=flight.name, unit="frame", disable=None if progress else True, leave=False) as bar:
        if out is None:
            flown = perform(store, track, flight, yardstick=yardstick, tick=bar.update)
            rows, summary = finish(flown)
        else:
            from ..report.page import write as write_report

            with results.RunDirectory(out) as directory:
                flight = _enter(directory, store, track, flight, device)
                if flight.name in directory.done:
                    run = load(directory.path, flight.name)
                    tell_broken(run.frames)
                    return run
                directory.provenance(gl=_core.gl_info(), libraries=_core.libraries(), jobs=[1])
                flown = perform(store, track, flight, yardstick=yardstick, folder=directory.path, tick=bar.update)
                rows, summary = finish(flown)
                directory.append(rows, summary)
                directory.provenance(
                    sources={flight.source: store.source_hash},
                    options_hash=disk.short_hash({"options": rows[0]["options"]}),
                )
                write_report(directory.path)
    if flown.complaint:
        warnings.warn(flown.complaint, stacklevel=2)
    run = Run(results.table(rows, results.FRAME_COLUMNS), summary, Path(out) if out is not None else None, flown)
    tell_broken(run.frames)
    check_capture(run.frames)
    return run
