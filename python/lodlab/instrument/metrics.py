# SPDX-License-Identifier: MIT
"""The accuracy columns: one table, a row a metric. A new metric is one function of a measurement and one row.

A measurement (`_core.Measurement`) is one drawn cut under one view; what the core measures are properties of
it, named as the columns. nan: undefined, by the rule that the row tells; inf: a hole, or, for `psnr_db`, equal
pictures.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from .._core import SLACK_PIXELS, world_slack

Figure = Callable[[Any], float]

BASELINE = "full"  # the method that draws everything


@dataclass(frozen=True)
class Metric:
    """One accuracy column: `of(measurement)` is its value, `unit` and `text` tell what it is."""

    name: str
    unit: str
    text: str
    of: Figure
    smaller_is_worse: bool = False


# ---- the table ------------------------------------------------------------------------------------


def _core(name: str, unit: str, text: str, smaller_is_worse: bool = False) -> Metric:
    """A row for a property of the core's measurement."""
    return Metric(name, unit, text, lambda measurement: getattr(measurement, name), smaller_is_worse)


_SEES_NOTHING = "nan when the view sees nothing"
_COMPARES = "against the full-resolution reference; nan without one, and where both show nothing"
_NO_OPTIMUM = "nan where the method knows no optimum or a hard budget is broken, below 0 within a pixel error"
_ONE_WAY = "nan on height fields, which know one direction only"
_UNDECIDED = "nan when less than a tenth of the covered ones is farther from a silhouette than errors reach"
METRICS: tuple[Metric, ...] = (
    _core("predicted_px", "px", "The method's claim: the largest projected bound among visible nodes."),
    _core("measured_px_max", "px", f"Largest screen error over source samples in view; {_SEES_NOTHING}."),
    _core("measured_px_p99", "px", f"Screen error that 99 % of the reference's pixels keep to; {_SEES_NOTHING}."),
    _core("measured_px_rms", "px", f"Root mean square over the reference's pixels; {_SEES_NOTHING}."),
    _core("measured_max", "source units", "Largest distance over all source samples, without projection."),
    _core("measured_rms", "source units", "Root mean square over all source samples."),
    _core("hole_samples", "count", "Source samples that no surface triangle covers."),
    _core("measured_samples", "count", "Source samples that are not void.", smaller_is_worse=True),
    _core("psnr_db", "dB", f"Peak signal-to-noise ratio {_COMPARES}; inf when equal.", smaller_is_worse=True),
    _core("crack_edges", "count", "Directed edges of the surface without exactly one opposite, border apart."),
    _core("crack_pixels", "px", f"Pixels of clear colour or inside where the reference shows outside; {_UNDECIDED}."),
    _core("capture_mismatch_pixels", "px", "Pixels where the capture, drawn again, is not what was drawn."),
    _core("crack_mask_share", "1", "Share of covered pixels looked at for cracks.", smaller_is_worse=True),
    _core("ssim", "1", f"Structural similarity (Wang et al. 2004) {_COMPARES}; 1 when equal.", smaller_is_worse=True),
    _core("flip", "1", f"Mean FLIP error (Andersson et al. 2020; 67 pixels a degree) {_COMPARES}; 0 when equal."),
    _core("pop_px_max", "px", "Largest jump from the frame before's cut, under this view; nan in a first frame."),
    _core("pop_area", "1", "Share of pixels that jump more than one pixel; nan in a first frame."),
    _core("inverted_triangles", "count", "Surface triangles that turn their inside to the outside."),
    _core("slanted_filler_triangles", "count", "Fillers that are not vertical, and so could pass for surface."),
    _core("optimum_gap", "1", f"predicted_px / what its hierarchy's best cut would have - 1; {_NO_OPTIMUM}."),
    _core("raised_filler_triangles", "count", "Fillers that rise above the drawn surface, and so could hide it."),
    _core("drawn_triangles", "count", "Triangles that the GPU counted in the picture; nan without one."),
    _core("measured_max_source_to_drawn", "source units", f"Largest distance from the source's surface; {_ONE_WAY}."),
    _core("measured_max_drawn_to_source", "source units", f"Largest distance from the drawn surface; {_ONE_WAY}."),
    _core("measured_rms_source_to_drawn", "source units", f"Root mean square from the source's surface; {_ONE_WAY}."),
    _core("measured_rms_drawn_to_source", "source units", f"Root mean square from the drawn surface; {_ONE_WAY}."),
)  # fmt: skip


def measure(
    instrument: Any,
    session: Any,
    cut: Any,
    view: Any,
    reference: Any = None,
    *,
    pictures: bool = True,
    before: Any = None,
) -> dict[str, float]:
    """Every metric of one drawn cut, by name.

    `instrument`, `session`, `cut`, `reference`: the core's. Without a reference the columns that compare with it
    are nan; without `pictures` all that draw one are. `before`: the cut of the frame before, for pops. InvalidInput
    for a reference of another view, and for a drawn vertex that is not finite (naming method and node).
    """
    measurement = instrument.examine(session, cut, view, reference, pictures, before)
    return {metric.name: metric.of(measurement) for metric in METRICS}


def pixel_slack(view: Any) -> float:
    """The one slack of the laws in pixels of a view: the instrument's, and float steps at the distance to the eye."""
    wide = math.tan(math.radians(view.fov) / 2.0)
    high = wide * view.size[1] / view.size[0]
    per_metre = view.size[0] / (2.0 * wide) * math.sqrt(1.0 + wide * wide + high * high)
    return SLACK_PIXELS + per_metre * world_slack(1.0)
