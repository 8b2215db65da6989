# SPDX-License-Identifier: MIT
"""Arrays as the samples of a height field: which are real, their heights as 32-bit floats, and what is refused."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..errors import InvalidInput
from .plausible import marked

MAX_SAMPLES = 2**31
EXACT_IN_FLOAT32 = 2**24
_ROWS = 256  # that are computed in double together


def as_array(values: Any, name: str) -> np.ndarray:
    """What the caller gave as an array; rows of different lengths are no array."""
    try:
        return np.asarray(values)
    except ValueError as error:
        raise InvalidInput(f"height field: {name} is no array: {error}") from None


def check_array(array: np.ndarray, name: str) -> None:
    if array.dtype.kind not in "iuf":
        raise InvalidInput(f"height field: {name} has dtype {array.dtype}; real numbers are needed")
    if array.ndim != 2:
        raise InvalidInput(f"height field: {name} has {array.ndim} dimensions, shape {array.shape}; 2 are needed")
    if min(array.shape) < 2:
        raise InvalidInput(f"height field: {name} has shape {array.shape}; at least 2 x 2 samples are needed")
    if array.shape[0] * array.shape[1] > MAX_SAMPLES:
        raise InvalidInput(f"height field: {name} has shape {array.shape}: more than 2^31 samples")


def valid_mask(array: np.ndarray, marks: tuple[float, ...], given: np.ndarray | None) -> np.ndarray | None:
    """(H, W) bool, or None when every sample is real."""
    void = np.isnan(array) if array.dtype.kind == "f" else None
    for mark in marks:
        if (here := marked(array, mark)) is not None:
            void = here if void is None else void | here
    if given is not None:
        void = ~given if void is None else void | ~given
    return ~void if void is not None and void.any() else None


def to_float32(array: np.ndarray, scale: float, offset: float) -> np.ndarray:
    """array * scale + offset, computed in double and rounded once, as C-contiguous float32."""
    out = np.empty(array.shape, np.float32)
    with np.errstate(over="ignore", invalid="ignore"):
        if scale == 1.0 and offset == 0.0:
            np.copyto(out, array, casting="unsafe")
        elif offset == 0.0:
            np.multiply(array, scale, out=out, dtype=np.float64, casting="unsafe")
        else:
            for row in range(0, len(array), _ROWS):
                out[row : row + _ROWS] = array[row : row + _ROWS].astype(np.float64) * scale + offset
    return out


def height_step(array: np.ndarray, valid: np.ndarray | None, scale: float, offset: float) -> float:
    """The step of integer heights: all real samples are whole multiples of it. 0: unknown."""
    if array.dtype.kind == "f" or offset != 0.0:
        return 0.0
    where = True if valid is None else valid
    low = int(np.min(array, where=where, initial=np.iinfo(array.dtype).max))
    high = int(np.max(array, where=where, initial=np.iinfo(array.dtype).min))
    return abs(scale) if max(abs(low), abs(high)) <= EXACT_IN_FLOAT32 else 0.0


def check_finite(heights: np.ndarray, valid: np.ndarray | None, array: np.ndarray, name: str, scaled: str) -> None:
    bad = np.isinf(heights) if valid is None else np.isinf(heights) & valid
    if bad.any():
        row, col = np.unravel_index(int(np.argmax(bad)), bad.shape)
        raise InvalidInput(
            f"height field: {name} has height {array[row, col]} at row {row}, column {col}{scaled}; "
            "heights are finite and fit float32"
        )
