# SPDX-License-Identifier: MIT
"""Runs: one store along one path under one budget, as a table and, where asked, as a run directory."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import Any

from .. import pictures
from ..errors import InvalidInput, check_one_of
from ..figures import html_of
from ..instrument.yardstick import PICTURE_SAMPLES
from ..movies import FPS, Animation
from ..stores.session import SHOWS, Frame
from . import tables
from .passes import (
    Flown,
    check_capture,
    worst_folder,
    worst_frame,
)
from .replays import fly_again


class Run:
    """The frames of one store along one path under one budget.

    `frames`: DataFrame, a row a frame (columns of `frames.csv`); `summary`: dict, the row of `summary.csv`;
    `directory`: where it lies on disk, or None.
    """

    def __init__(self, frames: Any, summary: dict[str, Any], directory: Path | None = None, flown: Flown | None = None):
        self.frames = frames
        self.summary = summary
        self.directory = directory
        self._flown = flown

    @property
    def name(self) -> str:
        """The run's name: method, what varies, budget."""
        return self.summary["run"]

    def image(self, frame: int | None = None, show: str = "shade") -> Frame:
        """The picture of a frame (default: the worst one), drawn again from its recorded cut.

        `show`: shade, normal, level, wire, reference, or error (measured, in pixels, with its scale below). A run read
        from disk shows the pictures that it wrote; others are drawn again from its source and path, and InvalidInput
        says why where that cannot be: streamed runs, arrays that were too large to keep, what has changed since.
        """
        f = worst_frame(self.frames.to_dict("records")) if frame is None else int(frame)
        if not 0 <= f < len(self.frames):
            raise InvalidInput(f"image: frame {f} of run {self.name}; it has frames 0 to {len(self.frames) - 1}")
        check_one_of("image: show", show, (*SHOWS, "reference", "error"))
        if self._flown is None:
            written = self._written(f, show)
            if written is not None:
                return written
            if self.directory is None:
                raise InvalidInput(f"image: run {self.name} is not in this process and has no run directory")
            self._flown = fly_again(self)
        return self._drawn(self._flown, f, show)

    def _written(self, f: int, show: str) -> Frame | None:
        """A picture that the run wrote, or None."""
        if self.directory is None:
            return None
        shade = self.directory / "images" / self.name / f"{f:06d}.png"
        file = shade if show == "shade" else worst_folder(self.directory, self.name) / f"{f:06d}-{show}.png"
        return Frame(pictures.load(file)) if file.exists() else None

    def _drawn(self, flown: Flown, f: int, show: str) -> Frame:
        """A frame drawn again from its recorded cut."""
        cut, view = flown.recording.cuts[f], flown.recording.views[f]
        if show == "wire":
            return Frame(flown.session.wire(cut, view).image)
        if show in ("reference", "error") and flown.yardstick is None:
            raise InvalidInput(f"image: run {self.name} was not measured, so it has no picture {show!r}")
        if show == "error":
            return Frame(flown.yardstick.error_picture(flown.session, cut, view))
        if show == "reference":
            reference = flown.yardstick.reference(view, cut)
            if reference is None:
                why = f"above {PICTURE_SAMPLES} samples" if flown.yardstick.metrics == "all" else "metrics='geometry'"
                raise InvalidInput(f"image: run {self.name} has no reference ({why})")
            return Frame(reference.image, reference.depth)
        drawn = flown.session.draw(cut, view, show)
        return Frame(drawn.image, drawn.depth)

    def animation(self, show: str = "shade", fps: float = FPS) -> Animation:
        """All frames as a moving picture, each as `image` shows it; `.save("run.mp4")` or `.gif` writes it.

        `fps`: frames a second, 1 to 100. Frames are drawn when it is saved or shown.
        """
        count = len(self.frames)
        return Animation(lambda: (self.image(f, show).image for f in range(count)), count, fps)

    def __repr__(self) -> str:
        s = self.summary
        worst = s["measured_px_max_worst"]
        seen = f"worst {worst:.3g} px" if not math.isnan(worst) else "nothing in view"
        return (
            f"<lodlab.Run {self.name}: {len(self.frames)} frames, median {s['frame_ms_median']:.3g} ms, "
            f"{s['triangles_median']:.0f} triangles, {seen if s['accuracy_frames'] else 'not measured'}>"
        )

    def _repr_html_(self) -> str:
        return html_of(self)


def load(directory: str | os.PathLike[str], name: str | None = None) -> Run:
    """A run read from a run directory; `name` may be left out when it holds one run only."""
    folder = Path(directory)
    frames, summary = tables.read_runs(folder)
    names = summary["run"].tolist()
    if name is None and len(names) == 1:
        name = names[0]
    if name not in names:
        raise InvalidInput(f"load: run {name!r} in {folder}; it holds {', '.join(names) or 'none'}")
    frames = frames[frames["run"] == name].reset_index(drop=True)
    run = Run(frames, summary[summary["run"] == name].iloc[0].to_dict(), folder)
    check_capture(run.frames)
    return run
