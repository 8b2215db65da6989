# SPDX-License-Identifier: MIT
"""One trial of the random search again, and what it breaks made smaller.

    python -m lodlab.stability.replay METHOD SEED INDEX

Prints every broken law, what was refused, and Python that plays the smallest trial found that still breaks the first.
"""

from __future__ import annotations

import itertools
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from .search import LAWS, STAGES, play
from .trials import Trial, draw_trial

#: The plainest source: of a field, of a mesh.
PLAIN: dict[str, Any] = {
    "voids": None,
    "base": 0.0,
    "shape": "flat",
    "height": 1.0,
    "origin": [0.0, 0.0],
    "spacing": [1.0, 1.0],
    "damage": None,
    "mesh": "ball",
    "stretch": [1.0, 1.0, 1.0],
    "size": 1.0,
    "shift": [0.0, 0.0, 0.0],
}


def shrink(trial: Trial, law: str, seconds: float = 60.0) -> Trial:
    """A simpler trial that breaks the same law: fewer frames, default options, a smaller and plainer source."""
    end = time.monotonic() + seconds

    def breaks(other: Trial) -> bool:
        with tempfile.TemporaryDirectory() as folder:
            return any(name == law for name, _ in play(other, Path(folder)).broken)

    simpler = True
    while simpler and time.monotonic() < end:
        simpler = False
        for other in _simpler(trial):
            if time.monotonic() > end:
                break
            if breaks(other):
                trial, simpler = other, True
                break
    return trial


def _simpler(trial: Trial) -> Iterator[Trial]:
    """Trials with one thing less."""
    for i in range(len(trial.frames) if len(trial.frames) > 1 else 0):
        yield replace(trial, frames=[trial.frames[i]])
    for i in range(len(trial.frames) if len(trial.frames) > 2 else 0):
        yield replace(trial, frames=trial.frames[:i] + trial.frames[i + 1 :])
    for stage in STAGES:
        for name in getattr(trial, stage):
            if name != "stream":
                yield replace(trial, **{stage: {k: v for k, v in getattr(trial, stage).items() if k != name}})
    for key, value in PLAIN.items():
        if trial.source.get(key, value) != value:
            yield replace(trial, source=trial.source | {key: value})
    sizes = [key for key in ("rows", "cols", "detail", "parts") if key in trial.source]
    for key, least in itertools.product(sizes, (1, 2, 3, 5, 9)):
        if trial.source[key] > least > (key in ("rows", "cols")):
            yield replace(trial, source=trial.source | {key: least})
    for key in sizes:
        half = trial.source[key] // 2
        if half > 9:
            yield replace(trial, source=trial.source | {key: half})
    for i, frame in enumerate(trial.frames):
        view = frame["view"]
        for key, value in {"fov": 60.0, "size": [96, 64], "near": None, "up": None, "at": [0.0, 0.0]}.items():
            if view[key] != value:
                frames = list(trial.frames)
                frames[i] = frame | {"view": view | {key: value}}
                yield replace(trial, frames=frames)


def snippet(trial: Trial) -> str:
    """Python that plays a trial."""
    values = {k: getattr(trial, k) for k in ("method", "kind", "source", "build", "draw", "frames", "seed")}
    arguments = ",\n    ".join(f"{key}={value!r}" for key, value in values.items())
    return (
        "import pathlib, tempfile\nfrom lodlab.stability.search import Trial, play\n"
        f"trial = Trial(\n    {arguments},\n)\n"
        "print(play(trial, pathlib.Path(tempfile.mkdtemp())).broken)"
    )


def main(method: str, seed: int, index: int) -> int:
    """Plays one trial, prints what it broke and the smallest trial that still does; 1 when it broke anything."""
    trial = draw_trial(method, seed, index)
    with tempfile.TemporaryDirectory() as folder:
        found = play(trial, Path(folder))
    for law, text in found.broken:
        print(f"{law}: {LAWS[law]}\n  {text}")
    for reason in found.refused:
        print(f"refused: {reason}")
    if found.broken:
        print(snippet(shrink(trial, found.broken[0][0])))
    else:
        print(f"{sum(found.checks.values())} checks, nothing is broken")
    return 1 if found.broken else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3])))
