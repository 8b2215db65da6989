# SPDX-License-Identifier: MIT
"""What benchmarks share: sources and stores made once, the statistics of repeats, the record of a case."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from .. import _core
from ..errors import InvalidInput
from ..instrument import statistics
from ..paths.path import CameraPath, default_path
from ..runs import provenance, tables
from ..sources import datasets
from ..sources.spec import find_file

SIZE = (1280, 720)
SEED = 1
PAIRS = 41
REPEATS = 5
SELECT_REPEATS = 21

Record = dict[str, Any]
Say = Callable[[str], None]


class Lab:
    """What the benchmarks of one call share: a folder for stores, sources and stores made once, progress texts."""

    def __init__(self, folder: Path, say: Say):
        self.folder = folder
        self.say = say
        self._sources: dict[str, Any] = {}
        self._stores: dict[tuple[str, str, str], Any] = {}

    def source(self, spec: str) -> Any:
        """The lodlab source of a SOURCE."""
        if spec not in self._sources:
            self._sources[spec] = datasets.load(spec)
        return self._sources[spec]

    def store(self, spec: str, method: str, **options: Any) -> Any:
        """An opened core store of the source, built with these options on first use."""
        key = (spec, method, tables.options_text(options))
        if key not in self._stores:
            self.say(f"building {method} of {spec}")
            path = self.folder / f"{len(self._stores)}.lod"
            self._stores[key] = _core.build(self.source(spec).core, method, str(path), options, "new", None)
        return self._stores[key]

    def views(self, spec: str, frames: int) -> list[Any]:
        """The views of the built-in flyover over a field, of the orbit round a mesh."""
        source = self.source(spec)
        path = CameraPath.named(default_path(source.kind), source, frames=frames)
        return [path.view(f, size=SIZE) for f in range(frames)]

    def lacks(self, file: str, case: str) -> bool:
        """Whether a file of the folder of further data is not there; says then that the case is skipped."""
        absent = find_file(file) is None
        if absent:
            self.say(f"{case} is skipped: {file} is not there (LODLAB_DATA names its folder)")
        return absent


# ---- statistics -----------------------------------------------------------------------------------


def bootstrap_median(samples: np.ndarray) -> tuple[float, float, float]:
    """Median of ``samples`` (N,) and the ends of its percentile bootstrap 95 % interval.

    Raises:
        InvalidInput: Fewer than five samples.
    """
    samples = np.asarray(samples, dtype=np.float64)
    if samples.ndim != 1 or samples.size < 5:
        raise InvalidInput(f"bootstrap_median: {samples.shape} samples; a median needs at least 5 in one dimension")
    low, high = statistics.median_intervals(samples[None, :, None])[:, 0]
    return float(np.median(samples)), float(low), float(high)


def interleaved(first: Callable[[], float], second: Callable[[], float], pairs: int) -> np.ndarray:
    """Runs two timed calls in turn, the order swapped from pair to pair; (pairs, 2) of what they return."""
    first()
    second()
    out = np.empty((pairs, 2))
    for i in range(pairs):
        if i % 2 == 0:
            out[i] = first(), second()
        else:
            b = second()
            out[i] = first(), b
    return out


# ---- records --------------------------------------------------------------------------------------


def record(bench: str, case: str, value: float, unit: str, **more: Any) -> Record:
    """A case's record; what is not given is empty or nan."""
    out: Record = {
        "bench": bench,
        "case": case,
        "value": value,
        "unit": unit,
        "reference": "",
        "reference_value": math.nan,
        "ratio": math.nan,
        "device": "",
        "commit": provenance.commit(),
        "options": "{}",
        "seed": SEED,
        "ratio_low": math.nan,
        "ratio_high": math.nan,
        "details": {},
    }
    unknown = set(more) - set(out)
    if unknown:
        raise TypeError(f"a record has no {sorted(unknown)}")
    return out | more


def device() -> str:
    """The name of the device that draws."""
    return _core.gl_info()["renderer"]


def options_of(store: Any, draw: dict[str, Any]) -> str:
    """Build and draw options as text, every default written out."""
    return tables.options_text({**store.options, **_core.resolve_options(store.method, "draw", draw)})


def select_case(
    case: str,
    session: Any,
    store: Any,
    views: Sequence[Any],
    budget: Any,
    reference: str,
    scanned_px: float,
    options: dict[str, Any],
    details: Callable[[np.ndarray, np.ndarray], dict[str, Any]],
) -> Record:
    """A record of `select`: microseconds a frame beside a scan at `scanned_px`. `details` is given (repeats, frames)
    times and the nodes that each frame draws."""
    times, nodes = _core.time_select(session, views, budget, SELECT_REPEATS)
    scan = _core.time_scan(store, views, scanned_px, SELECT_REPEATS)
    ratio, low, high = bootstrap_median(np.median(scan, axis=1) / np.median(times, axis=1))
    return record(
        "select",
        case,
        float(np.median(times)),
        "us/frame",
        reference=reference,
        reference_value=float(np.median(scan)),
        ratio=ratio,
        ratio_low=low,
        ratio_high=high,
        options=options_of(store, options),
        details={**details(times, nodes), "frames": len(views), "repeats": SELECT_REPEATS},
    )


def draw_cases(
    lab: Lab, case: str, spec: str, store: Any, draw: dict[str, Any], at: Any, budget: Any
) -> Iterator[Record]:
    """The records of a store's cut under the view `at`, beside one static buffer that holds the very same triangles;
    drawn, and with the rasterizer off."""
    session = store.session(draw)
    cut = session.select(at, budget)
    reference = _core.StaticMesh(session.capture(cut, at, False), lab.source(spec).core)
    for discard in (False, True):
        name = f"{case}/discard" if discard else case
        lab.say(f"draw {name}")
        yield draw_case(name, session, cut, at, reference, discard) | {"options": options_of(store, draw)}


def draw_case(case: str, session: Any, cut: Any, view: Any, reference: Any, discard: bool) -> Record:
    """A record of `draw`: a cut beside a static buffer of the same triangles."""
    times = interleaved(
        lambda: session.time_draw(cut, view, discard), lambda: reference.time_draw(view, discard), PAIRS
    )
    ratio, low, high = bootstrap_median(times[:, 1] / times[:, 0])
    ours, theirs = np.median(times, axis=0)
    return record(
        "draw",
        case,
        cut.triangles / (ours / 1e3),
        "triangles/s",
        reference="static buffer",
        reference_value=reference.triangles / (theirs / 1e3),
        ratio=ratio,
        ratio_low=low,
        ratio_high=high,
        device=device(),
        details={
            "ms": ours,
            "reference_ms": theirs,
            "triangles": cut.triangles,
            "filler_triangles": cut.filler_triangles,
            "chunks": cut.visible_nodes,
            "reference_vertices": reference.vertices,
            "pairs": PAIRS,
        },
    )


class Building:
    """A timed call: from arrays in memory (`source` makes the core's source of them) to a closed, complete store, which
    `store` is then. Builds anew each time."""

    def __init__(self, lab: Lab, source: Callable[[], Any], method: str, options: dict[str, Any]):
        self._source, self._method, self._options = source, method, options
        self._path = lab.folder / f"build-{method}.lod"
        self.store: Any = None

    def __call__(self) -> float:
        self.store = None
        self._path.unlink(missing_ok=True)
        start = time.perf_counter()
        self.store = _core.build(self._source(), self._method, str(self._path), self._options, "new", None)
        return time.perf_counter() - start

    @property
    def info(self) -> dict[str, Any]:
        """What the store says of itself."""
        return self.store.info()


def build_case(
    case: str, count: int, unit: str, building: Building, reference: str, other: Callable[[], float] | None
) -> Record:
    """A record of `build`: so many of a unit a second, in turn with a reference; None: it is not installed."""
    known: dict[str, Any] = {}
    if other is None:
        times = np.array([building() for _ in range(REPEATS + 1)][1:])
    else:
        pairs = interleaved(building, other, REPEATS)
        times = pairs[:, 0]
        ratio, low, high = bootstrap_median(pairs[:, 1] / times)
        known = {"reference_value": count / float(np.median(pairs[:, 1])), "ratio": ratio, "ratio_low": low}
        known |= {"ratio_high": high}
    seconds = float(np.median(times))
    return record(
        "build",
        case,
        count / seconds,
        f"{unit}/s",
        reference=reference,
        options=tables.options_text(building.store.options),
        details={
            "seconds": seconds,
            "bytes_per_sample": building.info["bytes_per_sample"],
            "bytes_per_vertex": building.info["bytes_per_vertex"],
            "threads": _core.thread_count(),
            "repeats": REPEATS,
        },
        **known,
    )
