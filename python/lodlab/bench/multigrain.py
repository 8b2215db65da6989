# SPDX-License-Identifier: MIT
"""Benchmarks of `multigrain` at its paper's working point, 400 nodes and 2 M triangles, on the whole Earth; its
build on 67 M samples; its accuracy beside a uniform grid; and a million random cuts in search of a crack.
"""

from __future__ import annotations

import hashlib
import math
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from .. import _core
from ..instrument.audit import random_cut
from ..paths.path import CameraPath
from ..sources.datasets import fractal_window
from ..sources.frames import DEFAULT_SPACING
from ..sources.heightfield import HeightField
from ..stores.methods import still
from .lab import SEED, Building, Lab, Record, build_case, device, draw_cases, options_of, record, select_case

PLANET = "earth:planet=true"
TERRAINS = ((PLANET, "earth-planet"), (f"fractal:size=4097,seed={SEED}", "fractal-4097"))
NODES = 400
TRIANGLES = 2_000_000


def _session(store: Any, **draw: Any) -> tuple[Any, dict[str, Any]]:
    """A session with everything loaded first, and its draw options."""
    options = still("multigrain", draw)
    return store.session(options), options


# ---- draw, select ---------------------------------------------------------------------------------


def draw(lab: Lab) -> Iterable[Record]:
    """Triangles per second of a cut of 400 nodes and 2 M triangles, beside one static buffer with the same."""
    for spec, name in TERRAINS:
        view = lab.views(spec, 9)[0]  # further on, 2 M triangles need fewer nodes
        budget = _core.Budget(triangles=TRIANGLES, nodes=NODES)
        store = lab.store(spec, "multigrain")
        yield from draw_cases(lab, f"multigrain/{name}", spec, store, still("multigrain", {}), view, budget)


def _pixel_error_at(session: Any, views: list[Any]) -> float:
    """The pixel error at which the median frame, in its 400 nodes, has about 2 M triangles or all that help."""
    low, high = 1e-3, 100.0
    for _ in range(24):
        middle = math.sqrt(low * high)
        budget = _core.Budget(pixel_error=middle, nodes=NODES)
        if np.median([session.select(view, budget).triangles for view in views]) > TRIANGLES:
            low = middle
        else:
            high = middle
    return high


def select(lab: Lab) -> Iterable[Record]:
    """Microseconds of one select along the moving flyover, each way of adapting at 400 nodes and 2 M triangles."""
    store, views = lab.store(PLANET, "multigrain"), lab.views(PLANET, 120)
    pixel_error = _pixel_error_at(_session(store, adapt="topdown")[0], views[::8])
    for adapt in ("topdown", "dual", "quad", "level"):
        session, options = _session(store, adapt=adapt)
        limits = {"triangles": TRIANGLES} if adapt in ("quad", "level") else {"pixel_error": pixel_error}
        budget = _core.Budget(nodes=NODES, **limits)
        lab.say(f"select multigrain/earth-planet/{adapt}")
        details = partial(_select_details, session, views, budget, limits)
        scanned = "test of every node at every resolution without a hierarchy"
        case = f"multigrain/earth-planet/{adapt}"
        found = select_case(case, session, store, views, budget, scanned, 1.0, options, details)
        found["details"]["p99_of_frames_times_scan"] = found["details"]["p99_of_frames_us"] / found["reference_value"]
        yield found


def _select_details(
    session: Any, views: list[Any], budget: Any, limits: dict[str, float], times: np.ndarray, nodes: np.ndarray
) -> dict[str, Any]:
    """What stands in a record of `select` beside its figures; the cuts are selected again, after the timing."""
    cuts = [session.select(view, budget) for view in views]
    return {
        "p99_us": float(np.percentile(times, 99)),
        "p99_of_frames_us": float(np.percentile(np.median(times, axis=0), 99)),
        "first_frame_us": float(np.median(times[:, 0])),
        "budget": limits | {"nodes": NODES},
        "nodes_drawn": float(np.median(nodes)),
        "nodes_drawn_max": int(np.max(nodes)),
        "triangles": float(np.median([cut.triangles for cut in cuts])),
        "triangles_max": max(cut.triangles for cut in cuts),
        "predicted_px": float(np.median([cut.predicted_px for cut in cuts])),
    }


# ---- build ----------------------------------------------------------------------------------------

BUILD_SIZE = 8193


def _overviews(heights: np.ndarray, path: Path) -> Callable[[], float]:
    """A timed call of rasterio's build_overviews on the heights as int16: average, tiles of 256, one thread."""
    import rasterio
    from rasterio.enums import Resampling
    from rasterio.transform import from_origin

    rows, cols = heights.shape
    profile = {
        "driver": "GTiff", "height": rows, "width": cols, "count": 1, "dtype": "int16",
        "tiled": True, "blockxsize": 256, "blockysize": 256, "transform": from_origin(0.0, 0.0, 30.0, 30.0),
    }  # fmt: skip
    whole = np.clip(np.rint(heights), -32768, 32767).astype(np.int16)
    factors = [2**k for k in range(1, max(2, math.ceil(math.log2(max(rows, cols) / 256)) + 1))]

    def once() -> float:
        path.unlink(missing_ok=True)
        with rasterio.Env(GDAL_NUM_THREADS="1"):
            with rasterio.open(path, "w", **profile) as file:
                file.write(whole, 1)
            start = time.perf_counter()
            with rasterio.open(path, "r+") as file:
                file.build_overviews(factors, Resampling.average)
            return time.perf_counter() - start

    return once


def build(lab: Lab) -> Iterable[Record]:
    """Samples per second from an array in memory to a closed, complete store, beside averaging overviews."""
    import rasterio

    heights, spacing = fractal_window(BUILD_SIZE, BUILD_SIZE, seed=SEED), DEFAULT_SPACING
    building = Building(lab, lambda: _core.HeightField(heights, None, dx=spacing, dy=spacing), "multigrain", {})
    case = f"multigrain/fractal-{BUILD_SIZE}"
    lab.say(f"build {case}")
    beside = f"rasterio {rasterio.__version__}: build_overviews, average, int16, tiles of 256, one thread"
    overviews = _overviews(heights, lab.folder / "overviews.tif")
    yield build_case(case, heights.size, "samples", building, beside, overviews)


# ---- accuracy -------------------------------------------------------------------------------------

ACCURACY_TRIANGLES = 100_000
ACCURACY_FRAMES = 12


def _resampled(field: HeightField, triangles: int) -> HeightField:
    """A planet, sampled bilinearly on the coarsest grid of twice as many columns as rows that has so many triangles:
    two a cell, one where the cell touches a pole."""
    old = np.asarray(field.heights, dtype=np.float64)
    rows = 3
    while 4 * (rows - 1) * (rows - 2) < triangles:
        rows += 1
    y = np.linspace(0.0, old.shape[0] - 1.0, rows)
    x = np.arange(2 * (rows - 1)) * (old.shape[1] / (2 * (rows - 1)))
    r, c = np.minimum(y.astype(int), old.shape[0] - 2), x.astype(int)
    v, u = (y - r)[:, None], x - c
    old = np.column_stack([old, old[:, 0]])
    upper = old[r][:, c] * (1 - u) + old[r][:, c + 1] * u
    lower = old[r + 1][:, c] * (1 - u) + old[r + 1][:, c + 1] * u
    return HeightField((upper * (1 - v) + lower * v).astype(np.float32), planet=True)


def accuracy(lab: Lab) -> Iterable[Record]:
    """99th percentile of the error on screen with 100,000 triangles, beside a uniform grid with as many."""
    field = lab.source(PLANET)
    instrument = _core.Instrument(field.core, lab.store(PLANET, "full").session({}))
    coarse = _resampled(field, ACCURACY_TRIANGLES)
    grid = _core.build(coarse.core, "full", str(lab.folder / "uniform.lod"), {}, "new", None).session({})
    stores = {"": lab.store(PLANET, "multigrain"), "/levels-7": lab.store(PLANET, "multigrain", levels=7)}
    sessions = {name: _session(store) for name, store in stores.items()}
    budget = _core.Budget(triangles=ACCURACY_TRIANGLES)
    rows: dict[str, list[tuple[float, ...]]] = {name: [] for name in stores}
    uniform = []
    for number, view in enumerate(lab.views(PLANET, ACCURACY_FRAMES)):
        lab.say(f"accuracy multigrain/earth-planet {number + 1}/{ACCURACY_FRAMES}")
        reference = instrument.reference(view)
        everything = grid.select(view, _core.Budget(pixel_error=1.0))
        uniform.append(instrument.examine_parts([(grid, everything)], view, reference).measured_px_p99)
        for name, (session, _) in sessions.items():
            cut = session.select(view, budget)
            found = instrument.examine(session, cut, view, reference)
            rows[name].append((found.measured_px_p99, found.measured_px_max, cut.predicted_px, cut.triangles))
    for name, (_, options) in sessions.items():
        p99, largest, predicted, triangles = np.array(rows[name]).T
        yield record(
            "accuracy",
            f"multigrain/earth-planet{name}",
            float(np.median(p99)),
            "px",
            reference="uniform grid with as many triangles",
            reference_value=float(np.median(uniform)),
            ratio=float(np.median(uniform) / np.median(p99)),
            device=device(),
            options=options_of(stores[name], options),
            details={
                "p99_px": p99.tolist(),
                "uniform_p99_px": uniform,
                "measured_px_max": float(largest.max()),
                "predicted_px": float(predicted.max()),
                "triangles_max": int(triangles.max()),
                "uniform_triangles": everything.triangles,
                "frames": ACCURACY_FRAMES,
            },
        )


# ---- cuts -----------------------------------------------------------------------------------------

CUTS = 1_000_000


@dataclass(frozen=True)
class _Tile:
    """A small field of white noise, and how its forest is built."""

    rows: int
    cols: int
    planet: bool
    options: dict[str, int]

    @property
    def name(self) -> str:
        return f"{'planet' if self.planet else 'flat'}-{self.rows}x{self.cols}-chart-{self.options['chart']}"

    def field(self) -> HeightField:
        """Heights without any regularity: two samples that are taken for one another show as a crack."""
        noise = np.random.default_rng(SEED).normal(size=(self.rows, self.cols)).astype(np.float32)
        return HeightField(noise * 2e4, planet=True) if self.planet else HeightField(noise * 30.0, spacing=30.0)


# Whole and clamped charts; a chart beside up to 16 nodes an edge; planets whose last column is whole and clamped.
TILES = (
    _Tile(17, 33, False, {"chart": 16, "levels": 4}),
    _Tile(33, 33, False, {"chart": 8, "levels": 3}),
    _Tile(30, 41, False, {"chart": 16, "levels": 4}),
    _Tile(33, 33, False, {"chart": 32, "levels": 5}),
    _Tile(17, 32, True, {"chart": 8, "levels": 3}),
    _Tile(17, 30, True, {"chart": 8, "levels": 3}),
    _Tile(16, 28, True, {"chart": 16, "levels": 4}),
    _Tile(17, 64, True, {"chart": 32, "levels": 5}),
)


def cuts(lab: Lab) -> Iterable[Record]:
    """A million random valid cuts, levels and resolutions at random: edges of the drawn triangles without a partner."""
    for tile in TILES:
        yield _cuts_of(lab, tile, CUTS // len(TILES))


def _cuts_of(lab: Lab, tile: _Tile, count: int) -> Record:
    field = tile.field()
    store = _core.build(field.core, "multigrain", str(lab.folder / f"{tile.name}.lod"), tile.options, "force", None)
    session, options = _session(store)
    instrument, nodes = _core.Instrument(field.core, None), store.nodes
    view = CameraPath.still(field, frames=1).view(0, size=(16, 16))  # nothing is drawn: the whole cut is captured
    random = np.random.default_rng(SEED)
    different: set[bytes] = set()
    cracks = broken = 0
    start = time.perf_counter()
    for number in range(count):
        if number % 10_000 == 0:
            lab.say(f"cuts multigrain/{tile.name} {number}/{count}")
        ids, resolutions = random_cut(nodes, random, math.sqrt(random.random()))
        different.add(hashlib.blake2b(ids.tobytes() + resolutions.tobytes(), digest_size=12).digest())
        found = instrument.examine(session, session.cut(ids, resolutions), view, pictures=False).crack_edges
        cracks += found
        broken += found > 0
    seconds = time.perf_counter() - start
    return record(
        "cuts",
        f"multigrain/{tile.name}",
        count / seconds,
        "cuts/s",
        device=device(),
        options=options_of(store, options),
        details={
            "cuts": count,
            "different_cuts": len(different),
            "crack_edges": cracks,
            "broken_cuts": broken,
            "nodes": len(np.unique(nodes["id"])),
            "seconds": seconds,
        },
    )
