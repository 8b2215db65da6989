# SPDX-License-Identifier: MIT
"""Benchmarks of the instrument, beside the libraries that measure the same; and the accuracy of `chunked`."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from .. import _core
from ..instrument.metrics import METRICS, measure
from ..runs.configs import DEFAULT_PIXEL_ERRORS
from .costs import DRAW_OPTIONS, TERRAINS
from .lab import REPEATS, Lab, Record, bootstrap_median, device, interleaved, options_of, record


def measure_frames(lab: Lab) -> Iterable[Record]:
    """Milliseconds of one accuracy frame without picture metrics, beside drawing `full` for the same frame."""
    for spec, name in TERRAINS:
        session = lab.store(spec, "chunked").session(DRAW_OPTIONS)
        instrument = _core.Instrument(lab.source(spec).core, lab.store(spec, "full").session({}))
        found = measure_case(lab, f"chunked/{name}", spec, "chunked", DRAW_OPTIONS)
        found["details"] |= _dear_metrics(instrument, session, lab.views(spec, REPEATS))
        yield found
        yield _likeness(instrument, session, lab.views(spec, REPEATS)[2], name)


def measure_case(lab: Lab, case: str, spec: str, method: str, draw: dict[str, Any]) -> Record:
    """A record of `measure`: a 1 px cut under some of the source's views, in turn with drawing `full` there."""
    store, full = lab.store(spec, method), lab.store(spec, "full")
    session, reference = store.session(draw), full.session({})
    instrument = _core.Instrument(lab.source(spec).core, reference)
    lab.say(f"measure {case}")
    views = lab.views(spec, REPEATS)
    frames = [_measure_frame(instrument, session, reference, view) for view in views]
    ours, theirs = (float(np.median([np.median(times[:, k]) for times in frames])) for k in (0, 1))
    ratio, low, high = bootstrap_median(np.array([np.median(times[:, 1] / times[:, 0]) for times in frames]))
    return record(
        "measure",
        case,
        ours,
        "ms/frame",
        reference="drawing full",
        reference_value=theirs,
        ratio=ratio,
        ratio_low=low,
        ratio_high=high,
        device=device(),
        options=options_of(store, draw),
        details={"times_full": 1.0 / ratio, "views": len(frames), "repeats": REPEATS},
    )


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


def accuracy(lab: Lab) -> Iterable[Record]:
    """Measured error against the promised one: a report, its ratio says how tight the promise is."""
    yield from accuracy_cases(lab, "chunked/jacksboro", "jacksboro", "chunked", DRAW_OPTIONS)


def accuracy_cases(lab: Lab, case: str, spec: str, method: str, draw: dict[str, Any]) -> Iterator[Record]:
    """Records of `accuracy` at the pixel errors of `compare`: the largest measured error beside the largest promised
    one, over twelve views."""
    store = lab.store(spec, method)
    session = store.session(draw)
    instrument = _core.Instrument(lab.source(spec).core, lab.store(spec, "full").session({}))
    for pixel_error in DEFAULT_PIXEL_ERRORS:
        name = f"{case}/{pixel_error:g}px"
        lab.say(f"accuracy {name}")
        rows = []
        for view in lab.views(spec, 12):
            cut = session.select(view, _core.Budget(pixel_error=pixel_error))
            rows.append(measure(instrument, session, cut, view, pictures=False))
        measured = max(r["measured_px_max"] for r in rows)
        predicted = max(r["predicted_px"] for r in rows)
        yield record(
            "accuracy",
            name,
            measured,
            "px",
            reference="predicted_px",
            reference_value=predicted,
            ratio=measured / predicted if predicted > _core.SLACK_PIXELS else math.nan,
            device=device(),
            options=options_of(store, draw),
            details={
                "measured_px_max_median": float(np.median([r["measured_px_max"] for r in rows])),
                "measured_max": max(r["measured_max"] for r in rows),
                "hole_samples": max(r["hole_samples"] for r in rows),
                "frames": len(rows),
            },
        )
