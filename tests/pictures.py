# SPDX-License-Identifier: MIT
"""Comparing pictures in tests: on failure the image, its reference and their difference are written."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from lodlab import _core


def folder() -> Path:
    """Where failures go: LODLAB_TEST_PICTURES, else runs/tests below the current folder."""
    path = Path(os.environ.get("LODLAB_TEST_PICTURES", "runs/tests"))
    path.mkdir(parents=True, exist_ok=True)
    return path


def assert_same_picture(
    image: np.ndarray, reference: np.ndarray, name: str, *, level: int, share: float, why: str
) -> None:
    """At most `share` of the pixels differ by more than `level` of 255 in any channel.

    `image`, `reference`: (H, W, 4) uint8. `why` is the reason for the tolerance, repeated on failure.
    """
    assert image.shape == reference.shape, f"{name}: {image.shape} against {reference.shape}"
    difference = np.abs(image[..., :3].astype(int) - reference[..., :3].astype(int)).max(axis=2)
    found = float((difference > level).mean())
    if found <= share:
        return
    grey = np.repeat(np.clip(difference * 4, 0, 255).astype(np.uint8)[..., None], 3, axis=2)
    for suffix, picture in (("image", image), ("reference", reference), ("difference", grey)):
        _core.write_image(str(folder() / f"{name}-{suffix}.png"), np.ascontiguousarray(picture[..., :3]))
    raise AssertionError(
        f"{name}: {100 * found:.3f} % of the pixels differ by more than {level}; at most {100 * share:.3f} % may "
        f"({why}); pictures in {folder().resolve()}"
    )
