# SPDX-License-Identifier: MIT
"""A drawn chart and its dress, light and dark: colours of Okabe and Ito (told apart by colour-blind readers), with a
marker shape beside each. What is on it is drawn by whoever makes one."""

from __future__ import annotations

import io
import math
import os
from pathlib import Path
from typing import Any

from .disk import write_atomic
from .errors import InvalidInput

# Okabe and Ito (2008), in the order in which methods take them; black and its like belong to `full`.
COLOURS = {
    "light": ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#B8860B", "#56B4E9"),
    "dark": ("#56B4E9", "#E69F00", "#2CC79A", "#E29BC4", "#F0E442", "#8FB8DE"),
}
MARKERS = ("o", "s", "^", "D", "v", "P")
INK = {
    "light": {"page": "#fbfaf8", "text": "#22252a", "faint": "#686d75", "rule": "#dcdad5", "full": "#22252a"},
    "dark": {"page": "#16181c", "text": "#e8e6e1", "faint": "#a2a6ad", "rule": "#34383f", "full": "#e8e6e1"},
}


class Chart:
    """A drawn chart: shows itself in notebooks, saves as PNG, SVG or PDF, gives its matplotlib figure."""

    def __init__(self, draw: Any, title: str):
        self._draw = draw
        self.title = title

    def png(self, theme: str = "light", dpi: int = 200) -> bytes:
        """The bytes of a PNG file."""
        return self._render(theme, "png", dpi)

    def svg(self, theme: str = "light") -> str:
        """The text of an SVG file; letters are outlines, so that no font is needed."""
        return self._render(theme, "svg", 100).decode()

    def save(self, path: str | os.PathLike[str], theme: str = "light") -> None:
        """Writes the chart; the format follows the file's ending (.png, .svg, .pdf)."""
        kind = Path(path).suffix.lower().lstrip(".")
        if kind not in ("png", "svg", "pdf"):
            raise InvalidInput(f"save chart: {path} ends in none of .png, .svg, .pdf")
        write_atomic(Path(path), self._render(theme, kind, 200))

    def figure(self, theme: str = "light") -> Any:
        """A new `matplotlib.figure.Figure` with the chart on it, to be changed and saved as any other."""
        import matplotlib
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        with matplotlib.rc_context(_style(theme)):
            figure = Figure(layout="constrained", facecolor=INK[theme]["page"])
            FigureCanvasAgg(figure)
            self._draw(figure, theme)
        return figure

    def _render(self, theme: str, kind: str, dpi: int) -> bytes:
        import matplotlib

        figure = self.figure(theme)
        out = io.BytesIO()
        stamp = {"Date": None} if kind == "svg" else {"CreationDate": None} if kind == "pdf" else {}
        with matplotlib.rc_context(_style(theme)):
            figure.savefig(out, format=kind, dpi=dpi, metadata=stamp)
        return out.getvalue()

    def _repr_png_(self) -> bytes:
        return self.png(dpi=110)

    def __repr__(self) -> str:
        return f"<lodlab chart: {self.title}>"


def _style(theme: str) -> dict[str, Any]:
    """matplotlib's settings for a chart."""
    if theme not in INK:
        raise InvalidInput(f"chart: theme is {theme!r}; it is one of {', '.join(INK)}")
    ink = INK[theme]
    return {
        "font.family": "DejaVu Sans",
        "font.size": 9.0,
        "text.color": ink["text"],
        "axes.labelcolor": ink["text"],
        "axes.edgecolor": ink["faint"],
        "xtick.color": ink["faint"],
        "ytick.color": ink["faint"],
        "xtick.labelcolor": ink["text"],
        "ytick.labelcolor": ink["text"],
        "axes.facecolor": ink["page"],
        "figure.facecolor": ink["page"],
        "savefig.facecolor": ink["page"],
        "grid.color": ink["rule"],
        "svg.hashsalt": "lodlab",
        "svg.fonttype": "path",
    }


def short(value: float, _: Any = None) -> str:
    """A number as on an axis: 0.5, 20, 1.5k, 2M."""
    if not math.isfinite(value) or value == 0:
        return f"{value:g}"
    for limit, unit in ((1e9, "G"), (1e6, "M"), (1e3, "k")):
        if abs(value) >= limit * 0.9995:
            return f"{value / limit:.3g}{unit}"
    return f"{value:.3g}"
