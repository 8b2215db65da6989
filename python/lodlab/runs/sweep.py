# SPDX-License-Identifier: MIT
"""Sweeps and comparisons: the runs over a grid (see `configs`), as tables."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..errors import InvalidInput
from ..figures import html_of
from . import tables
from .run import Run


class Sweep:
    """The results of a comparison or sweep.

    `frames`, `summary`: DataFrames (`frames.csv`, `summary.csv`); `noise`: that of `noise.csv` (one run timed
    twice), None where there is none; `directory`: where they lie on disk.
    """

    def __init__(self, directory: Path | None, frames: Any, summary: Any, noise: Any = None):
        self.directory = directory
        self.frames = frames
        self.summary = summary
        self.noise = noise
        self._keep: Any = None

    @classmethod
    def load(cls, directory: str | os.PathLike[str]) -> Sweep:
        """Reads a run directory."""
        folder = Path(directory)
        if not folder.is_dir():
            raise InvalidInput(f"read results: no directory {folder}")
        frames, summary = tables.read_runs(folder)
        return cls(folder, frames, summary, tables.read_noise(folder))

    @classmethod
    def of(cls, runs: Sequence[Run]) -> Sweep:
        """Runs made one by one, as one result."""
        import pandas as pd

        if not runs:
            raise InvalidInput("sweep: no runs")
        frames = pd.concat([run.frames for run in runs], ignore_index=True)
        return cls(None, frames, tables.summary_table([run.summary for run in runs]))

    @property
    def runs(self) -> list[str]:
        """The names of the runs."""
        return self.summary["run"].tolist()

    def run(self, name: str) -> Run:
        """One run by its name."""
        if name not in self.runs:
            raise InvalidInput(f"run {name!r} is not here; there are {', '.join(self.runs)}")
        frames = self.frames[self.frames["run"] == name].reset_index(drop=True)
        row = self.summary[self.summary["run"] == name].iloc[0].to_dict()
        return Run(frames, row, self.directory)

    def __repr__(self) -> str:
        return f"<lodlab.Sweep of {len(self.runs)} runs{f' in {self.directory}' if self.directory else ''}>"

    def _repr_html_(self) -> str:
        return html_of(self)
