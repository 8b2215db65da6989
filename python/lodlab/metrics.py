# SPDX-License-Identifier: MIT
"""The accuracy columns: one table, a row a metric. A new metric is one function of a measurement and one row.

A measurement (`_core.Measurement`) is one drawn cut under one view; what the core measures are properties of
it, named as the columns, and picture metrics of Python's libraries are functions here. nan: undefined, by the
rule that the row tells; inf: a hole, or, for `psnr_db`, equal pictures.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from .errors import InvalidInput

Figure = Callable[[Any], float]


@dataclass(frozen=True)
class Metric:
    """One accuracy column: `of(measurement)` is its value, `unit` and `text` tell what it is."""

    name: str
    unit: str
    text: str
    of: Figure
    smaller_is_worse: bool = False


# ---- pictures -------------------------------------------------------------------------------------


def ssim_of(image: np.ndarray, reference: np.ndarray) -> float:
    """Structural similarity of two (H, W, 4) uint8 pictures: the mean over red, green and blue, 1 when they are equal.

    Windows and constants of Wang et al. 2004 (Gaussian, sigma 1.5; K1 0.01, K2 0.03). nan for pictures with less
    than 11 pixels a side, its window. InvalidInput when the sizes differ.
    """
    from skimage.metrics import structural_similarity

    _check_sizes("ssim", image, reference)
    if min(image.shape[:2]) < 11:
        return math.nan
    return float(
        structural_similarity(
            image[..., :3], reference[..., :3], channel_axis=2, data_range=255, gaussian_weights=True, sigma=1.5,
            use_sample_covariance=False,
        )
    )  # fmt: skip


def flip_of(image: np.ndarray, reference: np.ndarray) -> float:
    """Mean FLIP error (Andersson et al. 2020, LDR, 67 pixels a degree) of two (H, W, 4) uint8 pictures.

    0 when they are equal, at most 1. InvalidInput when the sizes differ. The mean is taken here, in double: the
    library's own sums floats, and is 1.5 % off on a picture of 1920 x 1080.
    """
    import flip_evaluator

    _check_sizes("flip", image, reference)
    wanted, found = (p[..., :3].astype(np.float32) / np.float32(255) for p in (reference, image))
    errors, _, _ = flip_evaluator.evaluate(wanted, found, "LDR", True, False, True)
    return float(errors.mean(dtype=np.float64))


def _check_sizes(metric: str, image: np.ndarray, reference: np.ndarray) -> None:
    if image.shape != reference.shape:
        raise InvalidInput(f"{metric}: pictures of {image.shape} and {reference.shape} do not compare")


def _against_reference(compare: Callable[[np.ndarray, np.ndarray], float]) -> Figure:
    """A figure of the drawn picture against the reference's; nan without one."""

    def of(measurement: Any) -> float:
        reference = measurement.reference
        return math.nan if reference is None else compare(measurement.image, reference.image)

    return of


# ---- the table ------------------------------------------------------------------------------------


def _core(name: str, unit: str, text: str, smaller_is_worse: bool = False) -> Metric:
    """A row for a property of the core's measurement."""
    return Metric(name, unit, text, lambda measurement: getattr(measurement, name), smaller_is_worse)


_SEES_NOTHING = "nan when the view sees nothing"
_COMPARES = "against the full-resolution reference; nan without one"
_NO_OPTIMUM = "nan where the method knows no optimum or a hard budget is broken, below 0 within a pixel error"
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
    _core("crack_pixels", "px", "Pixels of clear colour or inside where the reference shows outside."),
    _core("capture_mismatch_pixels", "px", "Pixels where the capture, drawn again, is not what was drawn."),
    _core("crack_mask_share", "1", "Share of covered pixels looked at for cracks.", smaller_is_worse=True),
    Metric(
        "ssim", "1", f"Structural similarity {_COMPARES}.", _against_reference(ssim_of), smaller_is_worse=True
    ),
    Metric("flip", "1", f"Mean FLIP error {_COMPARES}.", _against_reference(flip_of)),
    _core("pop_px_max", "px", "Largest jump from the frame before's cut, under this view; nan in a first frame."),
    _core("pop_area", "1", "Share of pixels that jump more than one pixel; nan in a first frame."),
    _core("inverted_triangles", "count", "Surface triangles that turn their inside to the outside."),
    _core("slanted_filler_triangles", "count", "Fillers that are not vertical, and so could pass for surface."),
    _core("optimum_gap", "1", f"predicted_px / what its hierarchy's best cut would have - 1; {_NO_OPTIMUM}."),
    _core("raised_filler_triangles", "count", "Fillers that rise above the drawn surface, and so could hide it."),
    _core("drawn_triangles", "count", "Triangles that the GPU counted in the picture; nan without one."),
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
