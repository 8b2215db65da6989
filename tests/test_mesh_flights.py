# SPDX-License-Identifier: MIT
"""A mesh goes round the loop: built-in paths, runs, compare, report."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import lodlab as lod
from lodlab.paths.around import AROUND


@pytest.mark.parametrize("name", AROUND)
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e6])
def test_paths_scale_with_the_mesh_see_it_and_stay_outside(name: str, scale: float) -> None:
    shape = lod.datasets.load("blob:size=17,seed=3")
    mesh = lod.Mesh(shape.positions * scale, shape.faces)
    path = lod.CameraPath.named(name, mesh, frames=9)
    for view in path.views(size=(160, 90)):
        gaps = np.linalg.norm(mesh.positions - np.asarray(view.eye), axis=1)
        assert gaps.min() > max(0.015 * mesh.extent, 2.0 * view.near)
        assert np.linalg.norm(view.eye) > np.linalg.norm(mesh.positions, axis=1)[gaps.argmin()]  # the blob is round 0
        clip = np.c_[mesh.positions, np.ones(len(mesh.positions))] @ np.asarray(view.matrix).T
        assert (np.abs(clip[:, :2]) < clip[:, 3:]).all(axis=1).any()


def test_an_orbit_fills_pictures_with_a_mesh_that_leaves_the_corners_of_its_box_free() -> None:
    corners = np.vstack([np.eye(3), -np.eye(3)])
    octahedron = lod.Mesh(corners, [[x, y, z] for x in (0, 3) for y in (1, 4) for z in (2, 5)])
    for view in lod.CameraPath.named("orbit", octahedron, frames=9).views(size=(160, 90)):
        clip = np.c_[corners, np.ones(6)] @ np.asarray(view.matrix).T
        assert 0.85 < np.abs(clip[:, :2] / clip[:, 3:]).max() < 1.0


def test_paths_over_ground_are_none_of_a_mesh_and_the_other_way_round() -> None:
    mesh, field = lod.datasets.load("icosphere:level=2"), lod.datasets.load("fractal:size=33")
    for name in ("flyover", "walk"):
        with pytest.raises(lod.errors.Unsupported, match="a mesh has none; it has orbit, zoom, flyby, still"):
            lod.CameraPath.named(name, mesh)
    with pytest.raises(lod.errors.Unsupported, match="a heightfield has none; it has flyover, orbit"):
        lod.CameraPath.flyby(field)


def test_a_run_of_a_mesh_measures_it_and_makes_a_report(tmp_path: Path) -> None:
    mesh = lod.datasets.load("torus:rings=48,sides=24")
    store = lod.build(mesh, "full", tmp_path / "a.lod", progress=False)
    flight = {"frames": 6, "size": (160, 90), "accuracy_frames": 3, "progress": False}
    run = lod.fly(store, "orbit", lod.Budget(pixel_error=1.0), out=tmp_path / "run", **flight)
    measured = run.frames[run.frames["accuracy"]]
    assert (measured["measured_px_max"] <= 0.01).all() and (measured["crack_edges"] == 0).all()
    assert (measured["measured_samples"] == mesh.samples).all() and (measured["pop_px_max"].dropna() == 0).all()
    assert measured[["hole_samples", "slanted_filler_triangles", "raised_filler_triangles"]].isna().all().all()
    assert (measured["inverted_triangles"] == 0).all()
    assert (run.frames["source_kind"] == "mesh").all()
    found = {v.law: v.verdict for v in lod.laws.judge(run.frames)}
    assert not {"holes", "fillers", "raised"} & found.keys() and found["winding"] == "holds"
    assert set(found.values()) <= {"holds", "open"}
    page = (tmp_path / "run" / "report.html").read_text()
    assert "torus" in page and "measured<br>units" in page and "<br>m<" not in page
    again = lod.open(store.path)
    assert again.source.hash() == mesh.hash()


def test_a_path_that_looks_elsewhere_says_where_the_mesh_lies(tmp_path: Path) -> None:
    mesh = lod.datasets.load("icosphere:level=2")
    store = lod.build(mesh, "full", tmp_path / "a.lod", progress=False)
    away = lod.CameraPath.from_keys([{"t": t, "eye": [9, 0, 0], "target": [19, t, 0]} for t in (0, 1)], frames=2)
    with pytest.warns(UserWarning, match="x -1 to 1, y -1 to 1, z -1 to 1"):
        lod.fly(store, away, {"pixel_error": 1.0}, size=(64, 64), accuracy_frames=0, progress=False)


def test_a_mesh_without_a_path_is_orbited_and_ground_is_flown_over(tmp_path: Path) -> None:
    few = {"frames": 2, "size": (64, 64), "accuracy_frames": 0, "progress": False}
    for spec, path in (("icosphere:level=2", "orbit"), ("fractal:size=33", "flyover")):
        run = lod.fly(
            lod.build(spec, "full", tmp_path / f"{path}.lod", progress=False), budget={"pixel_error": 1}, **few
        )
        assert (run.frames["path"] == path).all()
    made = lod.compare("icosphere:level=2", methods=["full"], out=tmp_path / "all", **few)
    assert (made.frames["path"] == "orbit").all()


@pytest.mark.parametrize(
    ("sources", "path"),
    [(["fractal:size=33"], "flyover"), (["torus"], "orbit"), (["fractal:size=33", "torus"], "orbit")],
)
def test_a_sweep_without_paths_takes_that_of_its_sources(sources: list[str], path: str) -> None:
    few = {"frames": 2, "size": [64, 64], "accuracy_frames": 0, "images": "none"}
    made = lod.sweep({"sources": sources, "methods": ["full"], **few}, progress=False)
    assert (made.summary["path"] == path).all() and len(made.summary) == len(sources)
