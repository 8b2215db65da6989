# SPDX-License-Identifier: MIT
"""Benchmarks: each figure beside a reference that was measured in the same process, interleaved with it.

``run(["draw"])`` returns records ``{bench, case, value, unit, reference, reference_value, ratio, device, commit,
options, seed}``; ``ratio`` is always "larger is better" and carries the ends of its bootstrap 95 % interval
(``ratio_low``, ``ratio_high``), ``details`` says what else was seen. ``check(records)`` compares them with
``benchmarks/bars.toml``, in which the promises stand.

Times are taken inside the core, so that no interpreter stands between the two clocks. Nothing is measured on
fewer than five repeats, and medians are compared, never means.

The benchmarks of `multigrain` stand in multigrain.py, what all share in lab.py; the others are here.
Longer than other files: a function a benchmark, and nothing that two of them do not share.
"""

from __future__ import annotations

import fnmatch
import json
import math
import os
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from .. import _core
from ..errors import InvalidInput
from ..instrument.metrics import METRICS, measure
from ..runs import tables
from . import multigrain, windowed
from .lab import (
    PAIRS,
    REPEATS,
    SEED,
    Lab,
    Record,
    Say,
    bootstrap_median,
    device,
    draw_case,
    interleaved,
    options_of,
    record,
    select_case,
)

# ---- draw -----------------------------------------------------------------------------------------


TERRAINS = (("jacksboro", "jacksboro"), (f"fractal:size=2049,seed={SEED}", "fractal-2049"))
DRAW_OPTIONS = {"stream": False}
DRAWN = (
    *(("chunked", *terrain) for terrain in TERRAINS),
    ("seamless", "jacksboro", "jacksboro"),
    ("seamless", f"fractal:size=4097,seed={SEED}", "fractal-4097"),
)


def _draw(lab: Lab) -> Iterable[Record]:
    """Triangles per second of a 1 px cut, beside one static buffer that holds the very same triangles."""
    for method, spec, name in DRAWN:
        store = lab.store(spec, method)
        session = store.session(DRAW_OPTIONS)
        view = lab.views(spec, 9)[4]
        cut = session.select(view, _core.Budget(pixel_error=1.0))
        reference = _core.StaticMesh(session.capture(cut, view, False), lab.source(spec).core)
        for discard in (False, True):
            case = f"{method}/{name}" + ("/discard" if discard else "")
            lab.say(f"draw {case}")
            drawn = draw_case(case, session, cut, view, reference, discard)
            yield drawn | {"options": options_of(store, DRAW_OPTIONS)}


# ---- select ---------------------------------------------------------------------------------------


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


# Case, side of the fractal, method, its options of build and draw: each at about fifty nodes drawn.
SELECTED = (
    ("chunked/fractal-2049", 2049, "chunked", {}, {}),
    ("chunked/fractal-4097", 4097, "chunked", {"finest_error": 0.25}, {}),
    ("seamless/fractal-4097", 4097, "seamless", {}, {}),
    ("seamless/fractal-4097/distance", 4097, "seamless", {}, {"metric": "distance"}),
)


BESIDE = "chunked/fractal-4097"  # what the selects of seamless are timed in turn with


def _select(lab: Lab) -> Iterable[Record]:
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


# ---- build, memory --------------------------------------------------------------------------------

BUILD_SIZE = 4097
BUILD_OPTIONS = {"finest_error": 0.25}


def _build_spec() -> str:
    return f"fractal:size={BUILD_SIZE},seed={SEED}"


def _martini(heights: np.ndarray) -> tuple[str, Callable[[], float]] | None:
    """The name and a timed call of pymartini's error pass plus one mesh; None where it is not installed."""
    try:
        import pymartini
    except ImportError:
        return None
    grid = pymartini.Martini(heights.shape[0])

    def once() -> float:
        start = time.perf_counter()
        tile = grid.create_tile(heights)
        tile.get_mesh(BUILD_OPTIONS["finest_error"])
        return time.perf_counter() - start

    return f"pymartini {pymartini.__version__}: error pass and one mesh", once


def _build(lab: Lab) -> Iterable[Record]:
    """Samples per second from an array in memory to a closed, complete store, exact bounds included."""
    heights = np.array(lab.source(_build_spec()).core.heights)
    path = lab.folder / "build.lod"
    kept: dict[str, Any] = {}
    spacing = lab.source(_build_spec()).core.dx

    def once() -> float:
        path.unlink(missing_ok=True)
        start = time.perf_counter()
        source = _core.HeightField(heights, None, dx=spacing, dy=spacing)
        store = _core.build(source, "chunked", str(path), BUILD_OPTIONS, "new", None)
        seconds = time.perf_counter() - start
        kept.update(info=store.info(), options=dict(store.options), store=store)
        return seconds

    lab.say(f"build chunked/fractal-{BUILD_SIZE}")
    martini = _martini(heights)
    if martini is None:
        times = np.array([once() for _ in range(REPEATS + 1)][1:])
        reference, theirs, ratio, low, high = "pymartini (not installed)", math.nan, math.nan, math.nan, math.nan
    else:
        reference, other = martini
        pairs = interleaved(once, other, REPEATS)
        times = pairs[:, 0]
        theirs = heights.size / float(np.median(pairs[:, 1]))
        ratio, low, high = bootstrap_median(pairs[:, 1] / pairs[:, 0])
    info = kept["info"]
    finest = info["levels"][-1]
    nodes = kept["store"].nodes
    surface = kept["store"].session({}).cut(nodes["id"][nodes["level"] == finest["level"]], None)
    yield record(
        "build",
        f"chunked/fractal-{BUILD_SIZE}",
        heights.size / float(np.median(times)),
        "samples/s",
        reference=reference,
        reference_value=theirs,
        ratio=ratio,
        ratio_low=low,
        ratio_high=high,
        options=tables.options_text(kept["options"]),
        details={
            "seconds": float(np.median(times)),
            "share_of_samples_kept": (surface.triangles - surface.filler_triangles) / (2.0 * (BUILD_SIZE - 1) ** 2),
            "bytes_per_sample": info["bytes_per_sample"],
            "bytes_per_vertex": info["bytes_per_vertex"],
            "finest_error_max": finest["error_max"],
            "threads": _core.thread_count(),
            "repeats": REPEATS,
        },
    )


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


def _memory(lab: Lab) -> Iterable[Record]:
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


# ---- measure, accuracy ----------------------------------------------------------------------------


def _measure(lab: Lab) -> Iterable[Record]:
    """Milliseconds of one accuracy frame without picture metrics, beside drawing `full` for the same frame."""
    for spec, name in TERRAINS:
        store, full = lab.store(spec, "chunked"), lab.store(spec, "full")
        session, reference = store.session(DRAW_OPTIONS), full.session({})
        instrument = _core.Instrument(lab.source(spec).core, reference)
        lab.say(f"measure chunked/{name}")
        frames = [_measure_frame(instrument, session, reference, view) for view in lab.views(spec, REPEATS)]
        ours, theirs = (float(np.median([np.median(times[:, k]) for times in frames])) for k in (0, 1))
        ratio, low, high = bootstrap_median(np.array([np.median(times[:, 1] / times[:, 0]) for times in frames]))
        yield record(
            "measure",
            f"chunked/{name}",
            ours,
            "ms/frame",
            reference="drawing full",
            reference_value=theirs,
            ratio=ratio,
            ratio_low=low,
            ratio_high=high,
            device=device(),
            options=options_of(store, DRAW_OPTIONS),
            details={
                "times_full": 1.0 / ratio,
                "views": len(frames),
                "repeats": REPEATS,
                **_dear_metrics(instrument, session, lab.views(spec, REPEATS)),
            },
        )
        yield _likeness(instrument, session, lab.views(spec, REPEATS)[2], name)


def _dear_metrics(instrument: Any, session: Any, views: Sequence[Any]) -> dict[str, float]:
    """What a frame costs when everything is measured, and what FLIP and SSIM take of it: medians over views of
    milliseconds, and of processor time over all cores. References have been compared with before, as in sweeps."""
    rows = []
    for view in views:
        cut, reference = session.select(view, _core.Budget(pixel_error=1.0)), instrument.reference(view)
        instrument.examine(session, cut, view, reference).flip  # noqa: B018
        measurement = instrument.examine(session, cut, view, reference, before=cut)
        spent = {}
        for metric in METRICS:
            wall, cpu = time.perf_counter(), time.process_time()
            metric.of(measurement)
            spent[metric.name] = np.array([time.perf_counter() - wall, time.process_time() - cpu]) * 1e3
        rows.append([sum(spent.values()), spent["ssim"] + spent["flip"]])
    (all_ms, all_cpu), (likeness, likeness_cpu) = np.median(rows, axis=0).tolist()
    return {
        "all_metrics_ms": all_ms,
        "all_metrics_cpu_ms": all_cpu,
        "ssim_and_flip_ms": likeness,
        "ssim_and_flip_cpu_ms": likeness_cpu,
    }


def _likeness(instrument: Any, session: Any, view: Any, name: str) -> Record:
    """Milliseconds of SSIM and FLIP of one picture, both sides anew, beside scikit-image and flip-evaluator."""
    reference = instrument.reference(view).image
    image = session.draw(session.select(view, _core.Budget(pixel_error=1.0)), view, "shade").image

    def ours() -> float:
        start = time.perf_counter()
        _core.ssim(image, reference)
        _core.flip(image, reference)
        return (time.perf_counter() - start) * 1e3

    theirs = _libraries_likeness(image, reference)
    if theirs is None:
        known = {"reference": "scikit-image, flip-evaluator (not installed)"}
        times = np.array([ours() for _ in range(REPEATS + 1)][1:])
    else:
        pairs = interleaved(ours, theirs, REPEATS)
        times = pairs[:, 0]
        ratio, low, high = bootstrap_median(pairs[:, 1] / times)
        known = {"reference": "scikit-image, flip-evaluator", "reference_value": float(np.median(pairs[:, 1]))}
        known |= {"ratio": ratio, "ratio_low": low, "ratio_high": high}
    details = {"threads": _core.thread_count(), "repeats": REPEATS}
    return record("measure", f"ssim-flip/{name}", float(np.median(times)), "ms/picture", details=details, **known)


def _libraries_likeness(image: np.ndarray, reference: np.ndarray) -> Callable[[], float] | None:
    """A timed call of the libraries of others; None where they are not installed."""
    try:
        import flip_evaluator
        from skimage.metrics import structural_similarity
    except ImportError:
        return None
    colours = [picture[..., :3] for picture in (reference, image)]
    floats = [(c / np.float32(255)).astype(np.float32) for c in colours]

    def once() -> float:
        start = time.perf_counter()
        structural_similarity(*colours, channel_axis=2, gaussian_weights=True, sigma=1.5, use_sample_covariance=False)
        flip_evaluator.evaluate(*floats, "LDR", True, False, True)
        return (time.perf_counter() - start) * 1e3

    return once


def _measure_frame(instrument: Any, session: Any, reference: Any, view: Any) -> np.ndarray:
    """(REPEATS, 2) milliseconds: measuring a 1 px cut, drawing `full`."""
    budget = _core.Budget(pixel_error=1.0)
    cut, everything = session.select(view, budget), reference.select(view, budget)

    def cost() -> float:
        start = time.perf_counter()
        measure(instrument, session, cut, view, pictures=False)
        return (time.perf_counter() - start) * 1e3

    return interleaved(cost, lambda: reference.time_draw(everything, view, False), REPEATS)


def _accuracy(lab: Lab) -> Iterable[Record]:
    """Measured error against the promised one: a report, its ratio says how tight the promise is."""
    spec = "jacksboro"
    store, full = lab.store(spec, "chunked"), lab.store(spec, "full")
    session, reference = store.session(DRAW_OPTIONS), full.session({})
    instrument = _core.Instrument(lab.source(spec).core, reference)
    for pixel_error in (0.5, 1.0, 2.0, 4.0, 8.0):
        lab.say(f"accuracy chunked/{spec}/{pixel_error:g}px")
        rows = []
        for view in lab.views(spec, 12):
            cut = session.select(view, _core.Budget(pixel_error=pixel_error))
            rows.append(measure(instrument, session, cut, view, pictures=False))
        measured = max(r["measured_px_max"] for r in rows)
        predicted = max(r["predicted_px"] for r in rows)
        yield record(
            "accuracy",
            f"chunked/{spec}/{pixel_error:g}px",
            measured,
            "px",
            reference="predicted_px",
            reference_value=predicted,
            ratio=measured / predicted if predicted > 0 else math.nan,
            device=device(),
            options=options_of(store, DRAW_OPTIONS),
            details={
                "measured_px_max_median": float(np.median([r["measured_px_max"] for r in rows])),
                "measured_max": max(r["measured_max"] for r in rows),
                "hole_samples": max(r["hole_samples"] for r in rows),
                "frames": len(rows),
            },
        )


# ---- demo -----------------------------------------------------------------------------------------


# The arguments of `make demo`: a window of the Earth's relief, of which everything costs more than any cut at 1 px.
DEMO = (
    "compare", "earth:window=240/600/1300/1700,vertical_scale=4", "--path", "orbit", "--size", "960x540",
    "--pixel-errors", "1,2,4", "--frames", "30", "--accuracy-frames", "4",
)  # fmt: skip


def _demo(lab: Lab) -> Iterable[Record]:
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


# ---- the face -------------------------------------------------------------------------------------

BENCHES: dict[str, tuple[Callable[[Lab], Iterable[Record]], ...]] = {
    "draw": (_draw, multigrain.draw),
    "select": (_select, multigrain.select),
    "build": (_build, multigrain.build),
    "memory": (_memory, windowed.memory),
    "measure": (_measure,),
    "accuracy": (_accuracy, multigrain.accuracy),
    "cuts": (multigrain.cuts,),
    "demo": (_demo,),
}


def names() -> dict[str, str]:
    """Every benchmark's name with one sentence on it."""
    return {name: (parts[0].__doc__ or "").strip().splitlines()[0] for name, parts in BENCHES.items()}


def run(which: Sequence[str] | None = None, *, say: Say | None = None) -> list[Record]:
    """Runs the named benchmarks, all when none is named.

    Args:
        which: Names of ``names()``.
        say: Called with a line before each case.

    Returns:
        One record a case, in order.

    Raises:
        InvalidInput: An unknown name; the known ones are listed.
    """
    wanted = list(which or BENCHES)
    for name in wanted:
        if name not in BENCHES:
            raise InvalidInput(f"bench: no benchmark {name!r}; known: {', '.join(BENCHES)}")
    out: list[Record] = []
    with tempfile.TemporaryDirectory(prefix="lodlab-bench-") as folder:
        lab = Lab(Path(folder), say or (lambda text: None))
        for name in wanted:
            for part in BENCHES[name]:
                out.extend(part(lab))
    return out


def to_json(records: Sequence[Record]) -> str:
    """Records as JSON text; a figure that is not there (nan) is null."""

    def clean(value: Any) -> Any:
        if isinstance(value, dict):
            return {k: clean(v) for k, v in value.items()}
        if isinstance(value, (float, np.floating)):
            return float(value) if math.isfinite(value) else None
        return value.item() if isinstance(value, np.generic) else value

    return json.dumps([clean(r) for r in records], indent=2)


def bars_file() -> Path:
    """Where the promises stand: the source tree's benchmarks/bars.toml, or the copy that was installed."""
    here = Path(__file__).resolve().parent
    tree = here.parents[2] / "benchmarks" / "bars.toml"
    return tree if tree.exists() else here.parent / "bars.toml"


def _field(record: Record, name: str) -> float:
    """A figure of a record, nan where it is not there; `details.NAME` is one of its details."""
    group, _, detail = name.rpartition(".")
    value = (record.get(group, {}) if group else record).get(detail)
    return math.nan if value is None else float(value)


def check(records: Sequence[Record], bars: Path | None = None) -> list[str]:
    """One line for each bar that does not hold among the benchmarks that ran; empty when all hold.

    A bar whose case was not measured, or measured as nan, does not hold.

    Raises:
        InvalidInput: A bar without bench, case, field or a limit.
    """
    file = bars or bars_file()
    ran = {r["bench"] for r in records}
    failures = []
    for bar in tomllib.loads(file.read_text(encoding="utf-8"))["bar"]:
        if not {"bench", "case", "field"} <= bar.keys() or not {"min", "max"} & bar.keys():
            raise InvalidInput(f"{file}: a bar needs bench, case, field and min or max, not {sorted(bar)}")
        if bar["bench"] not in ran:
            continue
        found = [r for r in records if r["bench"] == bar["bench"] and fnmatch.fnmatchcase(r["case"], bar["case"])]
        if not found:
            failures.append(f"{bar['bench']} {bar['case']}: not measured")
        for one in found:
            value = _field(one, bar["field"])
            where = f"{one['bench']} {one['case']}: {bar['field']} {value:.4g} ({one['unit']})"
            if "min" in bar and not value >= bar["min"]:
                failures.append(f"{where} is below {bar['min']:g}")
            if "max" in bar and not value <= bar["max"]:
                failures.append(f"{where} is above {bar['max']:g}")
    return failures


def table(records: Sequence[Record]) -> str:
    """Records as a text table for people."""
    head = ("bench", "case", "value", "unit", "reference", "reference value", "ratio", "95 % interval")
    rows = [head]
    for r in records:
        interval = "" if math.isnan(r["ratio_low"]) else f"{r['ratio_low']:.3f} to {r['ratio_high']:.3f}"
        numbers = ["" if math.isnan(v) else f"{v:.4g}" for v in (r["value"], r["reference_value"], r["ratio"])]
        rows.append((r["bench"], r["case"], numbers[0], r["unit"], r["reference"], numbers[1], numbers[2], interval))
    widths = [max(len(row[i]) for row in rows) for i in range(len(head))]
    return "\n".join("  ".join(c.ljust(w) for c, w in zip(row, widths, strict=True)).rstrip() for row in rows)
