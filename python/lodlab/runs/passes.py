# SPDX-License-Identifier: MIT
"""One flight of a store: the two passes over the same views, so that measuring never disturbs timing.

The speed pass reads nothing back and records every cut; the accuracy pass draws those records on some
frames and has the instrument measure them against `full` of the same source.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from .. import _core, pictures
from ..disk import attribute_hash
from ..errors import GLError
from ..instrument.metrics import pixel_slack
from ..instrument.yardstick import Yardstick, look_of
from ..paths.deform import Deformation
from ..paths.path import CameraPath, poses_hash
from ..stores.methods import method_table, still
from ..stores.store import Store
from . import sight, tables
from .flight import Flight, check_budget

WARM_UP = 3  # frames drawn before the first that counts
WARM_UP_SPREAD = 8  # further ones spread over the path, when everything is loaded first


class CaptureMismatch(GLError):
    """The captured triangles were not what was drawn: the figures of that frame cannot be trusted."""


@dataclass
class Recording:
    """What the speed pass leaves: a view, a cut and its costs per frame; times (passes, frames, 3), ms; what deformed
    the mesh."""

    views: list[Any]
    cuts: list[Any]
    costs: list[dict[str, Any]]
    times: np.ndarray
    deform: Deformation | None = None


Shot = tuple[Any, np.ndarray | None]  # a frame's view, and its control positions, (V, 3), or None: at rest


def shots_of(path: CameraPath, store: Store, size: tuple[int, int], fov: float | None) -> list[Shot]:
    """What a path asks of every frame. Unsupported where it deforms a mesh whose method has no control points."""
    views = list(path.views(size, fov))
    if path.deform is None:
        return [(view, None) for view in views]
    rest = store.control_positions
    rest.flags.writeable = False
    return [(view, path.control_positions(path.time(f), rest)) for f, view in enumerate(views)]


def accuracy_indices(frames: int, count: int) -> list[int]:
    """`count` evenly spaced frames, first and last among them; the middle one for 1."""
    count = min(count, frames)
    if count <= 0:
        return []
    if count == 1:
        return [(frames - 1) // 2]
    return sorted({round(i * (frames - 1) / (count - 1)) for i in range(count)})


def speed_pass(session: Any, shots: Sequence[Shot], budget: Any, *, repeat: int, streams: bool, tick: Any) -> Recording:
    """Times every frame, `repeat` times, reading nothing back; times are the median over the passes.

    Counters and cuts are those of the first pass. Warm-up draws the first view (streaming: until its data
    is there) and, where everything is loaded first, a few views along the path; then the adaptation state
    is reset.
    """

    def frame(f: int) -> tuple[Any, dict[str, Any]]:
        view, pose = shots[f]
        return session.time_frame(view, budget, control_positions=pose)

    for _ in range(WARM_UP):
        frame(0)
        if streams:
            session.settle()
    if not streams:
        for f in accuracy_indices(len(shots), WARM_UP_SPREAD):
            frame(f)
    cuts: list[Any] = []
    costs: list[dict[str, Any]] = []
    times = np.empty((repeat, len(shots), len(tables.TIME_COLUMNS)))
    for again in range(repeat):
        session.reset()
        for f in range(len(shots)):
            cut, cost = frame(f)
            times[again, f] = [cost[c] for c in tables.TIME_COLUMNS]
            if again == 0:
                cuts.append(cut)
                costs.append(cost)
            tick()
    for cost, values in zip(costs, np.median(times, axis=0), strict=True):
        cost.update(zip(tables.TIME_COLUMNS, values.tolist(), strict=True))
    return Recording([view for view, _ in shots], cuts, costs, times)


def timed(store: Store, path: CameraPath, flight: Flight, *, tick: Any = lambda: None) -> tuple[Any, Recording]:
    """The speed pass of one flight, and the session that it opened."""
    budget = check_budget(store.method, flight.budget)
    shots = shots_of(path, store, flight.size, flight.fov)
    session = store.core.session(flight.options)
    streams = bool(flight.options.get("stream", False))
    recording = speed_pass(session, shots, budget, repeat=flight.repeat, streams=streams, tick=tick)
    recording.deform = path.deform
    return session, recording


def frame_rows(store: Store, flight: Flight, recording: Recording, measured: Mapping[int, dict]) -> list[dict]:
    """The rows of `frames.csv`."""
    table = method_table(store.method)
    budget = flight.budget if table["budgets"] else {}
    device = _core.gl_info()["renderer"]
    options = tables.options_text({**store.options, **flight.options})
    hashes = {
        "source_hash": store.source_hash,
        "poses_hash": poses_hash(recording.views, recording.deform),
        "attribute_hash": attribute_hash(store.options),
    }
    rows = []
    for f, (cut, cost) in enumerate(zip(recording.cuts, recording.costs, strict=True)):
        accuracy = dict.fromkeys(tables.ACCURACY_COLUMNS, math.nan) | measured.get(f, {})
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
                **{c: cost[c] for c in tables.COST_COLUMNS},
                **{c: accuracy[c] for c in tables.ACCURACY_COLUMNS},
                "accuracy": f in measured,
                "gpu_clock": cost["gpu_clock"],
                "filler_triangles": cut.filler_triangles,
                "slack_px": pixel_slack(recording.views[f]),
                "source_kind": store.source_kind,
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
        reference = yardstick.reference(recording.views[f], recording.cuts[f])
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


def tell_warnings(run: str, cuts: Sequence[Any]) -> None:
    """Warns, once a run, of what cuts say that their user should know."""
    told = [f for f, cut in enumerate(cuts) if cut.warning]
    if told:
        many = f"{len(told)} of {len(cuts)} frames, first in frame {told[0]}"
        warnings.warn(f"run {run}: {cuts[told[0]].warning} ({many})", stacklevel=4)


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
    indices = accuracy_indices(len(path), flight.accuracy_frames)
    if indices and yardstick is None:
        yardstick = Yardstick(store.source, options=look_of(store), metrics=flight.metrics)
    session, recording = timed(store, path, flight, tick=tick)
    views = recording.views
    tell_warnings(flight.name, recording.cuts)
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
    references = [yardstick.reference(views[f], recording.cuts[f]) for f in indices]
    depths = (r.depth for r in references if r is not None)
    complaint = sight.complaint(flight.path, store.frame, views, measured.values(), depths)
    return Flown(rows, recording, session, yardstick, complaint)


def summary_of(flown: Flown, store: Store) -> dict[str, Any]:
    """The row of `summary.csv` of a finished run."""
    return tables.summarize(
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
