# SPDX-License-Identifier: MIT
"""Small hillshades of height fields, for notebooks and messages."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from .heightfield import HeightField

# Height tints from low to high, RGB.
_TINTS = np.array([[92, 128, 98], [170, 176, 120], [196, 164, 116], [168, 132, 112], [244, 242, 240]], np.float64)
_SEA = np.array([[24, 44, 84], [110, 158, 196]], np.float64)
_VOID = np.array([226, 226, 230], np.uint8)


def hillshade(field: HeightField, width: int = 256) -> np.ndarray:
    """(h, w, 3) uint8: light from the north-west, slopes stretched until they show, voids pale grey."""
    rows, cols = field.shape
    step = max(1, -(-max(rows, cols) // width))
    z, valid = field.every(step)
    z = z.astype(np.float64)
    dx, dy = field.spacing
    south, east = (np.gradient(z, axis=k) if z.shape[k] > 1 else np.zeros_like(z) for k in (0, 1))
    east, south = east / (dx * step), south / (dy * step)
    steep = float(np.percentile(np.hypot(east, south), 90)) or 1.0
    east, south = east * (0.8 / steep), south * (0.8 / steep)
    light = np.array([-0.5, 0.5, 0.7071])
    shade = (-east * light[0] + south * light[1] + light[2]) / np.sqrt(east**2 + south**2 + 1.0)
    shade = np.clip(0.25 + 0.85 * shade, 0.0, 1.15)
    image = np.clip(_tint(z, valid) * shade[..., None], 0, 255).astype(np.uint8)
    image[~valid] = _VOID
    return image


def _ramp(values: np.ndarray, colours: np.ndarray) -> np.ndarray:
    at = np.linspace(0.0, 1.0, len(colours))
    return np.stack([np.interp(values, at, colours[:, k]) for k in range(3)], axis=-1)


def _tint(z: np.ndarray, valid: np.ndarray) -> np.ndarray:
    """Colours by height; below 0 as sea where a good part of the field lies on each side of 0."""
    real = z[valid] if valid.any() else z
    low, high = float(real.min()), float(real.max())
    sea = 0.02 < float(np.mean(real < 0)) < 0.98
    base = 0.0 if sea else low
    colours = _ramp(np.clip((z - base) / max(high - base, 1e-9), 0, 1), _TINTS)
    if sea:
        colours = np.where((z < 0)[..., None], _ramp(np.clip(1 - z / min(low, -1e-9), 0, 1), _SEA), colours)
    return colours
