# SPDX-License-Identifier: MIT
"""Meshes against meshes through the Python face: numpy's account of small ones, moved and thinned real ones."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from lodlab import _core, errors

TOLERANCE = 1e-3  # a maximum is attained, and the true one is at most this share larger
COLUMNS = (
    "measured_max",
    "measured_rms",
    "measured_max_source_to_drawn",
    "measured_max_drawn_to_source",
    "measured_rms_source_to_drawn",
    "measured_rms_drawn_to_source",
    "measured_px_max",
    "measured_px_p99",
    "measured_px_rms",
)


def square(n: int = 4, z: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (V, 3) float64 and faces (F, 3) uint32 of the unit square in n x n cells at height z."""
    y, x = np.mgrid[0 : n + 1, 0 : n + 1]
    vertices = np.stack([x / n, y / n, np.full(x.shape, z)], axis=-1).reshape(-1, 3)
    a = (y * (n + 1) + x)[:-1, :-1].reshape(-1)
    faces = np.concatenate([np.stack([a, a + 1, a + n + 2], 1), np.stack([a, a + n + 2, a + n + 1], 1)])
    return vertices, faces.astype(np.uint32)


def soup(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(vertices[faces])


def closest(drawn: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distances (N,) and closest points (N, 3), from every point to every triangle, by trimesh."""
    every = np.repeat(drawn, len(points), axis=0)
    near = trimesh.triangles.closest_point(every, np.tile(points, (len(drawn), 1))).reshape(len(drawn), -1, 3)
    distance = np.linalg.norm(near - points, axis=2)
    best = distance.argmin(axis=0)
    index = np.arange(len(points))
    return distance[best, index], near[best, index]


def thinned(vertices: np.ndarray, faces: np.ndarray, cells: int) -> np.ndarray:
    """Triangles (T, 3, 3) of the mesh with the vertices of each cell of a grid made one, their mean."""
    size = np.ptp(vertices, axis=0).max() / cells
    _, group = np.unique(np.floor((vertices - vertices.min(axis=0)) / size), axis=0, return_inverse=True)
    group = group.reshape(-1)
    mean = np.zeros((group.max() + 1, 3))
    np.add.at(mean, group, vertices)
    mean /= np.bincount(group)[:, None]
    kept = group[faces]
    kept = kept[(kept[:, 0] != kept[:, 1]) & (kept[:, 1] != kept[:, 2]) & (kept[:, 2] != kept[:, 0])]
    return mean[kept]


def test_columns_of_equal_meshes() -> None:
    vertices, faces = square()
    found = _core.mesh_accuracy(vertices, faces, soup(vertices, faces))
    assert tuple(found) == COLUMNS
    assert [found[name] for name in COLUMNS[:6]] == [0.0] * 6
    assert all(math.isnan(found[name]) for name in COLUMNS[6:])


def test_a_square_lowered_under_a_view() -> None:
    drop, away, side = 0.01, 3.0, 100
    vertices, faces = square(20)
    drawn = soup(*square(3, -drop))
    view = _core.View((0.5, 0.5, away), (0.5, 0.5, 0.0), up=(0.0, 1.0, 0.0), size=(side, side), fov=30.0)
    found = _core.mesh_accuracy(vertices, faces, drawn, view, np.full((side, side), away, np.float32))
    assert found["measured_max"] == pytest.approx(drop, rel=1e-12)
    scale = side / 2 / math.tan(math.radians(15.0))
    to_edge = scale * 0.5 / away  # the whole square is in view
    assert to_edge < side / 2
    # Both are parallel to the picture: a corner moves towards the middle by 1 - away / (away + drop).
    share = 1 - away / (away + drop)
    assert found["measured_px_max"] == pytest.approx(math.sqrt(2) * to_edge * share, rel=1e-9)
    y, x = np.mgrid[0:side, 0:side] + 0.5 - side / 2
    # Beyond the square's outline the closest point is on the drawn outline.
    px, py = x * away / scale, y * away / scale
    qx, qy = np.clip(px, -0.5, 0.5), np.clip(py, -0.5, 0.5)
    moved = np.sort(np.hypot(x - scale * qx / (away + drop), y - scale * qy / (away + drop)).reshape(-1))
    assert found["measured_px_p99"] == pytest.approx(moved[math.ceil(0.99 * moved.size) - 1], rel=1e-6)
    assert found["measured_px_rms"] == pytest.approx(math.sqrt((moved**2).mean()), rel=1e-6)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 12), st.integers(1, 12), st.sampled_from([0.0, 1.0, 6.4e6]))
def test_random_triangles_against_numpy(seed: int, count: int, drawn_count: int, offset: float) -> None:
    rng = np.random.default_rng(seed)
    vertices = rng.uniform(-1, 1, (3 * count, 3)) + offset
    faces = np.arange(3 * count, dtype=np.uint32).reshape(-1, 3)
    drawn = rng.uniform(-1, 1, (drawn_count, 3, 3)) + offset
    found = _core.mesh_accuracy(vertices, faces, drawn)
    # All points of a lattice on every source triangle; nothing on it is farther than a step from one of them.
    steps = 24
    i, j = np.mgrid[0 : steps + 1, 0 : steps + 1]
    weights = np.stack([i, j, steps - i - j], -1)[i + j <= steps] / steps
    points = np.einsum("nk,tkc->tnc", weights, vertices.reshape(-1, 3, 3) - offset)
    edges = vertices.reshape(-1, 3, 3) - np.roll(vertices.reshape(-1, 3, 3), 1, axis=1)
    step = np.linalg.norm(edges, axis=2).max() / steps
    distances, _ = closest(drawn - offset, points.reshape(-1, 3))
    rounding = 1e-15 * offset + 1e-9
    assert found["measured_max_source_to_drawn"] >= distances.max() * (1 - TOLERANCE) - rounding
    assert found["measured_max_source_to_drawn"] <= distances.max() + step
    areas = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    # The lattice's mean is a rougher rms: its distances are off by at most a step.
    rms = math.sqrt(np.average((distances**2).reshape(count, -1).mean(axis=1), weights=areas))
    assert found["measured_rms_source_to_drawn"] == pytest.approx(rms, abs=2 * step)
    assert found["measured_max"] == max(found["measured_max_source_to_drawn"], found["measured_max_drawn_to_source"])
    assert found["measured_rms"] == max(found["measured_rms_source_to_drawn"], found["measured_rms_drawn_to_source"])
    assert found["measured_rms_source_to_drawn"] <= found["measured_max_source_to_drawn"] * (1 + TOLERANCE)


def test_vertices_on_the_screen_against_numpy() -> None:
    rng = np.random.default_rng(5)
    vertices, faces = square(8)
    vertices[:, 2] += rng.uniform(-0.1, 0.1, len(vertices))
    drawn = soup(*square(2))
    view = _core.View((0.5, -0.8, 0.5), (0.5, 0.5, 0.0), size=(320, 200), fov=50.0)
    _, near = closest(drawn, vertices)

    def project(points: np.ndarray) -> np.ndarray:
        clip = np.c_[points, np.ones(len(points))] @ np.asarray(view.matrix).T
        return clip[:, :2] / clip[:, 3:] * [160, 100]

    inside = np.all(np.abs(project(vertices)) <= [160, 100], axis=1)
    assert 10 < inside.sum() < len(vertices)  # some are out of view, all in front of the eye
    expected = np.linalg.norm(project(vertices) - project(near), axis=1)[inside].max()
    found = _core.mesh_accuracy(vertices, faces, drawn, view)
    assert found["measured_px_max"] == pytest.approx(expected, rel=1e-6)
    assert math.isnan(found["measured_px_p99"])


def test_nothing_drawn() -> None:
    vertices, faces = square()
    found = _core.mesh_accuracy(vertices, faces, np.empty((0, 3, 3)))
    assert found["measured_max"] == found["measured_max_source_to_drawn"] == math.inf
    assert math.isnan(found["measured_max_drawn_to_source"])


def test_arrays_are_checked() -> None:
    vertices, faces = square()
    drawn = soup(vertices, faces)
    for arguments, part in (
        ((vertices.astype(np.float32), faces, drawn), r"vertices is \(25, 3\) float32, not \(V, 3\) float64"),
        ((vertices[:, :2], faces, drawn), r"vertices is \(25, 2\)"),
        ((vertices, faces.astype(np.int64), drawn), r"faces is \(32, 3\) int64, not \(F, 3\) uint32"),
        ((vertices, faces, vertices), r"drawn is \(25, 3\) float64, not \(T, 3, 3\) float64"),
        ((vertices, faces[:0], drawn), "no triangles"),
        ((vertices, faces + np.uint32(1), drawn), "names vertex 25 of 25"),
        ((vertices, faces, drawn * math.nan), "drawn triangle 0 has a vertex at"),
        ((vertices, faces, drawn, None, np.ones((2, 2), np.float32)), "needs the view"),
        ((vertices, faces, drawn, _core.View((0, 0, 1), (0, 0, 0)), np.ones((2, 2), np.float32)), "2 x 2"),
        ((vertices, faces, drawn, _core.View((0, 0, 1), (0, 0, 0)), np.ones((2, 2))), r"depth is \(2, 2\) float64"),
    ):
        with pytest.raises(errors.InvalidInput, match=part):
            _core.mesh_accuracy(*arguments)
    # Strides do not matter.
    assert _core.mesh_accuracy(np.asfortranarray(vertices), faces, drawn[::-1])["measured_max"] == 0.0


def test_a_real_mesh(shared_data: Callable[[str], Path]) -> None:
    mesh = trimesh.load(shared_data("mesh/horse.ply"), process=False)
    vertices, faces = np.asarray(mesh.vertices, float), np.asarray(mesh.faces, np.uint32)
    extent = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    # No point is farther from the moved mesh than it moved; somewhere on a closed mesh it moved straight out.
    shift = np.array([0.36, 0.48, 0.8]) * 1e-4 * extent
    moved = _core.mesh_accuracy(vertices, faces, soup(vertices, faces) + shift)
    for name in ("measured_max_source_to_drawn", "measured_max_drawn_to_source"):
        assert moved[name] == pytest.approx(np.linalg.norm(shift), rel=2 * TOLERANCE)
    drawn = thinned(vertices, faces, 50)
    assert len(drawn) < len(faces) / 10
    found = _core.mesh_accuracy(vertices, faces, drawn)
    # A thinned vertex is the mean of a cell; the surface lies within a few cells of the source.
    cell = float(np.ptp(vertices, axis=0).max()) / 50
    assert 0.1 * cell < found["measured_max"] < 3 * cell
    assert found["measured_rms"] < 0.2 * found["measured_max"]
    some = np.random.default_rng(1).choice(len(vertices), 100, replace=False)
    distances, _ = closest(drawn, vertices[some])
    assert distances.max() <= found["measured_max_source_to_drawn"] * (1 + 1e-9)
