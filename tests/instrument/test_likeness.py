# SPDX-License-Identifier: MIT
"""SSIM and FLIP of the core against the libraries of others: scikit-image, and FLIP's by its authors."""

from __future__ import annotations

import math
from pathlib import Path

import flip_evaluator
import numpy as np
import pytest
from skimage.metrics import structural_similarity

from lodlab import _core, errors, pictures

TOLERANCE = 1e-3
SHAPE = (180, 260)


def plain(*colour: int) -> np.ndarray:
    """A picture of one colour."""
    return np.broadcast_to(np.array([*colour, 255], np.uint8), (*SHAPE, 4))


def noise(seed: int) -> np.ndarray:
    """Every channel of every pixel by itself."""
    return np.random.default_rng(seed).integers(0, 256, (*SHAPE, 4), np.uint8)


def frame() -> np.ndarray:
    """A part of a drawn frame, with sky, ridges and slopes."""
    whole = pictures.load(Path(__file__).parents[2] / "docs" / "img" / "frame.png")
    return whole[200 : 200 + SHAPE[0], 400 : 400 + SHAPE[1]]


def trembling(image: np.ndarray) -> np.ndarray:
    """The same with errors of up to nine steps."""
    tremor = np.random.default_rng(5).integers(-9, 10, image.shape)
    return np.clip(image.astype(int) + tremor, 0, 255).astype(np.uint8)


CHECKS = np.where((np.indices(SHAPE).sum(0) % 2)[..., None], plain(255, 0, 0), plain(0, 0, 255))
PAIRS = {
    "a frame and itself shifted": lambda: (np.roll(frame(), 3, axis=1), frame()),
    "a frame and itself with errors": lambda: (trembling(frame()), frame()),
    "a frame and one colour": lambda: (plain(128, 120, 90), frame()),
    "noise and a frame": lambda: (noise(1), frame()),
    "noise and noise": lambda: (noise(1), noise(2)),
    "two colours": lambda: (plain(200, 180, 60), plain(40, 60, 90)),
    "the two farthest colours": lambda: (plain(0, 255, 0), plain(0, 0, 255)),
    "checks and grey": lambda: (CHECKS, plain(127, 127, 127)),
    "narrower than a filter": lambda: (noise(3)[:12, :11], noise(4)[:12, :11]),
}


@pytest.mark.parametrize("pair", PAIRS.values(), ids=PAIRS)
def test_ssim_and_flip_are_those_of_their_libraries(pair):
    image, reference = pair()
    floats = [p[..., :3].astype(np.float32) / np.float32(255) for p in (reference, image)]
    # The library's own mean sums floats: 1.5 % off on 1920 x 1080 pixels.
    errors_by_pixel, _, _ = flip_evaluator.evaluate(*floats, "LDR", True, False, True)
    assert _core.flip(image, reference) == pytest.approx(float(errors_by_pixel.mean(dtype=float)), abs=TOLERANCE)
    similarity = structural_similarity(
        image[..., :3], reference[..., :3], channel_axis=2, data_range=255, gaussian_weights=True, sigma=1.5,
        use_sample_covariance=False,
    )  # fmt: skip
    assert _core.ssim(image, reference) == pytest.approx(similarity, abs=TOLERANCE)


def test_likeness_does_not_depend_on_threads():
    image, reference = noise(1), frame()
    found = []
    for threads in (1, 3):
        _core.set_thread_count(threads)
        found.append((_core.ssim(image, reference), _core.flip(image, reference)))
    _core.set_thread_count(0)
    assert found[0] == found[1]


def test_equal_pictures_are_exactly_alike():
    for image in (noise(1), frame(), plain(3, 5, 7)):
        assert (_core.ssim(image, image), _core.flip(image, image)) == (1.0, 0.0)


def test_pictures_smaller_than_a_window_have_no_ssim():
    assert math.isnan(_core.ssim(noise(1)[:10], noise(2)[:10]))
    assert 0.0 < _core.flip(noise(1)[:1, :1], noise(2)[:1, :1]) <= 1.0


def test_pictures_that_do_not_compare_are_refused():
    small = noise(1)
    for compare in (_core.ssim, _core.flip):
        with pytest.raises(errors.InvalidInput, match="260 x 180 and 259 x 180 pixels"):
            compare(small, small[:, 1:])
        with pytest.raises(errors.InvalidInput, match=r"\(H, W, 4\) uint8"):
            compare(small[..., :3], small[..., :3])
        with pytest.raises(errors.InvalidInput, match="not empty"):
            compare(small[:, :0], small[:, :0])
