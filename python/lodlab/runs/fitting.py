# SPDX-License-Identifier: MIT
"""The least model that a path needs: the smallest store and the cheapest budget whose measured error stays within
a limit on every frame.

Measured, not promised: the store that is chosen is coarser than its bounds alone would allow, so that its budget may
go unmet where the path comes near, though the error is within the limit there. `Fit` counts those frames.

Two ladders: `finest_error`, where the method has it, in steps of sqrt 2 from the source's relief down to lossless,
and the budget in steps of 10 %. A rung that holds is taken to hold finer and tighter as well, so that bisection finds
the first one; what it ends on, and both its neighbours, are measured. Bytes count first: the coarsest rung that holds
under any budget, then the loosest budget that holds on it. What holds on the path's frames is verified on a sampling
four times as dense; a frame above the limit there belongs to the tested ones from then on, and the search goes on.
"""

from __future__ import annotations

import bisect
import math
import os
import shutil
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .. import _core
from ..disk import temporary_folder
from ..errors import InvalidInput, Unsupported
from ..paths.path import CameraPath, make_path, named_or_default
from ..sources.base import Source
from ..sources.datasets import as_source
from ..stores.build import store_for
from ..stores.methods import check_accepts, method_table, options_of, still
from ..stores.store import Store, open
from .flight import check_budget
from .run import Run

DENSER = 4  # the second sampling of the path
STEP = 1.1  # between budgets
TIGHTEST = -24  # steps from the limit: a tenth of it; tighter only for methods that promise no bound
LOOSEST_PX = 1e6  # above it nothing is refined
FEWEST_TRIANGLES = 10
UNPACKED = 8  # bytes on the GPU for one of a store, at most
SMALLEST_SHARE = 2.0**-16  # of the relief: what 16 bits can tell apart


@dataclass(frozen=True)
class Neighbour:
    """A candidate one step further, and a frame that refutes it."""

    finest_error: float | None  # source units
    budget: dict[str, Any]
    worst_px: float  # of the frames that were measured: the search ends at the first that is above the limit
    t: float  # path time of that frame, 0 to 1


@dataclass(frozen=True)
class Fit:
    """What `fit` found. `reached`: the measured error is within `pixel_error` on every frame; else this is the
    finest store under the tightest budget. `coarser`, `looser`: the neighbours, None where there is no such step."""

    store: Store
    reached: bool
    pixel_error: float
    finest_error: float | None  # source units; None: the method has no such option
    budget: dict[str, Any]
    bytes: int
    median_triangles: float  # over the path's frames
    worst_px: float  # measured, over the dense sampling
    predicted_px: float  # the method's claim, over the path's frames
    unmet_frames: int  # of the path's, in which the claim is above the budget: `budget_met` is false there
    unseen_frames: int  # of the path's, that see nothing of the source
    fly_options: dict[str, Any]  # draw options with which `fly` draws the cuts that were measured
    coarser: Neighbour | None
    looser: Neighbour | None
    path: str
    frames: int
    verified_frames: int
    candidates: int  # stores and budgets that were tried
    run: Run | None = None  # the answer, flown and measured in every frame, where a run directory was asked for

    def to_dict(self) -> dict[str, Any]:
        """Everything as plain values, for JSON; `store` is the file's name, and the run stays out."""
        rest = {name: value for name, value in vars(self).items() if name not in ("store", "run")}
        rest |= {name: asdict(value) for name in ("coarser", "looser") if (value := rest[name]) is not None}
        return {"store": os.fspath(self.store.path), "method": self.store.method, **rest}

    def __repr__(self) -> str:
        chosen = candidate_text(self.finest_error, self.budget) or "no options"
        return (
            f"<lodlab.Fit {'reached' if self.reached else 'NOT reached'}: {chosen}; {self.bytes} bytes, "
            f"median {self.median_triangles:.0f} triangles, worst {self.worst_px:.3g} px of {self.pixel_error:g}>"
        )


def search(
    source: Any,
    method: str,
    store_path: str | os.PathLike[str],
    *,
    pixel_error: float,
    path: Any,
    frames: int,
    size: tuple[int, int],
    fov: float | None,
    force: bool,
    progress: bool,
    **options: Any,
) -> Fit:
    """The store and budget that `lodlab.fit` answers with, found and written to `store_path`; its parameters."""
    limit = _limit(pixel_error)
    build_options, draw_options = _split(method, options)
    target = _target(store_path, force)
    source = as_source(source)
    check_accepts(source, method)
    track = make_path(named_or_default(path, source.kind), source, frames, fov)
    if track.deform is not None:
        raise Unsupported(f"fit: path {track.name} deforms the mesh; bounds, which a search goes by, hold at rest")
    search = _Search(source, method, build_options, draw_options, limit, track, size, fov, progress)
    with search.bar:
        return search.run(target)


def _limit(pixel_error: Any) -> float:
    if isinstance(pixel_error, (int, float)) and not isinstance(pixel_error, bool):
        limit = float(pixel_error)
        if math.isfinite(limit) and limit > 0:
            return limit
    raise InvalidInput(f"fit: pixel_error is {pixel_error!r}; it is a positive number of pixels")


def _split(method: str, options: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """(build, draw) options, checked."""
    build, draw = options_of(method, "build"), options_of(method, "draw")
    for name in options:
        if name not in build and name not in draw:
            known = ", ".join(build + draw) or "none"
            raise InvalidInput(f"options of {method}: no option {name!r}; it has {known}")
        if name in ("finest_error", "stream"):
            raise InvalidInput(f"fit: {name} cannot be set; fit chooses finest_error and loads everything first")
    chosen = {name: value for name, value in options.items() if name in build}
    _core.resolve_options(method, "build", chosen)
    drawn = {name: value for name, value in options.items() if name in draw}
    return chosen, _core.resolve_options(method, "draw", drawn)


def _fly_options(method: str, given: Mapping[str, Any], store_bytes: int) -> dict[str, Any]:
    """The draw options that `fly` needs beside the defaults, so that it draws what was measured."""
    wanted = {**given, "stream": False} if "stream" in given else dict(given)
    if store_bytes * UNPACKED > given.get("gpu_cache_mb", math.inf) * 2**20:
        wanted = still(method, wanted)
    return {o["name"]: wanted[o["name"]] for o in method_table(method)["options"]
            if o["name"] in wanted and wanted[o["name"]] != o["default"]}  # fmt: skip


def _target(store_path: str | os.PathLike[str], force: bool) -> Path:
    """Where the store goes, checked before the long search."""
    target = Path(store_path)
    if target.is_dir() or (target.exists() and not force):
        raise InvalidInput(f"fit: {target} exists already; choose another name or remove it")
    if not os.access(target.parent, os.W_OK | os.X_OK):
        raise InvalidInput(f"fit: {target.parent} is no folder that can be written to")
    return target


def check_out(out: str | os.PathLike[str] | None, force: bool) -> None:
    """Refuses before the long search a folder that would be refused, or mixed into, after it."""
    if out is None:
        return
    folder = Path(out)
    if folder.exists() and not folder.is_dir():
        raise InvalidInput(f"fit: out is {folder}, a file; it is a run directory")
    if (folder / "frames.csv").exists() and not force:
        raise InvalidInput(f"fit: {folder} holds runs already; choose another folder, or force=True to add to them")


def _rungs(source: Source, method: str) -> list[float | None]:
    """`finest_error`, coarsest first: powers of sqrt 2 from the relief (of meshes the extent) down, then 0 where the
    method allows it; None alone where it has no such option."""
    option = next((o for o in method_table(method)["options"] if o["name"] == "finest_error"), None)
    if option is None:
        return [None]
    low, high = option["range"]
    mesh = source.kind == "mesh"
    relief = source.extent if mesh else float(np.nanmax(source.heights) - np.nanmin(source.heights))
    rungs: list[float | None] = []
    if relief > 0:
        top = math.floor(2 * math.log2(relief))
        rungs = [_six(2 ** (k / 2)) for k in range(top, top + round(2 * math.log2(SMALLEST_SHARE)), -1)]
    return [rung for rung in [*rungs, 0.0] if low <= rung <= high]


def _budgets(method: str, limit: float, samples: int) -> list[dict[str, Any]]:
    """The budgets to try, loosest first."""
    listed = method_table(method)["budgets"]
    if "pixel_error" in listed:
        loosest = math.ceil(math.log(max(LOOSEST_PX / limit, 1.0)) / math.log(STEP))
        return [{"pixel_error": _six(limit * STEP**k)} for k in range(loosest, TIGHTEST - 1, -1)]
    if "triangles" in listed:
        most = math.ceil(math.log(4 * samples / FEWEST_TRIANGLES) / math.log(STEP))  # fillers included
        return [{"triangles": math.ceil(FEWEST_TRIANGLES * STEP**k)} for k in range(most + 1)]
    return [{}]


def _six(value: float) -> float:
    """A number of six digits, that can be typed again."""
    return float(f"{value:.6g}")


def candidate_text(finest_error: float | None, budget: Mapping[str, Any]) -> str:
    """A store and a budget for people, with all digits."""
    rung = {} if finest_error is None else {"finest_error": finest_error}
    return ", ".join(f"{name} {number_text(value)}" for name, value in {**rung, **budget}.items())


def number_text(value: float | int) -> str:
    """A value of either ladder as it can be typed again."""
    return str(value) if isinstance(value, int) else f"{value:g}"


class _Search:
    """The candidates (rung, step), what is known of each, and the one session that is open."""

    def __init__(
        self,
        source: Source,
        method: str,
        build_options: Mapping[str, Any],
        draw_options: Mapping[str, Any],
        limit: float,
        track: CameraPath,
        size: tuple[int, int],
        fov: float | None,
        progress: bool,
    ):
        from ..progress import tqdm

        self.instrument = _core.Instrument(source.core, None)
        self.source, self.method, self.limit, self.track = source, method, limit, track
        self.build_options, self.given = build_options, draw_options
        self.draw_options = still(method, draw_options)
        self.rungs = _rungs(source, method)
        self.steps = _budgets(method, limit, source.samples)
        dense = track.dense(DENSER)
        self.dense = dense
        self.views = list(dense.views(size, fov))
        self.all = _spread(range(len(self.views)))
        self.base = _spread(range(0, len(self.views), DENSER))
        self.hot: list[int] = []  # frames that refuted a candidate, the last one first
        self.finest = len(self.rungs)  # rungs before it are searched
        self.proven = len(self.steps) - 1  # the step under which they are judged, beside the tightest
        self.known: dict[tuple[int, int], dict[int, float]] = {}  # pixels by frame, by candidate
        self.folder = temporary_folder(self)
        self._open: tuple[int, Store, Any] | None = None
        self.bar = tqdm(desc=f"fit {method}", unit="frame", disable=None if progress else True, leave=False)
        self.progress = progress

    def run(self, target: Path) -> Fit:
        while (found := self.first()) is not None:
            rung, step = found
            if not self.holds(rung, step, self.all):
                continue
            if rung > 0 and self.holds(rung - 1, step, self.all):
                self.finest, self.proven = rung, step  # against the rule, coarser holds under this very budget
                continue
            return self.result(rung, step, target, True)
        rung, step = len(self.rungs) - 1, len(self.steps) - 1
        for frame in self.all:
            self.pixels(rung, step, frame)
        return self.result(rung, step, target, False)

    def first(self) -> tuple[int, int] | None:
        """The coarsest rung that holds on the tested frames and its loosest step that does; None: there is none."""
        tightest = len(self.steps) - 1

        def rung_holds(rung: int) -> bool:
            return any(self.holds(rung, step, self.base) for step in {tightest, self.proven})

        rung = bisect.bisect_left(range(self.finest), True, key=rung_holds)
        if rung == self.finest:
            return None
        steps = range(1 + (self.proven if self.holds(rung, self.proven, self.base) else tightest))
        return rung, bisect.bisect_left(steps, True, key=lambda step: self.holds(rung, step, self.base))

    def holds(self, rung: int, step: int, frames: Iterable[int]) -> bool:
        """No frame is above the limit, of these and of those that refuted others. Ends at the first that is."""
        if any(px > self.limit for px in self.known.get((rung, step), {}).values()):
            return False
        self.bar.set_description_str(f"fit {self.method}: {candidate_text(self.rungs[rung], self.steps[step])}")
        for frame in [*self.hot, *frames]:
            if self.pixels(rung, step, frame) > self.limit:
                self.hot = [frame, *(f for f in self.hot if f != frame)]
                return False
        return True

    def pixels(self, rung: int, step: int, frame: int) -> float:
        """The measured error of a frame; nan where it sees nothing of the source, inf over a hole."""
        known = self.known.setdefault((rung, step), {})
        if frame not in known:
            cut = self.cut(rung, step, frame)
            measured = self.instrument.examine(self.session(rung), cut, self.views[frame], pictures=False)
            known[frame] = measured.measured_px_max
            self.bar.update()
        return known[frame]

    def cut(self, rung: int, step: int, frame: int) -> Any:
        return self.session(rung).select(self.views[frame], check_budget(self.method, self.steps[step]))

    def store(self, rung: int) -> Store:
        chosen = {} if self.rungs[rung] is None else {"finest_error": self.rungs[rung]}
        options = {**self.build_options, **chosen}
        return store_for(self.source, self.method, options, self.folder, progress=self.progress)

    def session(self, rung: int) -> Any:
        """The session of a rung; one is open at a time, because each holds its store on the GPU."""
        if self._open is None or self._open[0] != rung:
            self._open = None
            store = self.store(rung)
            self._open = (rung, store, store.core.session(self.draw_options))
        return self._open[2]

    def result(self, rung: int, step: int, target: Path, reached: bool) -> Fit:
        worst = [px for px in self.known[rung, step].values() if not math.isnan(px)]
        if not worst:
            raise InvalidInput(f"fit: no frame of path {self.track.name} sees the source")
        cuts = [self.cut(rung, step, frame) for frame in self.base]
        _place(self.store(rung).path, target)
        store = open(target, self.source)
        return Fit(
            store=store,
            reached=reached,
            pixel_error=self.limit,
            finest_error=self.rungs[rung],
            budget=self.steps[step],
            bytes=store.bytes,
            median_triangles=float(np.median([cut.triangles for cut in cuts])),
            worst_px=max(worst),
            predicted_px=max(cut.predicted_px for cut in cuts),
            unmet_frames=sum(not cut.budget_met for cut in cuts),
            unseen_frames=sum(math.isnan(self.pixels(rung, step, frame)) for frame in self.base),
            fly_options=_fly_options(self.method, self.given, store.bytes),
            coarser=self.neighbour(rung - 1, step) if reached else None,
            looser=self.neighbour(rung, step - 1) if reached else None,
            path=self.track.name,
            frames=len(self.base),
            verified_frames=len(self.all),
            candidates=len(self.known),
        )

    def neighbour(self, rung: int, step: int) -> Neighbour | None:
        """What was measured of a candidate next to the chosen one."""
        if rung < 0 or step < 0:
            return None
        known = {frame: px for frame, px in self.known[rung, step].items() if not math.isnan(px)}
        frame = max(known, key=known.__getitem__)
        return Neighbour(self.rungs[rung], self.steps[step], known[frame], self.dense.time(frame))


def _spread(frames: range) -> list[int]:
    """Frames in an order whose beginning is spread over the path (golden section)."""
    return sorted(frames, key=lambda frame: frame * 0.6180339887498949 % 1.0)


def _place(file: Path, target: Path) -> None:
    """Copies a store to where it belongs, whole or not at all."""
    temporary = target.with_name(f".{target.name}.{os.getpid()}.tmp")
    try:
        with file.open("rb") as given, temporary.open("wb") as out:
            shutil.copyfileobj(given, out, 1 << 20)
            out.flush()
            os.fsync(out.fileno())
        temporary.replace(target)
    except OSError as error:  # the temporary name tells nobody anything
        raise OSError(error.errno, error.strerror, os.fspath(target)) from None
    finally:
        temporary.unlink(missing_ok=True)
