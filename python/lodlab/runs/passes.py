# SPDX-License-Identifier: MIT
"""One flight of a store: the two passes over the same views, so that measuring never disturbs timing.

The speed pass reads nothing back and records every cut; the accuracy pass draws those records on some
frames and has the instrument measure them against `full` of the same source.
"""

from __future__ import annotations

import math
import os
import re
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from .. import _core, disk, pictures
from ..errors import GLError, InvalidInput, StoreError, Unsupported, check_one_of
from ..instrument.metrics import measure, pixel_slack
from ..paths.path import CameraPath
from ..sources.heightfield import HeightField
from ..stores.store import Store, as_budget, build, method_table, open, options_of, still
from . import results, sight
from .identity import attribute_hash, poses_hash

PICTURE_SAMPLES = 32_000_000  # above it the reference is not drawn and its columns are nan
REFERENCE_BYTES = 1 << 30  # of cached reference pictures, per source
WARM_UP = 3  # frames drawn before the first that counts
WARM_UP_SPREAD = 8  # further ones spread over the path, when everything is loaded first
IMAGES = ("all", "worst", "none")
MEASURES = ("all", "geometry")  # geometry: no picture is drawn to measure, and columns that need one are nan


class CaptureMismatch(GLError):
    """The captured triangles were not what was drawn: the figures of that frame cannot be trusted."""


# ---- what is flown --------------------------------------------------------------------------------


def make_path(path: Any, source: HeightField | None, frames: int, fov: float | None) -> CameraPath:
    """A CameraPath from itself, a built-in name, or a key-frame file (.toml, .json)."""
    return path if isinstance(path, CameraPath) else CameraPath.named(path, source, frames=frames, fov=fov)


def over_source(path: Any) -> bool:
    """Whether a path is made from what it flies over: a built-in one, by its name."""
    return isinstance(path, (str, os.PathLike)) and not os.fspath(path).lower().endswith((".toml", ".json"))


def path_text(path: Any) -> str:
    """A path as configurations name it: a built-in name, an absolute file, or the name of one in memory."""
    if isinstance(path, CameraPath):
        return path.name
    text = os.fspath(path)
    return os.path.abspath(text) if text.lower().endswith((".toml", ".json")) else text


_BUDGETS = ("pixel_error", "triangles", "nodes")


def budget_of(values: Mapping[str, Any] | Any | None) -> dict[str, Any]:
    """A budget as a dict of the values that are set, in the order pixel_error, triangles, nodes."""
    if isinstance(values, Mapping) and set(values) <= set(_BUDGETS):
        return {k: values[k] for k in _BUDGETS if values.get(k) is not None}  # numbers as they were given
    budget = as_budget({} if values is None else values)
    return {k: v for k in _BUDGETS if (v := getattr(budget, k)) is not None}


def check_budget(method: str, values: Mapping[str, Any]) -> Any:
    """The core's Budget. InvalidInput: none set, or not positive; Unsupported: not one of the method's.

    A method that lists no budgets ignores them.
    """
    listed = method_table(method)["budgets"]
    if not listed:
        _core.Budget(**values)  # a value out of range is a mistake all the same
        return _core.Budget(pixel_error=1.0)
    if not values:
        raise InvalidInput(f"budget of {method}: none set; give at least one of {', '.join(listed)}")
    budget = _core.Budget(**values)
    for name in values:
        if name not in listed:
            raise Unsupported(f"budget of {method}: it has no budget {name}; it takes {', '.join(listed)}")
    return budget


def budget_text(values: Mapping[str, Any]) -> str:
    """A budget as in run names: `px1`, `t100000`, `n400`, joined by `-`."""
    short = {"pixel_error": "px", "triangles": "t", "nodes": "n"}
    return "-".join(f"{short[k]}{v:g}" if k == "pixel_error" else f"{short[k]}{v}" for k, v in values.items())


def run_name(*parts: str) -> str:
    """A name that is readable and safe as a folder's."""
    return re.sub(r"[^A-Za-z0-9.=+,_-]+", "_", "-".join(p for p in parts if p)).strip("._") or "run"


@dataclass
class Flight:
    """One run to be made: everything that decides its rows."""

    name: str
    source: str
    path: str
    budget: dict[str, Any]
    options: dict[str, Any]  # draw options, defaults written out
    frames: int = 120
    size: tuple[int, int] = (1280, 720)
    fov: float | None = None  # degrees; None: the path's own, or 60
    accuracy_frames: int = 12
    repeat: int = 1
    images: str = "none"
    metrics: str = "all"

    def check(self) -> None:
        """InvalidInput for what no run can be made of."""
        for name, value, low in (
            ("frames", self.frames, 1),
            ("accuracy_frames", self.accuracy_frames, 0),
            ("repeat", self.repeat, 1),
        ):
            if not hasattr(value, "__index__") or value < low:
                raise InvalidInput(f"fly: {name} is {value!r}; it is a whole number, at least {low}")
        check_one_of("fly: images", self.images, IMAGES)
        check_one_of("fly: metrics", self.metrics, MEASURES)


# ---- what it is measured against ------------------------------------------------------------------


class Yardstick:
    """The instrument of one source: `full` of it drawn as the reference, pictures cached by view."""

    def __init__(
        self,
        source: HeightField,
        folder: Path | None = None,
        progress: bool = True,
        options: Mapping[str, Any] | None = None,
        metrics: str = "all",
        named: bool = False,
    ):
        self.source = source
        self.metrics = metrics
        self.options = dict(options or {})
        self._folder = folder
        self._named = named
        self._progress = progress
        self._instrument: Any = None
        self._references: dict[Any, Any] = {}
        self._bytes = 0

    @property
    def pictures(self) -> bool:
        """Whether there are reference pictures; without, their columns are nan. None above 32 M samples."""
        few = not self.source.windowed and self.source.shape[0] * self.source.shape[1] <= PICTURE_SAMPLES
        return few and self.metrics == "all"

    def instrument(self) -> Any:
        """The core's instrument; builds `full` on first use."""
        if self._instrument is None:
            session = None
            if self.pictures:
                if self._folder is None:
                    self._folder = disk.temporary_folder(self)
                store = store_for(
                    self.source, "full", self.options, self._folder, progress=self._progress, named=self._named
                )
                session = store.core.session(still(store.method, {}))
            self._instrument = _core.Instrument(self.source.core, session)
        return self._instrument

    def reference(self, view: Any) -> Any:
        """The reference picture of a view, or None without `pictures`."""
        if not self.pictures:
            return None
        if view not in self._references:
            made = self.instrument().reference(view)
            self._bytes += made.nbytes
            while self._references and self._bytes > REFERENCE_BYTES:
                self._bytes -= self._references.pop(next(iter(self._references))).nbytes
            self._references[view] = made
        return self._references[view]

    def measure(self, session: Any, cut: Any, view: Any, before: Any = None) -> dict[str, Any]:
        """The accuracy columns of one drawn cut; `before`: the cut of the frame before."""
        reference = self.reference(view)
        return measure(self.instrument(), session, cut, view, reference, pictures=reference is not None, before=before)

    def error_picture(self, session: Any, cut: Any, view: Any) -> np.ndarray:
        """(H', W', 4) uint8: a drawn cut coloured by its measured error, with a scale in pixels."""
        measurement = self.instrument().examine(session, cut, view)
        return pictures.error_picture(measurement.image, measurement.error_px())


def look_of(store: Store) -> dict[str, Any]:
    """Build options that `full` must share with a store to look like it: the colour raster, not the error."""
    return {k: store.options[k] for k in options_of("full", "build") if k in store.options and k != "finest_error"}


def store_file(source: HeightField, method: str, options: Mapping[str, Any], folder: Path) -> Path:
    """Where `store_for` keeps the store of a source, method and build options."""
    resolved = _core.resolve_options(method, "build", dict(options))
    colours = attribute_hash(resolved)
    digest = disk.short_hash({"source": source.hash(), "options": resolved, **({"files": colours} if colours else {})})
    return folder / f"{method}-{digest}.lod"


def store_for(
    source: HeightField,
    method: str,
    options: Mapping[str, Any],
    folder: Path,
    *,
    progress: bool = True,
    named: bool = False,
) -> Store:
    """The store of a source, method and build options in a `stores/` folder.

    Reused when it is there with the same source, options and colours; an interrupted build is taken up. `named`: the
    user's own folder, where a store of any name is reused, but for those with colours, whose raster may have
    changed since.
    """
    resolved = _core.resolve_options(method, "build", dict(options))
    folder.mkdir(parents=True, exist_ok=True)
    file = store_file(source, method, resolved, folder)

    def fits(store: Store) -> bool:
        return store.method == method and store.source_hash == source.hash() and store.options == resolved

    user = named and not attribute_hash(resolved) and not file.exists()
    for store in map(_opened, sorted(folder.glob("*.lod")) if user else []):
        if store is not None and fits(store):
            store.attach(source)
            return store
    if file.exists():
        store = open(file)
        if fits(store):
            store.attach(source)
            return store
        raise StoreError(f"stores: {file} is not the store that its name says; remove it")
    return build(source, method, file, mode="resume", progress=progress, **resolved)


def _opened(file: Path) -> Store | None:
    """A store, or None for a file that is none, or not yet."""
    try:
        return open(file)
    except StoreError:
        return None


# ---- the two passes -------------------------------------------------------------------------------


@dataclass
class Recording:
    """What the speed pass leaves: a view, a cut and its costs per frame; times (passes, frames, 3), ms."""

    views: list[Any]
    cuts: list[Any]
    costs: list[dict[str, Any]]
    times: np.ndarray


def accuracy_indices(frames: int, count: int) -> list[int]:
    """`count` evenly spaced frames, first and last among them; the middle one for 1."""
    count = min(count, frames)
    if count <= 0:
        return []
    if count == 1:
        return [(frames - 1) // 2]
    return sorted({round(i * (frames - 1) / (count - 1)) for i in range(count)})


def speed_pass(session: Any, views: Sequence[Any], budget: Any, *, repeat: int, streams: bool, tick: Any) -> Recording:
    """Times every frame, `repeat` times, reading nothing back; times are the median over the passes.

    Counters and cuts are those of the first pass. Warm-up draws the first view (streaming: until its data
    is there) and, where everything is loaded first, a few views along the path; then the adaptation state
    is reset.
    """
    for _ in range(WARM_UP):
        session.time_frame(views[0], budget)
        if streams:
            session.settle()
    if not streams:
        for f in accuracy_indices(len(views), WARM_UP_SPREAD):
            session.time_frame(views[f], budget)
    cuts: list[Any] = []
    costs: list[dict[str, Any]] = []
    times = np.empty((repeat, len(views), len(results.TIME_COLUMNS)))
    for again in range(repeat):
        session.reset()
        for f, view in enumerate(views):
            cut, cost = session.time_frame(view, budget)
            times[again, f] = [cost[c] for c in results.TIME_COLUMNS]
            if again == 0:
                cuts.append(cut)
                costs.append(cost)
            tick()
    for cost, values in zip(costs, np.median(times, axis=0), strict=True):
        cost.update(zip(results.TIME_COLUMNS, values.tolist(), strict=True))
    return Recording(list(views), cuts, costs, times)


def timed(store: Store, views: Sequence[Any], flight: Flight, *, tick: Any = lambda: None) -> tuple[Any, Recording]:
    """The speed pass of one flight, and the session that it opened."""
    budget = check_budget(store.method, flight.budget)
    session = store.core.session(flight.options)
    streams = bool(flight.options.get("stream", False))
    return session, speed_pass(session, views, budget, repeat=flight.repeat, streams=streams, tick=tick)


def frame_rows(store: Store, flight: Flight, recording: Recording, measured: Mapping[int, dict]) -> list[dict]:
    """The rows of `frames.csv`."""
    table = method_table(store.method)
    budget = flight.budget if table["budgets"] else {}
    device = _core.gl_info()["renderer"]
    options = results.options_text({**store.options, **flight.options})
    hashes = {
        "source_hash": store.source_hash,
        "poses_hash": poses_hash(recording.views),
        "attribute_hash": attribute_hash(store.options),
    }
    rows = []
    for f, (cut, cost) in enumerate(zip(recording.cuts, recording.costs, strict=True)):
        accuracy = dict.fromkeys(results.ACCURACY_COLUMNS, math.nan) | measured.get(f, {})
        accuracy["predicted_px"] = cut.predicted_px
        rows.append(
            {
                "run": flight.name,
                "source": flight.source,
                "method": store.method,
                "options": options,
                "budget_pixel_error": budget.get("pixel_error"),
                "budget_triangles": budget.get("triangles"),
                "budget_nodes": budget.get("nodes"),
                "path": flight.path,
                "frame": f,
                "budget_met": cut.budget_met,
                "promises_bound": cut.promises_bound,
                "stream": bool(flight.options.get("stream", False)),
                "device": device,
                **{c: cost[c] for c in results.COST_COLUMNS},
                **{c: accuracy[c] for c in results.ACCURACY_COLUMNS},
                "accuracy": f in measured,
                "gpu_clock": cost["gpu_clock"],
                "filler_triangles": cut.filler_triangles,
                "slack_px": pixel_slack(recording.views[f]),
                **hashes,
            }
        )
    return rows


def worst_frame(rows: Sequence[Mapping[str, Any]]) -> int:
    """The frame whose pictures are kept: the largest `measured_px_max`, else the middle one."""
    measured = [r for r in rows if r["accuracy"] and not math.isnan(r["measured_px_max"])]
    if not measured:
        return len(rows) // 2
    return max(measured, key=lambda r: (r["measured_px_max"], -r["frame"]))["frame"]


def worst_folder(folder: Path, run: str) -> Path:
    """Where a run keeps what explains its worst frame, beside its numbered frames."""
    return folder / "images" / f"{run}.worst"


def make_pictures(
    folder: Path,
    flight: Flight,
    rows: Sequence[Mapping[str, Any]],
    recording: Recording,
    session: Any,
    yardstick: Yardstick | None,
) -> None:
    """Writes `images/RUN/000042.png`, nothing but numbered frames, and of the worst one into `images/RUN.worst`
    `000042-level.png`, `-error`, `-reference` and `-difference-xN`."""
    if flight.images == "none":
        return
    folder, extras = folder / "images" / flight.name, worst_folder(folder, flight.name)
    for one in (folder, extras):
        one.mkdir(parents=True, exist_ok=True)
        for old in one.glob("*.png"):
            old.unlink()
    worst = worst_frame(rows)
    for f in range(len(rows)) if flight.images == "all" else (worst,):
        drawn = session.draw(recording.cuts[f], recording.views[f], "shade")
        pictures.save(folder / f"{f:06d}.png", drawn.image)
        if f != worst:
            continue
        levels = session.draw(recording.cuts[f], recording.views[f], "level")
        pictures.save(extras / f"{f:06d}-level.png", levels.image)
        if yardstick is None:
            continue
        if not yardstick.source.windowed:
            error = yardstick.error_picture(session, recording.cuts[f], recording.views[f])
            pictures.save(extras / f"{f:06d}-error.png", error)
        reference = yardstick.reference(recording.views[f])
        if reference is not None:
            delta, factor = pictures.difference(drawn.image, reference.image)
            pictures.save(extras / f"{f:06d}-reference.png", reference.image)
            pictures.save(extras / f"{f:06d}-difference-x{factor}.png", delta)


@dataclass
class Flown:
    """A finished run in this process."""

    rows: list[dict[str, Any]]
    recording: Recording
    session: Any
    yardstick: Yardstick | None = field(default=None)
    complaint: str | None = None  # about what the path sees


def perform(
    store: Store,
    path: CameraPath,
    flight: Flight,
    *,
    yardstick: Yardstick | None = None,
    folder: Path | None = None,
    tick: Any = lambda: None,
) -> Flown:
    """Both passes and the pictures of one flight. `tick()` is called after every frame of either pass."""
    flight.check()
    views = list(path.views(flight.size, flight.fov))
    indices = accuracy_indices(len(views), flight.accuracy_frames)
    if indices and yardstick is None:
        yardstick = Yardstick(store.source, options=look_of(store), metrics=flight.metrics)
    session, recording = timed(store, views, flight, tick=tick)
    if missing := sum(cut.missing_nodes > 0 for cut in recording.cuts):
        warnings.warn(
            f"run {flight.name}: {missing} of {len(views)} frames drew coarser stand-ins for data that was not there "
            "yet (stream=true); such rows do not repeat",
            stacklevel=3,
        )
    if flight.options.get("stream", False):
        session = store.core.session(still(store.method, flight.options))
    measured: dict[int, dict[str, Any]] = {}
    for f in indices:
        before = recording.cuts[f - 1] if f > 0 else None
        measured[f] = yardstick.measure(session, recording.cuts[f], views[f], before)
        tick()
    rows = frame_rows(store, flight, recording, measured)
    if folder is not None:
        make_pictures(folder, flight, rows, recording, session, yardstick if indices else None)
    references = [yardstick.reference(views[f]) for f in indices]
    depths = (r.depth for r in references if r is not None)
    complaint = sight.complaint(flight.path, store.frame, views, measured.values(), depths)
    return Flown(rows, recording, session, yardstick, complaint)


def summary_of(flown: Flown, store: Store) -> dict[str, Any]:
    """The row of `summary.csv` of a finished run."""
    return results.summarize(
        flown.rows, store_bytes=store.bytes, build_seconds=store.build_seconds, times=flown.recording.times
    )


def check_capture(frames: Any) -> None:
    """Raises CaptureMismatch naming run, frame and pixels when a capture was not what was drawn."""
    bad = frames[frames["capture_mismatch_pixels"] > 0]
    if len(bad):
        row = bad.iloc[0]
        raise CaptureMismatch(
            f"run {row['run']}, frame {row['frame']}: the captured triangles differ from the drawn frame in "
            f"{row['capture_mismatch_pixels']:.0f} pixels (limit 0), in {len(bad)} frames of "
            f"{bad['run'].nunique()} runs"
        )
