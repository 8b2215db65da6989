# SPDX-License-Identifier: MIT
"""Pictures in and out of files and bytes. OpenImageIO where the core has it, else Pillow."""

from __future__ import annotations

import io
import math
import os
from pathlib import Path

import numpy as np

from . import _core
from .errors import InvalidInput

KINDS = (".png", ".jpg", ".jpeg", ".tif", ".tiff")


def check_name(path: str | os.PathLike[str]) -> None:
    """InvalidInput unless a picture can be written there."""
    file = Path(path)
    if file.suffix.lower() not in KINDS:
        raise InvalidInput(f"write picture: {file.name} ends in none of {', '.join(KINDS)}")
    if not file.resolve().parent.is_dir():
        raise InvalidInput(f"write picture: no directory {file.parent}")


def save(path: str | os.PathLike[str], image: np.ndarray) -> None:
    """Writes (H, W, 3 or 4) uint8; the format follows the file's ending. OSError when it cannot be written."""
    check_name(path)
    file = Path(path)
    if hasattr(_core, "write_image"):
        _core.write_image(os.fspath(file), np.ascontiguousarray(image))
        return
    from PIL import Image

    keep = image if file.suffix.lower() in (".png", ".tif", ".tiff") else image[..., :3]
    Image.fromarray(np.ascontiguousarray(keep)).save(file)


def load(path: str | os.PathLike[str]) -> np.ndarray:
    """Reads a PNG or JPEG that a run wrote as (H, W, 4) uint8."""
    from PIL import Image

    with Image.open(path) as image:
        return np.asarray(image.convert("RGBA"))


def encode(image: np.ndarray, width: int | None = None, kind: str = "png", quality: int = 86) -> bytes:
    """The bytes of a PNG or JPEG file, scaled down to `width` pixels when the picture is wider."""
    from PIL import Image

    picture = Image.fromarray(np.ascontiguousarray(image[..., :3]))
    if width is not None and picture.width > width:
        picture = picture.resize((width, max(1, round(picture.height * width / picture.width))), Image.LANCZOS)
    out = io.BytesIO()
    picture.save(out, **({"format": "PNG"} if kind == "png" else {"format": "JPEG", "quality": quality}))
    return out.getvalue()


def difference(image: np.ndarray, reference: np.ndarray) -> tuple[np.ndarray, int]:
    """The absolute difference of two pictures, brightened by a power of two, and that factor.

    The factor is the largest up to 64 at which 95 % of the pixels that differ stay below white.
    """
    delta = np.abs(image[..., :3].astype(np.int16) - reference[..., :3].astype(np.int16))
    largest = delta.max(axis=2)
    changed = largest[largest > 0]
    top = float(np.percentile(changed, 95)) if changed.size else 0.0
    factor = 1
    while factor < 64 and top * factor * 2 <= 255:
        factor *= 2
    bright = np.minimum(delta * factor, 255).astype(np.uint8)
    return np.dstack([bright, np.full(bright.shape[:2], 255, np.uint8)]), factor


# ---- measured error -------------------------------------------------------------------------------

HOLE = (0, 229, 255)  # nowhere near the map's cream, reds and black
_MAP = "magma_r"  # light where the error is small, so that the relief shows
_PAPER = (22, 24, 28, 255)
_WORDS = (232, 230, 225, 255)
_FAINT = (162, 166, 173, 255)
_NARROWEST = 200  # pixels in which the scale can be read; narrower pictures get a margin


def error_picture(image: np.ndarray, error_px: np.ndarray, top: float | None = None) -> np.ndarray:
    """The drawn surface coloured by its measured error, over a scale in pixels: (H', W', 4) uint8.

    `image`: (H, W, 3 or 4) uint8 as drawn; `error_px`: (H, W) pixels, nan where nothing was measured (left as
    drawn), inf over a hole. `top`: pixels at the end of the scale, above which all is one colour; left out, a round
    number that 99.9 % of the picture stays below. Light and shade of the picture show through.
    InvalidInput: sizes that differ, a top that is not positive and finite.
    """
    import matplotlib

    if image.ndim != 3 or image.dtype != np.uint8 or error_px.shape != image.shape[:2]:
        raise InvalidInput(
            f"error picture: image {image.shape} {image.dtype} and errors {error_px.shape}; it takes (H, W, 3 or 4) "
            "uint8 and as many errors as pixels"
        )
    finite = error_px[np.isfinite(error_px)]
    if top is None:
        top = _round_up(float(np.percentile(finite, 99.9)) if finite.size else 0.0)
    if not (math.isfinite(top) and top > 0.0):
        raise InvalidInput(f"error picture: top is {top}; it is positive and finite")
    out = np.dstack([image[..., :3], np.full(image.shape[:2], 255, np.uint8)])
    seen, holes = np.isfinite(error_px), np.isposinf(error_px)
    if finite.size:
        colours = matplotlib.colormaps[_MAP](np.clip(finite / top, 0.0, 1.0), bytes=True)[:, :3]
        out[seen, :3] = np.clip(colours * _relief(image[seen]), 0, 255).astype(np.uint8)
    out[holes, :3] = HOLE
    if out.shape[1] < _NARROWEST:
        blank = np.full((out.shape[0], _NARROWEST - out.shape[1], 4), _PAPER, np.uint8)
        out = np.hstack([out, blank])
    above = bool(finite.size and finite.max() > top)
    return np.vstack([out, _scale(out.shape[1], top, above=above, holes=bool(holes.any()))])


def _relief(pixels: np.ndarray) -> np.ndarray:
    """(N, 1): the factor by which lighter and darker pixels (N, 3 or 4) shade a colour; 1 at their median."""
    light = pixels[:, :3].astype(np.float64) @ (0.299, 0.587, 0.114)
    middle = max(float(np.median(light)), 1.0)
    return np.clip(1.0 + 0.7 * (light - middle) / middle, 0.6, 1.12)[:, None]


def _round_up(value: float) -> float:
    """The next of 1, 1.5, 2, 3, 4, 5, 6, 8 times a power of ten; at least 0.01 px, the slack of the laws."""
    value = max(value, 0.01)
    power = 10.0 ** math.floor(math.log10(value) + 1e-9)
    return next(m * power for m in (1, 1.5, 2, 3, 4, 5, 6, 8, 10) if m * power >= value * (1 - 1e-9))


def _scale(width: int, top: float, *, above: bool, holes: bool) -> np.ndarray:
    """(h, width, 4) uint8: the colours from 0 to `top` with round ticks in pixels, and the colour of holes."""
    import matplotlib
    from matplotlib.ticker import MaxNLocator
    from PIL import Image, ImageDraw, ImageFont

    size = int(np.clip(width / 45, 11, 28))
    font = ImageFont.truetype(os.path.join(matplotlib.get_data_path(), "fonts", "ttf", "DejaVuSans.ttf"), size)
    paper = Image.new("RGBA", (width, round(3.4 * size)), _PAPER)
    pen = ImageDraw.Draw(paper)
    title, hole = "measured error", "hole"
    edge, bar = size, (round(0.6 * size), round(1.5 * size))  # the colours' top and bottom
    left = edge + math.ceil(font.getlength(title)) + size if width > 32 * size else edge
    right = width - edge - (math.ceil(font.getlength(hole)) + 3 * size if holes else size)
    if left > edge:
        pen.text((edge, sum(bar) / 2), title, _WORDS, font, "lm")
    ramp = matplotlib.colormaps[_MAP](np.linspace(0.0, 1.0, right - left), bytes=True)
    paper.paste(Image.fromarray(np.repeat(ramp[None], bar[1] - bar[0], axis=0)), (left, bar[0]))
    pen.rectangle((left - 1, bar[0] - 1, right, bar[1]), None, _FAINT)
    if holes:
        pen.rectangle((right + size, bar[0], right + 2 * size, bar[1] - 1), HOLE)
        pen.text((right + 2.5 * size, sum(bar) / 2), hole, _WORDS, font, "lm")
    ticks = MaxNLocator(max(1, (right - left) // (4 * size)), steps=[1, 2, 5, 10]).tick_values(0.0, top)
    marks = [t for t in ticks if 0.0 <= t < 0.85 * top] + [top]
    for mark in marks:
        x = left + round((right - left - 1) * mark / top)
        pen.line((x, bar[1], x, bar[1] + size // 3), _WORDS)
        text = f"{mark:g}" if mark < top else f"{'≥ ' if above else ''}{mark:g} px"
        pen.text((x, bar[1] + size // 2), text, _WORDS, font, "ma")
    return np.asarray(paper)
