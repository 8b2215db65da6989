# SPDX-License-Identifier: MIT
"""Places the labels of a chart's points so that they cover neither points, nor curves, nor each other.

Greedy: each label tries a few places round its point and takes the one that covers least. Sizes are
estimated from the font size, so that no drawing is needed; everything is in points (1/72 inch) of the panel.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

# Where a label may stand: direction from its point, in the order of preference.
BESIDE = ((1, 1), (1, -1), (-1, 1), (-1, -1), (0, 1), (0, -1))
ABOVE = ((0, 1), (-1, 1), (-1, 0), (-1, -1), (1, 1), (0, -1))
DISTANCES = (0.0, 6.0, 12.0, 18.0)
LETTER = 0.6  # of the font size: the mean width of a letter
LINE = 1.15
AIR = 4.0  # points left and right of a label


@dataclass
class Label:
    """A text for the point (x, y), in points of the panel; `place` fills in (dx, dy), its centre's offset."""

    text: str
    x: float
    y: float
    size: float
    places: tuple[tuple[int, int], ...] = BESIDE
    dx: float = 0.0
    dy: float = 0.0

    @property
    def half(self) -> tuple[float, float]:
        """Half its width and height."""
        return 0.5 * LETTER * self.size * len(self.text), 0.5 * LINE * self.size

    def box(self, dx: float, dy: float) -> tuple[float, float, float, float]:
        """Left, low, right, high when its centre stands at this offset."""
        w, h = self.half
        return self.x + dx - w, self.y + dy - h, self.x + dx + w, self.y + dy + h


def _covered(box: Sequence[float], others: np.ndarray) -> float:
    """The area of a box that others (N, 4) cover."""
    if not len(others):
        return 0.0
    width = np.minimum(box[2], others[:, 2]) - np.maximum(box[0], others[:, 0])
    height = np.minimum(box[3], others[:, 3]) - np.maximum(box[1], others[:, 1])
    return float(np.sum(np.maximum(width, 0.0) * np.maximum(height, 0.0)))


def _along(curve: np.ndarray) -> np.ndarray:
    """Small boxes along a curve (N, 2)."""
    out = []
    for a, b in zip(curve[:-1], curve[1:], strict=True):
        steps = max(2, int(np.hypot(*(b - a)) / 3.0))
        points = a + (b - a) * np.linspace(0.0, 1.0, steps)[:, None]
        out.append(np.hstack([points - 1.5, points + 1.5]))
    return np.vstack(out) if out else np.empty((0, 4))


def place(labels: Sequence[Label], curves: Sequence[np.ndarray], panel: tuple[float, float]) -> None:
    """Sets every label's offset. `curves`: (N, 2) points of each curve; `panel`: its width and height."""
    markers = [np.hstack([c - 5.0, c + 5.0]) for c in curves]
    taken = np.vstack([*markers, *(_along(c) for c in curves), np.empty((0, 4))])
    for label in labels:
        w, h = label.half
        best = None
        for step, distance in enumerate(DISTANCES):
            for rank, (sx, sy) in enumerate(label.places):
                dx = sx * (w + 7.0 + distance)
                dy = sy * (h + (1.0 if sx else 6.0) + distance)
                box = label.box(dx, dy)
                outside = max(0.0, -box[0], box[2] - panel[0]) * 2 * h + max(0.0, -box[1], box[3] - panel[1]) * 2 * w
                cost = _covered(box, taken) + 4.0 * outside + 0.5 * rank + 2.0 * step
                if best is None or cost < best[0]:
                    best = (cost, dx, dy)
        _, label.dx, label.dy = best
        left, low, right, high = label.box(label.dx, label.dy)
        taken = np.vstack([taken, (left - AIR, low, right + AIR, high)])
