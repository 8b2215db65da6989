# SPDX-License-Identifier: MIT
"""Small hillshades of height fields and portraits of meshes, for notebooks and messages. Sources import it, so that it
imports none."""

from __future__ import annotations

from typing import Any

import numpy as np

# Height tints from low to high, RGB.
_TINTS = np.array([[92, 128, 98], [170, 176, 120], [196, 164, 116], [168, 132, 112], [244, 242, 240]], np.float64)
_SEA = np.array([[24, 44, 84], [110, 158, 196]], np.float64)
_VOID = np.array([226, 226, 230], np.uint8)


def hillshade(field: Any, width: int = 256) -> np.ndarray:
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


# ---- meshes ---------------------------------------------------------------------------------------

_CLAY = np.array([196, 182, 164], np.float64)
_INSIDE = np.array([150, 96, 88], np.float64)
_PAPER = np.array([246, 246, 248], np.uint8)
_MOST_POINTS = 1 << 22  # that are drawn together
_FRONT = np.array([[0.943, 0.0, -0.333], [-0.097, 0.957, -0.274], [0.319, 0.291, 0.902]])  # right, up, to the eye


def portrait(mesh: Any, width: int = 256) -> np.ndarray:
    """(width, width, 3) uint8: seen in parallel from the front, upper right, y up; light from the camera's upper left.

    Triangles are drawn as grids of points less than a pixel apart, the nearest of each pixel staying.
    """
    low, high = mesh.bounds
    size = mesh.extent or 1.0
    seen = ((mesh.positions - 0.5 * (low + high)) / size) @ _FRONT.T
    seen = np.clip(seen, -1.0, 1.0).astype(np.float32)  # vertices that no triangle uses may lie anywhere
    pixels = (seen * [1.0, -1.0, 1.0] * (0.98 * width) + 0.5 * width).astype(np.float32)
    depth = np.full(width * width, -np.inf, np.float32)
    nearest = np.zeros(width * width, np.int64)
    faces = mesh.faces
    corners = pixels[faces]
    longest = np.linalg.norm(corners[:, :, :2] - np.roll(corners, 1, axis=1)[:, :, :2], axis=2).max(axis=1)
    steps = np.exp2(np.ceil(np.log2(np.maximum(1.5 * longest, 1.0)))).astype(np.int64)
    for step in np.unique(steps):
        weights = _grid(int(step))
        group = np.flatnonzero(steps == step)
        for part in np.array_split(group, -(-len(group) * len(weights) // _MOST_POINTS)):
            _plot(corners[part], part, weights, width, depth, nearest)
    image = np.broadcast_to(_PAPER, (width * width, 3)).copy()
    drawn = np.isfinite(depth)
    image[drawn] = _lit(mesh, seen, nearest[drawn])
    return image.reshape(width, width, 3)


def _grid(step: int) -> np.ndarray:
    """(N, 3) float32: weights of the corners at the points of a triangle whose edges are cut into `step` parts; of one
    that is smaller than a pixel its middle."""
    if step == 1:
        return np.full((1, 3), 1.0 / 3.0, np.float32)
    i, j = np.meshgrid(np.arange(step + 1), np.arange(step + 1))
    inside = i + j <= step
    a, b = i[inside] / step, j[inside] / step
    return np.stack([a, b, 1.0 - a - b], axis=1).astype(np.float32)


def _plot(
    corners: np.ndarray, ids: np.ndarray, weights: np.ndarray, width: int, depth: np.ndarray, nearest: np.ndarray
) -> None:
    """Draws triangles' points where they are nearer than what is there."""
    points = np.matmul(weights, corners).reshape(-1, 3)
    col, row = (np.clip(points[:, k].astype(np.int64), 0, width - 1) for k in (0, 1))
    pixel, z = row * width + col, points[:, 2]
    np.maximum.at(depth, pixel, z)
    front = depth[pixel] == z
    nearest[pixel[front]] = np.repeat(ids, len(weights))[front]


def _lit(mesh: Any, seen: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(N, 3) uint8: colours of faces by their planes; the inside has a colour of its own."""
    indices = mesh.faces[faces]
    a, b, c = (seen[indices[:, k]].astype(np.float64) for k in range(3))
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
    outside = normal[:, 2] >= 0.0
    normal = np.where(outside[:, None], normal, -normal)
    light = np.array([-0.45, 0.55, 0.704])
    shade = 0.3 + 0.75 * np.clip(normal @ light, 0.0, 1.0)
    own = _CLAY if mesh.colors is None else mesh.colors[indices][:, :, :3].mean(axis=1)
    return np.clip(np.where(outside[:, None], own, _INSIDE) * shade[:, None], 0, 255).astype(np.uint8)
