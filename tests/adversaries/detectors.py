# SPDX-License-Identifier: MIT
"""Adversaries put through the lab as any method is, and the detectors that look at what came out.

A flight is two runs: a camera that moves along an arc from which all of the source is seen, and a still one. Pops
are looked at in the first, where the honest choice never changes; of the second the law `still` speaks. Sources are a
field, and a mesh of two components, one of them open.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import lodlab as lod
from lodlab import instrument, laws
from lodlab.instrument import metrics, yardstick
from lodlab.runs import passes, tables
from lodlab.runs.flight import Flight

ROOMS = Path(__file__).parents[2] / "cpp" / "methods"
#: Every method of this core that is no room of the house.
MADE_ANEW = "made_anew"  # no adversary: the method that scripts/new_method.py makes (test_made_anew)
ADVERSARIES = [m["name"] for m in lod.methods() if not (ROOMS / m["name"]).is_dir() and m["name"] != MADE_ANEW]
SIZE = (320, 200)
FOV = 40.0
MOVING, STILL = "moving", "still"
LOOSE = {"pixel_error": 12.0}  # the coarser resolution is enough for it all along the arc
POP_PX = 1.0  # a jump of a pixel: more than the honest ever make, and what pop_area counts


def accepting(kind: str) -> list[str]:
    """The adversaries that accept sources of this kind."""
    return [m["name"] for m in lod.methods() if m["name"] in ADVERSARIES and kind in m["accepts"]]


def ball_and_bowl() -> lod.Mesh:
    """A closed fractal ball, and beside it half of a sphere, which is open."""
    ball, sphere = lod.datasets.load("blob:size=13"), lod.datasets.load("icosphere:level=3")
    lower = sphere.positions[sphere.faces][:, :, 2].max(axis=1) < 0.1
    positions = np.vstack([ball.positions, 0.6 * sphere.positions + [0.9, -1.6, 0.0]])
    return lod.Mesh(positions, np.vstack([ball.faces, sphere.faces[lower] + len(ball.positions)]))


class Range:
    """A source, what it is measured against, and the adversaries built on it."""

    def __init__(self, folder: Path, kind: str = "heightfield") -> None:
        self.folder = folder
        if kind == "mesh":
            self.source, self.middle, self.away, self.above = ball_and_bowl(), np.array([0.4, -0.7, 0.0]), 9.0, 3.0
        else:
            self.source = lod.datasets.load("fractal:size=129,seed=3")
            self.middle, self.away, self.above = np.array([64.0 * 30.0, -64.0 * 30.0, 2000.0]), 7000.0, 1500.0
        self.yardstick = yardstick.Yardstick(self.source, folder / "stores", progress=False)
        self.moving = lod.CameraPath.from_keys([self._key(t) for t in (0.0, 0.5, 1.0)], 3, FOV, MOVING)
        self.still = lod.CameraPath.still(self.source, 3)
        self._stores: dict[Any, Any] = {}

    def _key(self, t: float) -> dict[str, Any]:
        """Low in the south-west, more than the source's side away from its middle, turning by 17 degrees.

        The crack of the field is in a side that faces east, lifted: from here it hides itself, and no picture shows it.
        """
        angle = math.radians(-130.0 + 17.0 * t)
        away = np.array([self.away * math.cos(angle), self.away * math.sin(angle), self.above])
        return {"t": t, "eye": (self.middle + away).tolist(), "target": self.middle.tolist()}

    @property
    def pixel(self) -> float:
        """The height in source units that a pixel of the first view of the arc spans in its middle."""
        return self.away / (0.5 * SIZE[0] / math.tan(math.radians(0.5 * FOV)))

    def store(self, method: str, gap: float = 0.0) -> Any:
        """`method` built on the source; `gap`: in pixels."""
        key = (method, gap)
        if key not in self._stores:
            file = self.folder / f"{method}-{len(self._stores)}.lod"
            self._stores[key] = lod.build(self.source, method, file, progress=False, gap=gap * self.pixel)
        return self._stores[key]

    def fly(self, method: str, budget: Mapping[str, Any] = LOOSE, gap: float = 0.0) -> Evidence:
        """Both runs of a method, measured in every frame."""
        store, parts = self.store(method, gap), []
        for path in (self.moving, self.still):
            flight = Flight(
                f"{method}-{path.name}", self.source.spec, path.name, dict(budget), {}, len(path), SIZE,
                accuracy_frames=len(path),
            )  # fmt: skip
            flown = passes.perform(store, path, flight, yardstick=self.yardstick)
            parts.append(tables.table(flown.rows, tables.FRAME_COLUMNS))
        return Evidence(store, pd.concat(parts, ignore_index=True))


@dataclass(frozen=True)
class Evidence:
    """What the lab says of an adversary: the rows of its frames, and its store."""

    store: Any
    frames: Any

    @property
    def moving(self) -> Any:
        return self.frames[self.frames["path"] == MOVING]

    @property
    def still(self) -> Any:
        return self.frames[self.frames["path"] == STILL]

    @cached_property
    def audit(self) -> Any:
        return instrument.audit(self.store, progress=False)


@dataclass(frozen=True)
class Detector:
    """`fires(evidence)`, and `disable(monkeypatch)`: how the lab loses it."""

    fires: Callable[[Evidence], bool]
    disable: Callable[[pytest.MonkeyPatch], None]


def without_metric(patch: pytest.MonkeyPatch, name: str) -> None:
    """The metric's function is replaced by one that sees nothing."""
    blind = [metrics.Metric(m.name, m.unit, m.text, lambda _: 0.0) if m.name == name else m for m in metrics.METRICS]
    patch.setattr(metrics, "METRICS", tuple(blind))


def _column(name: str, limit: float) -> Detector:
    return Detector(lambda e: bool((e.moving[name] > limit).any()), lambda patch: without_metric(patch, name))


def _law(name: str) -> Detector:
    def fires(evidence: Evidence) -> bool:
        return any(v.law == name and v.verdict == laws.BROKEN for v in laws.judge(evidence.frames, SIZE[0], FOV))

    def disable(patch: pytest.MonkeyPatch) -> None:
        patch.setattr(laws, "LAWS", tuple(law for law in laws.LAWS if law.name != name))

    return Detector(fires, disable)


def _without_audit(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(instrument.Audit, "broken", property(lambda audit: audit.nodes[:0]))


# `met` and `cracks` never break, and `baseline` is a law for `full`: tests/test_laws.py breaks it.
DETECTORS: dict[str, Detector] = {
    **{law.name: _law(law.name) for law in laws.LAWS if law.name not in ("met", "cracks", "baseline")},
    "crack_edges": _column("crack_edges", 0),
    "crack_pixels": _column("crack_pixels", 0),
    "pop_px_max": _column("pop_px_max", POP_PX),
    "pop_area": _column("pop_area", 0.0),
    "audit": Detector(lambda e: len(e.audit.broken) > 0, _without_audit),
}


def caught(evidence: Evidence) -> set[str]:
    """The names of the detectors that fire."""
    return {name for name, detector in DETECTORS.items() if detector.fires(evidence)}
