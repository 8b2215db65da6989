# SPDX-License-Identifier: MIT
"""Progress bars: tqdm's, as widgets in notebooks that have them and as text anywhere else, without a warning of it.

Imported when a bar is first wanted: `from .progress import tqdm`.
"""

from __future__ import annotations

import io
import warnings

from tqdm import TqdmWarning

with warnings.catch_warnings():
    warnings.simplefilter("ignore", TqdmWarning)  # "IProgress not found": text will do
    from tqdm.auto import tqdm

__all__ = ["Progress", "tqdm"]


class Progress:
    """A progress bar in terminal or notebook, fed with (stage, share of it done)."""

    def __init__(self, title: str, shown: bool = True):
        self._title = title
        self._bar = tqdm(
            total=100.0,
            desc=title,
            disable=None if shown else True,
            leave=False,
            bar_format="{desc}: {percentage:3.0f}%|{bar}| {elapsed}",
            file=None if shown else io.StringIO(),
        )

    def stage(self, name: str, share: float) -> None:
        """The core calls this: `share` from 0 to 1 of the stage `name`."""
        self._bar.set_description_str(f"{self._title}: {name}", refresh=False)
        self._bar.n = round(100.0 * min(max(share, 0.0), 1.0), 1)
        self._bar.refresh()

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.close()
