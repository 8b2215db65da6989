# SPDX-License-Identifier: MIT
"""Moving pictures: frames into .mp4 (H.264, by PyAV) and .gif (by Pillow), one at a time, so that a long flight needs
no memory. A file is there whole or not at all.
"""

from __future__ import annotations

import base64
import io
import math
import os
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from .errors import InvalidInput, Unsupported

KINDS = (".mp4", ".gif")
FPS = 30.0
PREVIEW_WIDTH = 480  # pixels of an animation that shows itself

Pictures = Iterable[np.ndarray]  # (H, W, 3 or 4) uint8 each, all of one size


def check_name(path: str | os.PathLike[str]) -> Path:
    """The path; InvalidInput unless a moving picture can be written there, Unsupported for .mp4 without PyAV."""
    file = Path(path)
    if file.suffix.lower() not in KINDS:
        raise InvalidInput(f"write video: {file.name} ends in none of {', '.join(KINDS)}")
    if not file.resolve().parent.is_dir():
        raise InvalidInput(f"write video: no directory {file.parent}")
    if file.suffix.lower() == ".mp4":
        try:
            import av  # noqa: F401
        except ImportError:
            cure = "install it (pip install 'lodlab[video]'), or name a .gif"
            raise Unsupported(f"write video: {file.name} needs PyAV, which is not there; {cure}") from None
    return file


def check_fps(fps: Any) -> float:
    """Frames a second as a number from 1 to 100, which is what .gif can hold."""
    if isinstance(fps, bool) or not isinstance(fps, (int, float)) or not 1.0 <= fps <= 100.0:
        raise InvalidInput(f"write video: fps is {fps!r}; it is a number from 1 to 100")
    return float(fps)


def save(path: str | os.PathLike[str], frames: Pictures, fps: float = FPS) -> None:
    """Writes frames as .mp4 or .gif. InvalidInput for another ending, and for no frame at all."""
    file, fps = check_name(path), check_fps(fps)
    partial = file.with_name(f".{file.name}.{os.getpid()}.partial")
    try:
        with partial.open("wb") as out:
            (_mp4 if file.suffix.lower() == ".mp4" else _gif)(out, iter(frames), fps)
        os.replace(partial, file)
    finally:
        partial.unlink(missing_ok=True)


def _first(frames: Iterator[np.ndarray]) -> np.ndarray:
    for frame in frames:
        return frame
    raise InvalidInput("write video: there is no frame")


def _mp4(out: Any, frames: Iterator[np.ndarray], fps: float) -> None:
    """H.264 with a colour for each two by two pixels, which every player shows; odd sides repeat their last pixels."""
    from fractions import Fraction

    import av

    def even(image: np.ndarray) -> np.ndarray:
        height, width = image.shape[:2]
        return np.pad(image[..., :3], ((0, height % 2), (0, width % 2), (0, 0)), "edge")

    image = even(_first(frames))
    with av.open(out, "w", format="mp4") as container:
        stream = container.add_stream("libx264", rate=Fraction(fps).limit_denominator(1000))
        stream.height, stream.width = image.shape[:2]
        stream.pix_fmt = "yuv420p"
        stream.options = {"crf": "18"}
        while True:
            container.mux(stream.encode(av.VideoFrame.from_ndarray(np.ascontiguousarray(image), format="rgb24")))
            following = next(frames, None)
            if following is None:
                break
            image = even(following)
        container.mux(stream.encode())


def _gif(out: Any, frames: Iterator[np.ndarray], fps: float, width: int | None = None) -> None:
    """256 colours a frame of its own, for ever in turn; its clock has steps of a hundredth of a second."""
    from PIL import Image

    def picture(image: np.ndarray) -> Image.Image:
        made = Image.fromarray(np.ascontiguousarray(image[..., :3]))
        if width is not None and made.width > width:
            made = made.resize((width, max(1, round(made.height * width / made.width))), Image.LANCZOS)
        return made.quantize(256, Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)

    first = picture(_first(frames))
    duration = 10 * max(1, math.floor(100.0 / fps + 0.5))
    others = (picture(image) for image in frames)
    first.save(out, "GIF", save_all=True, append_images=others, duration=duration, loop=0, disposal=1)


class Animation:
    """Frames as a moving picture: shows itself in notebooks, saves as .mp4 or .gif.

    `frames()` gives the pictures anew each time; `len()` is their number, `fps` how many pass in a second.
    """

    def __init__(self, frames: Callable[[], Pictures], count: int, fps: float = FPS):
        self.frames = frames
        self.fps = check_fps(fps)
        self._count = count

    def __len__(self) -> int:
        return self._count

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes it; InvalidInput for another ending than .mp4 and .gif, Unsupported for .mp4 without PyAV."""
        save(path, self.frames(), self.fps)

    def _repr_html_(self) -> str:
        out = io.BytesIO()
        _gif(out, iter(self.frames()), self.fps, PREVIEW_WIDTH)
        data = base64.b64encode(out.getvalue()).decode()
        return f'<img alt="{self._count} frames" style="max-width:100%" src="data:image/gif;base64,{data}">'

    def __repr__(self) -> str:
        return f"<lodlab.Animation of {self._count} frames, {self.fps:g} a second>"
