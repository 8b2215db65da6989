# SPDX-License-Identifier: MIT
"""What all sources have in common, and what all grids of heights have.

A source is what a user brings, and never changes. Its `kind` says which methods accept it; whoever needs heights
asks for a `FieldSource`.
"""

from __future__ import annotations

import base64
from html import escape
from typing import Any

import numpy as np

from .frames import extent_of
from .thumbnail import hillshade


class Source:
    """What stores are built from: `HeightField`, `WindowedHeightField`, `Mesh`."""

    windowed = False  # heights that are read by windows: sources.windowed
    name: str
    used: dict[str, str]  # what of a file was used to place it, in words
    _hash: str | None = None

    @property
    def core(self) -> Any:
        """The native source."""
        raise NotImplementedError

    @property
    def kind(self) -> str:
        """heightfield, planet or mesh: what `accepts` of a method lists."""
        raise NotImplementedError

    @property
    def spec(self) -> str:
        """SOURCE text that loads it again, or empty for arrays."""
        return self.core.spec

    @property
    def samples(self) -> int:
        """Points that it is made of."""
        raise NotImplementedError

    def loaded(self) -> Source:
        """The source in memory: itself, but for one that is read by windows."""
        return self

    def hash(self) -> str:
        """32 hex digits of all that is measured against."""
        if self._hash is None:
            self._hash = self.core.hash()
        return self._hash

    def thumbnail(self, width: int = 256) -> np.ndarray:
        """A picture of it, (h, w, 3) uint8, at most `width` pixels wide or high."""
        raise NotImplementedError

    def _repr_png_(self) -> bytes:
        from ..pictures import encode

        return encode(self.thumbnail())

    def _repr_html_(self) -> str:
        picture = base64.b64encode(self._repr_png_()).decode()
        text = escape(repr(self).strip("<>"))
        return (
            f'<figure style="margin:0"><img alt="{escape(self.name)}" src="data:image/png;base64,{picture}">'
            f"<figcaption>{text}</figcaption></figure>"
        )


class FieldSource(Source):
    """Heights on a grid, flat (metres, z up) or on a planet (radius over longitude and latitude).

    Axes: x runs east along the columns, y north, so that y falls down the rows: sample (row, column) lies at
    x = x0 + column dx, y = y0 - row dy, and of an array with the default origin all y are 0 or below. A planet's
    axis is z, longitude 0 on +x.
    """

    @property
    def frame(self) -> dict[str, Any]:
        """Where it lies: rows, cols, dx, dy, x0, y0, planet, radius ..., as the core has them."""
        raise NotImplementedError

    @property
    def kind(self) -> str:
        return "planet" if self.planet else "heightfield"

    @property
    def samples(self) -> int:
        return self.shape[0] * self.shape[1]

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns)."""
        return self.frame["rows"], self.frame["cols"]

    @property
    def spacing(self) -> tuple[float, float]:
        """(dx, dy), metres between samples; on a planet along the equator and the meridians."""
        return self.frame["dx"], self.frame["dy"]

    @property
    def origin(self) -> tuple[float, float]:
        """(x0, y0), metres: the centre of the first sample."""
        return self.frame.get("x0", 0.0), self.frame.get("y0", 0.0)

    @property
    def planet(self) -> bool:
        """Whether the heights stand on a sphere."""
        return self.frame["planet"]

    @property
    def radius(self) -> float:
        """The planet's radius, metres."""
        return self.frame["radius"]

    @property
    def where(self) -> str:
        """Spacing and extent, in words; of a planet its radius."""
        dx, dy = self.spacing
        spacing = "" if self.planet else f"spacing {dx:.6g} x {dy:.6g} m, "
        return spacing + extent_of(self.frame)

    def thumbnail(self, width: int = 256) -> np.ndarray:
        """A hillshade with height tints, (h, w, 3) uint8, at most `width` pixels wide or high."""
        return hillshade(self, width)
