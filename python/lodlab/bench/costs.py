# SPDX-License-Identifier: MIT
"""Benchmarks of what users wait for: drawing, selecting, building, the memory of a store, `make demo` as a whole."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np

from .. import _core
from ..runs import tables
from .lab import (
    PAIRS,
    REPEATS,
    SEED,
    Building,
    Lab,
    Record,
    bootstrap_median,
    build_case,
    device,
    draw_cases,
    interleaved,
    record,
    select_case,
)

TERRAINS = (("jacksboro", "jacksboro"), (f"fractal:size=2049,seed={SEED}", "fractal-2049"))
DRAW_OPTIONS = {"stream": False}
DRAWN = (
    *(("chunked", *terrain) for terrain in TERRAINS),
    ("seamless", "jacksboro", "jacksboro"),
    ("seamless", f"fractal:size=4097,seed={SEED}", "fractal-4097"),
)
# Case, side of the fractal, method, its options of build and draw: each at about fifty nodes drawn.
SELECTED = (
    ("chunked/fractal-2049", 2049, "chunked", {}, {}),
    ("chunked/fractal-4097", 4097, "chunked", {"finest_error": 0.25}, {}),
    ("seamless/fractal-4097", 4097, "seamless", {}, {}),
    ("seamless/fractal-4097/distance", 4097, "seamless", {}, {"metric": "distance"}),
)
BESIDE = "chunked/fractal-4097"  # what the selects of seamless are timed in turn with
BUILD_SIZE = 4097
BUILD_OPTIONS = {"finest_error": 0.25}
_MEMORY_CHILD = """
import json, sys
import numpy as np
from lodlab import _core

def resident(key):
    with open("/proc/self/status") as status:
        return next(int(line.split()[1]) * 1024 for line in status if line.startswith(key))

array, out, spacing, options = sys.argv[1], sys.argv[2], float(sys.argv[3]), json.loads(sys.argv[4])
bare = resident("VmRSS")
heights = np.load(array)
before = resident("VmRSS")
source = _core.HeightField(heights, None, dx=spacing, dy=spacing)
_core.build(source, "chunked", out, options, "new", None)
peak = resident("VmHWM")  # not ru_maxrss, which starts at the parent's peak
print(json.dumps({"bare": bare, "before": before, "peak": peak, "array": heights.nbytes, "samples": heights.size}))
"""
# The arguments of `make demo`: a window of the Earth's relief, of which everything costs more than any cut at 1 px.
DEMO = (
    "compare", "earth:window=240/600/1300/1700,vertical_scale=4", "--path", "orbit", "--size", "960x540",
    "--pixel-errors", "1,2,4", "--frames", "30", "--accuracy-frames", "4",
)  # fmt: skip


def draw(lab: Lab) -> Iterable[Record]:
    """Triangles per second of a 1 px cut, beside one static buffer that holds the very same triangles."""
    for method, spec, name in DRAWN:
        view = lab.views(spec, 9)[4]
        store, budget = lab.store(spec, method), _core.Budget(pixel_error=1.0)
        yield from draw_cases(lab, f"{method}/{name}", spec, store, DRAW_OPTIONS, view, budget)


def _pixel_error_for(session: Any, views: Sequence[Any], nodes: int) -> float:
    """The pixel error at which the median frame draws about so many nodes (bisection in its logarithm)."""
    low, high = 0.05, 500.0
    for _ in range(24):
        middle = math.sqrt(low * high)
        seen = [session.select(v, _core.Budget(pixel_error=middle)).visible_nodes for v in views]
        if np.median(seen) > nodes:
            low = middle
        else:
            high = middle
    return high


def select(lab: Lab) -> Iterable[Record]:
    """Microseconds of one select along the moving flyover, beside a plain scan over all nodes."""
    beside = None
    for case, size, method, build, draw in SELECTED:
        spec = f"fractal:size={size},seed={SEED}"
        store = lab.store(spec, method, **build)
        session = store.session(DRAW_OPTIONS | draw)
        views = lab.views(spec, 120)
        pixel_error = _pixel_error_for(session, views, 50)
        budget = _core.Budget(pixel_error=pixel_error)
        lab.say(f"select {case}")

        def once(session: Any = session, views: Sequence[Any] = views, budget: Any = budget) -> float:
            return float(np.median(_core.time_select(session, views, budget, 1)[0]))

        found = select_case(
            case,
            session,
            store,
            views,
            budget,
            "test of every node without a hierarchy",
            pixel_error,
            DRAW_OPTIONS | draw,
            lambda times, nodes, store=store, pixel_error=pixel_error: {
                "nodes_drawn": float(np.median(nodes)),
                "nodes_drawn_max": int(np.max(nodes)),
                "nodes_in_store": len(np.unique(store.nodes["id"])),
                "pixel_error": pixel_error,
                "p95_us": float(np.percentile(times, 95)),
            },
        )
        if case == BESIDE:
            beside = once
        elif beside is not None:
            pairs = interleaved(once, beside, PAIRS)
            times, low, high = bootstrap_median(pairs[:, 0] / pairs[:, 1])
            found["details"] |= {"times_chunked": times, "times_chunked_low": low, "times_chunked_high": high}
        yield found


def _build_spec() -> str:
    return f"fractal:size={BUILD_SIZE},seed={SEED}"


def _martini(heights: np.ndarray) -> tuple[str, Callable[[], float] | None]:
    """The name and a timed call of pymartini's error pass plus one mesh; None where it is not installed."""
    try:
        import pymartini
    except ImportError:
        return "pymartini (not installed)", None
    grid = pymartini.Martini(heights.shape[0])

    def once() -> float:
        start = time.perf_counter()
        tile = grid.create_tile(heights)
        tile.get_mesh(BUILD_OPTIONS["finest_error"])
        return time.perf_counter() - start

    return f"pymartini {pymartini.__version__}: error pass and one mesh", once


def build(lab: Lab) -> Iterable[Record]:
    """Samples per second from an array in memory to a closed, complete store, exact bounds included."""
    field = lab.source(_build_spec()).core
    heights = np.array(field.heights)
    building = Building(
        lab, lambda: _core.HeightField(heights, None, dx=field.dx, dy=field.dx), "chunked", BUILD_OPTIONS
    )
    case = f"chunked/fractal-{BUILD_SIZE}"
    lab.say(f"build {case}")
    found = build_case(case, heights.size, "samples", building, *_martini(heights))
    finest = building.info["levels"][-1]
    nodes = building.store.nodes
    surface = building.store.session({}).cut(nodes["id"][nodes["level"] == finest["level"]], None)
    kept = (surface.triangles - surface.filler_triangles) / (2.0 * (BUILD_SIZE - 1) ** 2)
    found["details"] |= {"share_of_samples_kept": kept, "finest_error_max": finest["error_max"]}
    yield found


def memory(lab: Lab) -> Iterable[Record]:
    """Peak resident memory of a process that builds, above its input array, in bytes per sample."""
    fld = lab.source(_build_spec()).core
    array, out = lab.folder / "memory.npy", lab.folder / "memory.lod"
    np.save(array, fld.heights)
    seen = []
    for i in range(REPEATS):
        lab.say(f"memory chunked/fractal-{BUILD_SIZE} {i + 1}/{REPEATS}")
        out.unlink(missing_ok=True)
        command = [sys.executable, "-c", _MEMORY_CHILD, str(array), str(out), repr(fld.dx), json.dumps(BUILD_OPTIONS)]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode:
            raise RuntimeError(f"memory: the building process ended with status {done.returncode}: {done.stderr}")
        seen.append(json.loads(done.stdout.splitlines()[-1]))
    array.unlink()
    peaks = np.array([s["peak"] for s in seen], dtype=np.float64)
    one = seen[int(np.argsort(peaks)[len(peaks) // 2])]
    whole = (one["peak"] - one["array"]) / one["samples"]
    yield record(
        "memory",
        f"chunked/fractal-{BUILD_SIZE}",
        whole,
        "bytes/sample",
        reference="the input array",
        reference_value=one["array"] / one["samples"],
        ratio=one["array"] / one["samples"] / whole,
        options=tables.options_text(BUILD_OPTIONS),
        details={
            "peak_bytes": one["peak"],
            "array_bytes": one["array"],
            "interpreter_bytes": one["bare"],
            "without_interpreter": (one["peak"] - one["before"]) / one["samples"],
            "repeats": REPEATS,
        },
    )


def demo(lab: Lab) -> Iterable[Record]:
    """Seconds of the whole job of `make demo`, set-up apart, and what `full` costs there. One run: minutes long."""
    lab.say("demo earth")
    out = lab.folder / "demo"
    start = time.perf_counter()
    command = [sys.executable, "-m", "lodlab", *DEMO, "--out", str(out)]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"demo: lodlab compare ended with status {done.returncode}: {done.stderr[-2000:]}")
    seconds = time.perf_counter() - start
    runs = tables.read_table(out / "summary.csv").set_index("run")["frame_ms_median"]
    slowest = runs[[name for name in runs.index if name.endswith("-px1")]]
    yield record(
        "demo",
        "compare/earth",
        seconds,
        "s",
        reference="a frame of full, beside the slowest method at 1 px",
        reference_value=float(runs["full"]),
        ratio=float(runs["full"] / slowest.max()),
        device=device(),
        details={
            "slowest": str(slowest.idxmax()),
            "report_bytes": (out / "report.html").stat().st_size,
            "cores": os.cpu_count(),
        },
    )
