# SPDX-License-Identifier: MIT
"""full of meshes: the triangles as they are, whatever their topology. Law 5: no error, no cracks, no pops."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import lodlab as lod
from lodlab import _core
from lodlab.instrument import measure

TRIANGLE = (np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), np.array([[0, 1, 2]]))
TETRAHEDRON = (np.vstack([np.zeros(3), np.eye(3)]), np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]))


def _thirds(shift: float) -> lod.Mesh:
    """Coordinates that no 32-bit float has."""
    torus = lod.datasets.load("torus:rings=48,sides=24")
    return lod.Mesh(torus.positions / 3.0 + shift, torus.faces)


MESHES = {
    "closed": lambda: lod.datasets.load("icosphere:level=4"),
    "genus 1": lambda: lod.datasets.load("torus:rings=64,sides=32"),
    "fractal": lambda: lod.datasets.load("blob:size=33"),
    "doubles": lambda: _thirds(0.0),
    "far from the origin": lambda: _thirds(1e5),
    "one triangle": lambda: lod.Mesh(*TRIANGLE),
    "tetrahedron": lambda: lod.Mesh(*TETRAHEDRON),
    "two components": lambda: lod.Mesh(
        np.vstack([TETRAHEDRON[0], TETRAHEDRON[0] + 3.0]), np.vstack([TETRAHEDRON[1], TETRAHEDRON[1] + 4])
    ),
    "three on one edge": lambda: lod.Mesh(
        np.array([[0, 0, 0], [0, 0, 1], [1, 0, 0], [0, 1, 0], [-1, -1, 0]], float),
        np.array([[0, 1, 2], [0, 1, 3], [0, 1, 4]]),
    ),
}


class Flown:
    """A mesh, its store of `full`, and what a view of it measures."""

    def __init__(self, mesh: lod.Mesh, folder: Path, way: tuple[float, float, float] = (-0.5, -0.9, 0.45)) -> None:
        self.store = lod.build(mesh, "full", folder / "full.lod", progress=False)
        low, high = mesh.bounds
        middle, size = (low + high) / 2, float(np.linalg.norm(high - low))
        self.view = lod.View(middle + np.asarray(way) * size, middle, size=(320, 240))
        self.cut = self.store.select(self.view, {"pixel_error": 1.0})
        session = self.store.default_session.core
        self.instrument = _core.Instrument(mesh.core, session)
        reference = self.instrument.reference(self.view)
        self.row = measure(self.instrument, session, self.cut.core, self.view, reference, before=self.cut.core)


@pytest.mark.parametrize("name", MESHES)
def test_measures_nothing(name: str, tmp_path: Path) -> None:
    mesh = MESHES[name]()
    flown = Flown(mesh, tmp_path)
    row, slack = flown.row, flown.instrument.slack(flown.view)
    assert row["measured_px_max"] <= 0.01 and row["measured_px_p99"] <= 0.01
    assert row["measured_max"] <= slack + flown.store.nodes["error"].max()
    assert row["measured_samples"] == mesh.samples
    assert row["crack_edges"] == row["pop_px_max"] == row["pop_area"] == row["capture_mismatch_pixels"] == 0
    assert row["crack_pixels"] == 0 or np.isnan(row["crack_pixels"])
    assert row["psnr_db"] == np.inf and row["flip"] == 0
    assert row["inverted_triangles"] == 0
    assert np.isnan(row["hole_samples"]) and np.isnan(row["slanted_filler_triangles"])  # no holes, and no up
    assert row["drawn_triangles"] == flown.cut.triangles == len(mesh.faces)


def test_positions_are_kept_exactly_as_the_sum_of_two_floats(tmp_path: Path) -> None:
    mesh = _thirds(1e5)
    flown = Flown(mesh, tmp_path)
    assert 0 < flown.store.info()["quantum"] < 1e-9 < 2.0**-24 * 1e5  # single floats would lose 6 mm
    eye = lod.View([1e5 + 0.34, 1e5, 1e5 + 0.01], [1e5, 1e5, 1e5], size=(64, 64))
    drawn = flown.store.capture(flown.cut, eye).triangles.reshape(-1, 3)
    near = np.linalg.norm(drawn - np.asarray(eye.eye), axis=1).argmin()
    assert np.linalg.norm(mesh.positions - drawn[near], axis=1).min() < 1e-7


def test_a_closed_mesh_shows_its_outside_lit_from_every_side_and_an_open_one_its_inside(tmp_path: Path) -> None:
    sphere = lod.datasets.load("icosphere:level=4")
    for i, way in enumerate([(2.0, 0, 0), (-2.0, 0, 0), (0, 0, 2.0), (0, 1.0, -2.0)]):
        (tmp_path / str(i)).mkdir()
        flown = Flown(sphere, tmp_path / str(i), way)
        drawn = flown.store.draw(flown.cut, flown.view)
        seen = drawn.image[np.isfinite(drawn.depth)][:, :3].astype(int)
        assert seen.min() > 50  # nothing black
        assert (seen[:, 0] - seen[:, 1] < 40).all()  # clay, nowhere the colour of insides
    upper = sphere.positions[sphere.faces].mean(axis=1)[:, 2] > 0
    (tmp_path / "open").mkdir()
    flown = Flown(lod.Mesh(sphere.positions, sphere.faces[upper]), tmp_path / "open", (0.3, 0.0, -2.0))
    seen = flown.store.draw(flown.cut, flown.view).image[120, 160, :3].astype(int)
    assert seen[0] - seen[1] > 80  # from below into the bowl
    assert flown.row["crack_edges"] == 0


def test_vertex_colours_are_shown(tmp_path: Path) -> None:
    sphere = lod.datasets.load("icosphere:level=3")
    colors = np.where(sphere.positions[:, :1] > 0, [[255, 0, 0, 255]], [[0, 0, 255, 255]]).astype(np.uint8)
    flown = Flown(lod.Mesh(sphere.positions, sphere.faces, colors=colors), tmp_path, (0.0, -2.0, 0.0))
    image = flown.store.draw(flown.cut, flown.view).image.astype(int)
    left, right = image[120, 130], image[120, 190]
    assert left[2] > 150 > 60 > left[0] and right[0] > 150 > 60 > right[2]


def test_options_that_lay_rasters_are_refused(tmp_path: Path) -> None:
    with pytest.raises(lod.errors.Unsupported, match="needs a height field"):
        lod.build(lod.Mesh(*TRIANGLE), "full", tmp_path / "a.lod", normals="attribute", progress=False)
    with pytest.raises(lod.errors.Unsupported, match="method chunked does not accept a mesh"):
        lod.build(lod.Mesh(*TRIANGLE), "chunked", tmp_path / "a.lod", progress=False)


def test_the_same_mesh_gives_the_same_content_hash(tmp_path: Path) -> None:
    mesh = lod.datasets.load("blob:size=40")
    hashes = set()
    for threads in (1, 2):
        _core.set_thread_count(threads)
        try:
            store = lod.build(mesh, "full", tmp_path / f"{threads}.lod", progress=False)
        finally:
            _core.set_thread_count(0)
        hashes.add(store.info()["content_hash"])
    assert len(hashes) == 1 and lod.open(tmp_path / "1.lod").source.kind == "mesh"
