# SPDX-License-Identifier: MIT
"""Pictures in and out of files and bytes. OpenImageIO where the core has it, else Pillow."""

from __future__ import annotations

import io
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
