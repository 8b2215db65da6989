# SPDX-License-Identifier: MIT
"""How far a median time can be trusted: bootstrap intervals, runs compared frame by frame, the noise floor.

Efron (1979), percentile intervals, in two levels: passes drawn with replacement, each frame's median over them, then
frames drawn with replacement. That covers what slows a whole pass down (frames alone would miss the truth one time in
three), and is too wide rather than too narrow where nothing does. Runs along one path are compared by the ratio of
their times in each frame, so that what the frames have in common drops out; the noise floor is what that comparison
returns for one run timed twice, early and at the end: no smaller difference is a finding.
"""

from __future__ import annotations

from typing import Any

import numpy as np

RESAMPLES = 1000
LEVEL = 0.95
SEED = 4  # equal times have equal intervals


def median_intervals(times: np.ndarray) -> np.ndarray:
    """(2, C): the ends of the interval of the median frame, for times (passes, frames, C).

    nan for a single time: one number says nothing about its spread.
    """
    passes, frames, columns = times.shape
    if passes * frames < 2:
        return np.full((2, columns), np.nan)
    rng = np.random.default_rng(SEED)
    drawn = np.sort(rng.integers(passes, size=(RESAMPLES, passes)), axis=1)
    sets, which = np.unique(drawn, axis=0, return_inverse=True)  # few: 10 of 3 passes, 126 of 5
    ordered = np.stack([np.sort(np.median(times[chosen], axis=0), axis=0) for chosen in sets])
    medians = ordered[which.ravel()[:, None], _median_ranks(frames, rng)].mean(axis=1)
    return np.quantile(medians, [0.5 - 0.5 * LEVEL, 0.5 + 0.5 * LEVEL], axis=0)


def _median_ranks(n: int, rng: np.random.Generator) -> np.ndarray:
    """(RESAMPLES, 2): the ranks of the middle two of n values that are drawn with replacement from n sorted ones.

    Order statistic k of n uniform numbers is Beta(k, n + 1 - k): the sample itself need not be drawn.
    """
    k = (n + 1) // 2
    low = rng.beta(k, n + 1 - k, RESAMPLES)
    high = low if n % 2 else low + (1.0 - low) * rng.beta(1, n - k, RESAMPLES)
    return np.minimum((np.column_stack([low, high]) * n).astype(int), n - 1)


def ratio(before: np.ndarray, after: np.ndarray) -> tuple[float, float, float]:
    """The median over the frames of `after / before`, and the ends of its interval; nan where too few frames count.

    `before`: (frames,) times; `after`: (frames,) or (passes, frames), of the same frames. Frames in which any is 0
    (below the clock) are left out.
    """
    after = np.atleast_2d(after)
    counts = (before > 0) & (after > 0).all(axis=0)
    if not counts.any():
        return np.nan, np.nan, np.nan
    ratios = after[:, counts] / before[counts]
    low, high = median_intervals(ratios[:, :, None])[:, 0]
    return float(np.median(np.median(ratios, axis=0))), float(low), float(high)


def told_apart(before: np.ndarray, after: np.ndarray, floor: float = 1.0) -> bool:
    """Whether two runs' times of the same frames differ by more than chance and the noise floor (a factor)."""
    _, low, high = ratio(before, after)
    return bool(low > floor or high < 1.0 / floor)


def noise_floor(noise: Any, column: str = "frame_ms") -> float | None:
    """The factor by which one method timed twice differs, from the rows of `noise.csv`; None without them."""
    if noise is None:
        return None
    rows = noise[noise["column"] == column]
    ends = rows[["ratio", "low", "high"]].to_numpy(float)
    ends = ends[np.isfinite(ends) & (ends > 0)]
    return float(np.maximum(ends, 1.0 / ends).max()) if ends.size else None
