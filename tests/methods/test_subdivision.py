# SPDX-License-Identifier: MIT
"""subdivision: what its nodes say, refusals, the paper's metrics, sizes, and cuts of it on shapes that are known."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import lodlab as lod
from lodlab import _core
from lodlab.instrument.audit import audit
from lodlab.stability import meshes


def _build(source: object, folder: Path, **options: object) -> lod.Store:
    return lod.build(source, "subdivision", folder / "s.lod", mode="force", progress=False, **options)


def _beside(mesh: lod.Mesh, far: float = 0.9) -> _core.View:
    middle = mesh.bounds.mean(axis=0)
    return _core.View(tuple(middle + far * mesh.extent * np.array([0.4, -0.8, 0.3])), tuple(middle), size=(320, 200))


@pytest.fixture(scope="module")
def blob() -> lod.Mesh:
    return lod.datasets.load("blob:size=40")


@pytest.mark.parametrize("degree", [5, 9, 17])
def test_nodes_say_what_cuts_of_their_level_draw(blob: lod.Mesh, degree: int, tmp_path: Path) -> None:
    store = _build(blob, tmp_path, degree=degree, target=100)
    nodes, session = store.nodes, store.core.session({})
    faces = np.unique(nodes["id"])
    levels = np.unique(nodes["resolution"])
    assert len(levels) == 2 * int(np.log2(degree - 1)) + 1
    for level in levels:
        rows = nodes[nodes["resolution"] == level]
        cut = session.cut(faces, np.full(len(faces), level, np.int32))
        assert cut.triangles == rows["triangles"].sum() == len(session.capture(cut, _beside(blob)).triangles)
        np.testing.assert_array_equal(cut.nodes["error"], rows["error"])
    assert rows["triangles"][0] == (degree - 1) ** 2
    for face in faces[:5]:
        assert (np.diff(nodes["error"][nodes["id"] == face]) <= 0).all()


def test_neighbours_of_any_levels_meet(blob: lod.Mesh, tmp_path: Path) -> None:
    store, random = _build(blob, tmp_path, degree=9, target=100), np.random.default_rng(3)
    session, instrument = store.core.session({}), _core.Instrument(blob.core, None)
    faces = np.unique(store.nodes["id"])
    for _ in range(5):
        cut = session.cut(faces, random.integers(0, 7, len(faces)).astype(np.int32))
        found = instrument.examine(session, cut, _beside(blob), pictures=False)
        assert found.crack_edges == 0
        assert found.measured_max <= cut.nodes["error"].max() + instrument.slack(_beside(blob))


@pytest.mark.parametrize(("sampling", "bits"), [("interpolation", "16"), ("intersection", "11")])
def test_bounds_hold_at_every_depth(sampling: str, bits: str, tmp_path: Path) -> None:
    blob = lod.datasets.load("blob:size=12")
    store = _build(blob, tmp_path, degree=5, target=40, sampling=sampling, bits=bits)
    found = audit(store, cuts=3, progress=False)
    assert len(found.broken) == 0


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"degree": 16}, "degree 16.*2\\^d"),
        ({"degree": 65}, "degree"),
        ({"degree": 2}, "degree"),
        ({"bits": "12"}, "bits.*12"),
        ({"sampling": "nearest"}, "sampling"),
        ({"target": -1}, "target"),
        ({"poses": "icosphere:level=1"}, "pose 0 of 1 has 42 vertices and 80 triangles; it must have the source's"),
        ({"poses": []}, "poses: no mesh is named"),
        ({"poses": "jacksboro"}, "poses: jacksboro is a heightfield; it takes meshes"),
        ({"poses": "no-such.ply"}, "no-such.ply"),
    ],
)
def test_options_that_are_none(options: dict[str, object], said: str, blob: lod.Mesh, tmp_path: Path) -> None:
    with pytest.raises(lod.errors.InvalidInput, match=said):
        _build(blob, tmp_path, **options)
    assert not list(tmp_path.iterdir())


def test_a_target_beyond_valid_collapses_is_told(tmp_path: Path) -> None:
    torus = lod.datasets.load("torus:rings=40,sides=20")
    store = _build(torus, tmp_path, target=4, degree=5)
    assert len(np.unique(store.nodes["id"])) > 4
    told = store.info()["build"]
    assert told["reached_target"] is False and told["control_faces"] == len(np.unique(store.nodes["id"]))


@pytest.mark.parametrize("name", ["three on one edge", "two fans on one vertex", "turned triangles", "one side"])
def test_what_is_no_manifold_is_refused_with_counts(name: str, tmp_path: Path) -> None:
    with pytest.raises(lod.errors.InvalidInput, match="manifold.*[0-9]"):
        _build(meshes.load(f"mesh:{name}"), tmp_path)


@pytest.mark.parametrize("pipeline", ["compute", "geometry"])
def test_the_papers_metrics_promise_nothing_and_refine(pipeline: str, blob: lod.Mesh, tmp_path: Path) -> None:
    store = _build(blob, tmp_path, target=100)
    for metric in ("length", "curvature"):
        session = store.core.session({"metric": metric, "pipeline": pipeline})
        counts = []
        for pixel_error in (1.0, 4.0, 16.0, 64.0):
            cut, row = session.time_frame(_beside(blob), _core.Budget(pixel_error=pixel_error))
            assert not cut.promises_bound and row["triangles"] == cut.triangles
            assert row["processed_triangles"] >= row["triangles"]
            counts.append(cut.triangles)
        assert counts == sorted(counts, reverse=True) and counts[0] > 4 * counts[-1]


@pytest.mark.parametrize("pipeline", ["compute", "geometry"])
def test_each_triangle_is_tested_once_and_a_still_camera_tests_none(
    pipeline: str, blob: lod.Mesh, tmp_path: Path
) -> None:
    store = _build(blob, tmp_path, target=100)
    session, budget = store.core.session({"pipeline": pipeline}), _core.Budget(pixel_error=0.5)
    _, row = session.time_frame(_beside(blob), budget)
    assert row["triangles"] > 3000
    culled = 0 if pipeline == "compute" else len(np.unique(store.nodes["id"]))  # which passes of triangles begin with
    assert row["processed_triangles"] < 2 * row["triangles"] + culled
    _, again = session.time_frame(_beside(blob), budget)
    assert again["processed_triangles"] == 0 and again["triangles"] == row["triangles"]


def test_a_control_mesh_for_poses_follows_them_better(blob: lod.Mesh, tmp_path: Path) -> None:
    def bent(points: np.ndarray, t: float = 1.0) -> np.ndarray:
        low, high = blob.bounds
        angle = np.pi * t * (points[:, 0] - 0.5 * (low[0] + high[0])) / (high[0] - low[0])
        radius = (high[0] - low[0]) / np.pi + points[:, 2]
        return np.stack([radius * np.sin(angle), points[:, 1], radius * np.cos(angle)], axis=1)

    def posed(points: np.ndarray) -> lod.Mesh:
        return lod.Mesh(points, blob.faces)

    def off(name: str, **options: object) -> float:
        store = lod.build(blob, "subdivision", tmp_path / name, degree=9, target=150, progress=False, **options)
        cut = store.select(_beside(blob), {"pixel_error": 1e-6}, bent(store.control_positions))
        return lod.measure(store.capture(cut, _beside(blob)), posed(bent(blob.positions)))["measured_rms"]

    assert off("a.lod", poses=[posed(bent(blob.positions))]) < 0.97 * off("b.lod")


def test_a_sphere_is_drawn_as_one(tmp_path: Path) -> None:
    """10,000 triangles round the unit sphere: the source is within 0.0004 of it, and so is what is drawn."""
    ball = lod.datasets.load("icosphere:level=5")
    store = _build(ball, tmp_path, target=80)
    session = store.core.session({})
    capture = session.capture(session.cut(np.unique(store.nodes["id"]), None), _beside(ball))
    radius = np.linalg.norm(capture.triangles.reshape(-1, 3), axis=1)
    assert abs(radius - 1.0).max() < 0.002
    assert store.nodes["error"][store.nodes["resolution"] == 8].max() < 0.004
