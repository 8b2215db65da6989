# SPDX-License-Identifier: MIT
"""`lodlab.measure`: any triangles against any source, on shapes whose answers are known on paper, and beside `fly`."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

import lodlab as lod
from lodlab import _core, errors
from lodlab.instrument.metrics import METRICS

NAMES = tuple(metric.name for metric in METRICS)
ON_SCREEN = ("measured_px_max", "measured_px_p99", "measured_px_rms", "psnr_db", "ssim", "flip", "crack_pixels")
OF_CUTS = ("predicted_px", "optimum_gap", "capture_mismatch_pixels", "pop_px_max", "pop_area")
TOLERANCE = 1e-3  # a maximum is attained, and the true one is at most this share larger


def bumpy(rows: int = 33, cols: int = 49) -> np.ndarray:
    """Heights (rows, cols) float32, metres, with relief at several wavelengths."""
    y, x = np.mgrid[0:rows, 0:cols]
    return (40 * np.sin(x / 7.0) * np.cos(y / 9.0) + 6 * np.sin(x * 1.3 + y * 0.7)).astype(np.float32)


def triangulated(field: lod.HeightField) -> np.ndarray:
    """Two triangles a cell, (T, 3, 3), cut as `full` cuts them."""
    rows, cols = field.shape
    y, x = np.mgrid[0:rows, 0:cols]
    if field.planet:
        frame = field.frame
        lon = np.radians(frame["lon0"] + x * frame["dlon"])
        lat = np.radians(frame["lat0"] - y * frame["dlat"])
        up = np.stack([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)], axis=-1)
        points = (field.radius + field.heights.astype(float))[..., None] * up
    else:
        (dx, dy), (x0, y0) = field.spacing, field.origin
        points = np.stack([x0 + x * dx, y0 - y * dy, np.nan_to_num(field.heights).astype(float)], axis=-1)
    a = (y * cols + x)[:-1, :-1]
    falling = ((y + x) % 2 == 0)[:-1, :-1, None]  # from north-west to south-east
    north_west, north_east, south_west, south_east = a, a + 1, a + cols, a + cols + 1

    def both(*corners: np.ndarray) -> np.ndarray:
        return np.stack(corners, axis=-1)

    first = np.where(falling, both(north_west, south_west, south_east), both(north_west, south_west, north_east))
    second = np.where(falling, both(north_west, south_east, north_east), both(north_east, south_west, south_east))
    return points.reshape(-1, 3)[np.concatenate([first.reshape(-1, 3), second.reshape(-1, 3)])]


def plate(cells: int, z: float = 0.0) -> lod.Mesh:
    """The unit square at height z, outside up."""
    y, x = np.mgrid[0 : cells + 1, 0 : cells + 1]
    points = np.stack([x / cells, y / cells, np.full(x.shape, z)], axis=-1).reshape(-1, 3)
    a = (y * (cells + 1) + x)[:-1, :-1].reshape(-1, 1)
    return lod.Mesh(points, np.concatenate([a + [0, 1, cells + 2], a + [0, cells + 2, cells + 1]]))


def above(eye: tuple[float, float, float], **more: object) -> _core.View:
    return _core.View(eye, (eye[0], eye[1], 0.0), up=(0.0, 1.0, 0.0), **{"size": (100, 100), "fov": 30.0, **more})


def sagitta(coarse: int, fine: int) -> float:
    """What parts two levels of the icosphere, over the middle of a face; tangents halve with every level."""
    inradius = (3 * math.sqrt(3) + math.sqrt(15)) / 12 / math.sqrt((5 + math.sqrt(5)) / 8)
    tangent = math.tan(math.acos(inradius))
    return math.cos(math.atan(tangent / 2**fine)) - math.cos(math.atan(tangent / 2**coarse))


def closest(drawn: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distances (N,) and closest points (N, 3), from every point to every triangle, by trimesh."""
    every = np.repeat(drawn, len(points), axis=0)
    near = trimesh.triangles.closest_point(every, np.tile(points, (len(drawn), 1))).reshape(len(drawn), -1, 3)
    distance = np.linalg.norm(near - points, axis=2)
    best = distance.argmin(axis=0)
    index = np.arange(len(points))
    return distance[best, index], near[best, index]


def thinned(mesh: lod.Mesh, cells: int) -> np.ndarray:
    """Triangles (T, 3, 3) of the mesh with the vertices of each cell of a grid made one, their mean."""
    size = np.ptp(mesh.positions, axis=0).max() / cells
    _, group = np.unique(np.floor((mesh.positions - mesh.bounds[0]) / size), axis=0, return_inverse=True)
    group = group.reshape(-1)
    mean = np.zeros((group.max() + 1, 3))
    np.add.at(mean, group, mesh.positions)
    mean /= np.bincount(group)[:, None]
    kept = group[mesh.faces]
    return mean[kept[(kept[:, 0] != kept[:, 1]) & (kept[:, 1] != kept[:, 2]) & (kept[:, 2] != kept[:, 0])]]


def test_a_triangulated_field_against_itself_is_zero() -> None:
    field = lod.HeightField(bumpy(), spacing=(10.0, 12.0))
    found = lod.measure(triangulated(field), field)
    assert tuple(found) == NAMES
    assert found["measured_max"] == found["measured_rms"] == 0.0
    assert found["hole_samples"] == found["crack_edges"] == found["inverted_triangles"] == 0
    assert found["measured_samples"] == field.samples
    assert all(math.isnan(found[name]) for name in (*ON_SCREEN, *OF_CUTS, "measured_max_drawn_to_source"))


def test_what_a_field_lacks_and_what_was_lifted_is_counted() -> None:
    field = lod.HeightField(bumpy(), spacing=(10.0, 12.0))
    triangles = triangulated(field) + [0.0, 0.0, 2.5]
    west = triangles[triangles[:, :, 0].min(axis=1) < 240.0 - 1e-9]  # without columns 25 to 48
    found = lod.measure(west, field)
    assert found["hole_samples"] == 33 * 24
    assert found["measured_max"] == math.inf
    assert lod.measure(triangles, field)["measured_max"] == pytest.approx(2.5, rel=1e-6)
    # The cut is no border of the field: 32 edges; the other three sides are.
    assert found["crack_edges"] == 32
    assert lod.measure(triangles[:, ::-1], field)["inverted_triangles"] == len(triangles)


def test_a_planet_within_the_rounding_of_positions() -> None:
    heights = bumpy(37, 72) * 100
    heights[[0, -1]] = heights[[0, -1], :1]  # a pole is one place
    field = lod.HeightField(heights, planet=True)
    found = lod.measure(triangulated(field), field)
    assert found["hole_samples"] == 0
    assert found["measured_max"] <= _core.world_slack(field.radius + 4600)


def test_a_field_that_is_read_by_windows(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LODLAB_WINDOW_SAMPLES", "1000")
    field = lod.datasets.load("fractal:size=65")
    assert field.windowed
    triangles = triangulated(field.loaded()) + [0.0, 0.0, 1.0]
    found = lod.measure(triangles, field, lod.View((900, -900, 6000), (900, -901, 0), size=(64, 64)))
    assert found["measured_max"] == pytest.approx(1.0, rel=1e-3)
    assert found["measured_px_max"] > 0.0
    assert math.isnan(found["psnr_db"])


@pytest.mark.parametrize("holed", [False, True])
def test_pictures_of_a_field_and_its_voids(holed: bool) -> None:
    heights = bumpy()
    if holed:
        heights[12:20, 20:33] = np.nan
    field = lod.HeightField(heights, spacing=(10.0, 12.0))
    view = lod.View((100.0, -600.0, 250.0), (240.0, -190.0, 0.0), size=(160, 120))
    found = lod.measure(triangulated(field), field, view)
    assert found["measured_px_max"] <= 0.01
    assert found["psnr_db"] > 55.0  # positions may differ from those of `full` in a last bit
    assert found["flip"] < 1e-3
    assert found["crack_pixels"] == 0
    assert found["drawn_triangles"] == 2 * 32 * 48


def test_fields_agree_with_fly(tmp_path: Path) -> None:
    field = lod.HeightField(bumpy(65, 97), spacing=(10.0, 12.0))
    store = lod.build(field, "chunked", tmp_path / "c.lod", progress=False, leaf=16)
    path = lod.CameraPath.walk(field, frames=1)
    budget = lod.Budget(pixel_error=8.0)
    view = path.view(0, size=(160, 120))
    row = lod.fly(store, path, budget, size=(160, 120), accuracy_frames=1, progress=False).frames.iloc[0]
    cut = store.select(view, budget)
    captured = store.capture(cut, view)
    assert captured.kind.any()
    found = lod.measure(captured, field, view)
    assert found["measured_max"] > 0.3
    for name in NAMES:
        if name in OF_CUTS or name == "drawn_triangles":  # culled nodes are captured, too
            continue
        assert found[name] == pytest.approx(row[name], rel=1e-9, abs=1e-12, nan_ok=True), name
    without = lod.measure(captured, field)
    assert without["measured_max"] == pytest.approx(row["measured_max"], abs=_core.world_slack(2000.0))


@pytest.fixture(scope="module")
def spheres() -> dict[int, lod.Mesh]:
    return {level: lod.datasets.load(f"icosphere:level={level}") for level in (0, 1, 3)}


def test_meshes_agree_with_the_instrument(tmp_path: Path, spheres: dict[int, lod.Mesh]) -> None:
    source, coarse = spheres[3], spheres[1]
    full = lod.build(source, "full", tmp_path / "source.lod", progress=False).core.session({})
    session = lod.build(coarse, "full", tmp_path / "coarse.lod", progress=False).core.session({})
    view = lod.View((1.0, -2.5, 1.5), (0.0, 0.0, 0.0), size=(160, 120))
    instrument = _core.Instrument(source.core, full)
    cut = session.cut(np.array([0]))
    measured = instrument.examine_parts([(session, cut)], view, instrument.reference(view))
    found = lod.measure(session.capture(cut, view), source, view)
    for name in NAMES:
        if name in OF_CUTS:
            continue
        assert found[name] == pytest.approx(getattr(measured, name), rel=1e-9, nan_ok=True), name
    assert found["measured_px_max"] > 1.0


def test_spheres_of_known_tessellation(spheres: dict[int, lod.Mesh]) -> None:
    for coarse in (0, 1):
        found = lod.measure(spheres[coarse], spheres[3])
        for name in ("measured_max", "measured_max_source_to_drawn", "measured_max_drawn_to_source"):
            assert found[name] == pytest.approx(sagitta(coarse, 3), rel=TOLERANCE)
        assert found["crack_edges"] == 0


def test_two_shells_a_known_gap_apart(spheres: dict[int, lod.Mesh]) -> None:
    ico = spheres[0]
    found = lod.measure(1.1 * ico.positions[ico.faces], ico)
    inradius = (3 * math.sqrt(3) + math.sqrt(15)) / 12 / math.sqrt((5 + math.sqrt(5)) / 8)
    # Corners lie farthest outside; from within, planes are everywhere as near.
    assert found["measured_max_drawn_to_source"] == pytest.approx(0.1, rel=TOLERANCE)
    assert found["measured_max_source_to_drawn"] == pytest.approx(0.1 * inradius, rel=TOLERANCE)
    assert found["measured_rms_source_to_drawn"] == pytest.approx(0.1 * inradius, rel=1e-6)  # positions are floats
    assert found["measured_max"] == found["measured_max_drawn_to_source"]


def test_every_way_to_say_triangles(spheres: dict[int, lod.Mesh]) -> None:
    mesh, source = spheres[1], spheres[3]
    soup = mesh.positions[mesh.faces]
    wanted = lod.measure(mesh, source)
    ways = (soup, soup.tolist(), soup[::-1], np.asfortranarray(soup), (mesh.positions, mesh.faces))
    for way in (*ways, trimesh.Trimesh(mesh.positions, mesh.faces, process=False)):
        found = lod.measure(way, source)
        assert {k: v for k, v in found.items() if v == v} == {
            k: pytest.approx(v, rel=1e-12) for k, v in wanted.items() if v == v
        }
    # Integers are numbers as good as any.
    cube = trimesh.creation.box((2, 2, 2))
    assert lod.measure(cube.triangles.astype(int), cube)["measured_max"] == 0.0


def test_cracks_of_triangles(spheres: dict[int, lod.Mesh]) -> None:
    source = spheres[3]
    torn = np.delete(source.faces, 100, axis=0)
    assert lod.measure((source.positions, torn), source)["crack_edges"] == 3
    turned = source.faces.copy()
    turned[100] = turned[100, ::-1]
    assert lod.measure((source.positions, turned), source)["inverted_triangles"] == 1
    # An open patch ends where the source does; with a coarser border as near as the measured error.
    ring = lod.Mesh(source.positions, source.faces[source.positions[source.faces][:, :, 2].min(axis=1) > 0.0])
    assert lod.measure(ring, ring)["crack_edges"] == 0
    assert lod.measure(plate(1), plate(8))["crack_edges"] == 0
    assert lod.measure(plate(8).positions[plate(8).faces][5:], plate(8))["crack_edges"] > 0


def test_a_square_lowered_under_a_view() -> None:
    drop, away, side = 0.01, 3.0, 100
    view = above((0.5, 0.5, away))
    found = lod.measure(plate(3, -drop), plate(20), view)
    assert found["measured_max"] == pytest.approx(drop, rel=1e-12)
    scale = side / 2 / math.tan(math.radians(15.0))
    to_edge = scale * 0.5 / away  # the whole square is in view
    assert to_edge < side / 2
    # Both are parallel to the picture: a corner moves towards the middle by 1 - away / (away + drop).
    share = 1 - away / (away + drop)
    assert found["measured_px_max"] == pytest.approx(math.sqrt(2) * to_edge * share, rel=1e-9)
    y, x = np.mgrid[0:side, 0:side] + 0.5 - side / 2
    covered = (np.abs(x) <= to_edge) & (np.abs(y) <= to_edge)
    moved = np.sort(np.hypot(x, y)[covered] * share)
    assert found["measured_px_p99"] == pytest.approx(moved[math.ceil(0.99 * moved.size) - 1], rel=1e-3)
    assert found["measured_px_rms"] == pytest.approx(math.sqrt((moved**2).mean()), rel=1e-3)
    assert found["drawn_triangles"] == 18
    # Nothing is drawn, and nothing opened, without a view.
    without = lod.measure(plate(3, -drop), plate(20))
    assert all(math.isnan(without[name]) for name in ON_SCREEN)
    assert without["measured_max"] == found["measured_max"]


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 12), st.integers(1, 12), st.sampled_from([0.0, 1.0, 6.4e6]))
def test_random_triangles_against_numpy(seed: int, count: int, drawn_count: int, offset: float) -> None:
    rng = np.random.default_rng(seed)
    triangles = rng.uniform(-1, 1, (count, 3, 3)) + offset
    drawn = rng.uniform(-1, 1, (drawn_count, 3, 3)) + offset
    source = lod.Mesh(triangles.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3))
    found = lod.measure(drawn, source)
    # All points of a lattice on every source triangle; nothing on it is farther than a step from one of them.
    steps = 24
    i, j = np.mgrid[0 : steps + 1, 0 : steps + 1]
    weights = np.stack([i, j, steps - i - j], -1)[i + j <= steps] / steps
    points = np.einsum("nk,tkc->tnc", weights, triangles - offset)
    edges = triangles - np.roll(triangles, 1, axis=1)
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
    flat = plate(8)
    points = flat.positions + np.random.default_rng(5).uniform(-0.1, 0.1, (81, 1)) * [0, 0, 1]
    drawn = plate(2)
    view = lod.View((0.5, -0.8, 0.5), (0.5, 0.5, 0.0), size=(320, 200), fov=50.0)
    _, near = closest(drawn.positions[drawn.faces], points)

    def project(points: np.ndarray) -> np.ndarray:
        clip = np.c_[points, np.ones(len(points))] @ np.asarray(view.matrix).T
        return clip[:, :2] / clip[:, 3:] * [160, 100]

    inside = np.all(np.abs(project(points)) <= [160, 100], axis=1)
    assert 10 < inside.sum() < len(points)  # some are out of view, all in front of the eye
    expected = np.linalg.norm(project(points) - project(near), axis=1)[inside].max()
    found = lod.measure(drawn, lod.Mesh(points, flat.faces), view)
    assert found["measured_px_max"] == pytest.approx(expected, rel=1e-6)


def test_a_real_mesh(shared_data: Callable[[str], Path]) -> None:
    mesh = lod.Mesh.open(shared_data("mesh/horse.ply"))
    # No point is farther from the moved mesh than it moved; somewhere on a closed mesh it moved straight out.
    shift = np.array([0.36, 0.48, 0.8]) * 1e-4 * mesh.extent
    moved = lod.measure(mesh.positions[mesh.faces] + shift, mesh)
    for name in ("measured_max_source_to_drawn", "measured_max_drawn_to_source"):
        assert moved[name] == pytest.approx(np.linalg.norm(shift), rel=2 * TOLERANCE)
    drawn = thinned(mesh, 50)
    assert len(drawn) < len(mesh.faces) / 10
    found = lod.measure(drawn, mesh)
    # A thinned vertex is the mean of a cell; the surface lies within a few cells of the source.
    cell = float(np.ptp(mesh.positions, axis=0).max()) / 50
    assert 0.1 * cell < found["measured_max"] < 3 * cell
    assert found["measured_rms"] < 0.2 * found["measured_max"]
    some = np.random.default_rng(1).choice(mesh.samples, 100, replace=False)
    distances, _ = closest(drawn, mesh.positions[some])
    assert distances.max() <= found["measured_max_source_to_drawn"] * (1 + 1e-9)


def test_colours_of_the_source_are_no_difference() -> None:
    bare = lod.datasets.load("icosphere:level=2")
    shades = np.random.default_rng(1).integers(0, 256, (bare.samples, 3))
    painted = lod.Mesh(bare.positions, bare.faces, colors=shades)
    found = lod.measure(bare, painted, lod.View((0.0, -3.0, 0.5), (0.0, 0.0, 0.0), size=(80, 60)))
    assert found["psnr_db"] > 60.0
    assert found["crack_pixels"] == 0


def test_what_cannot_be_measured_is_refused() -> None:
    source = plate(2)
    good = source.positions[source.faces]
    broken = good.copy()
    broken[3, 1, 2] = math.nan
    far = above((0.5, 0.5, 1e9))
    for triangles, view, part in (
        (good[0], None, r"float64 of shape \(3, 3\), not real numbers \(T, 3, 3\)"),
        (good[:, :2], None, r"shape \(8, 2, 3\)"),
        (good.astype(complex), None, "complex128"),
        ("icosphere", None, "not real numbers"),
        (None, None, "not real numbers"),
        ([[1, 2], [3]], None, "no array|not real numbers"),
        (good[:0], None, "no triangles"),
        ([], None, "not real numbers"),
        (broken, None, r"triangle 3 has a vertex at \(.*nan\); positions must be finite"),
        (np.full_like(good, math.inf), None, "triangle 0 has a vertex at"),
        (good * 1e31, None, "within 1e[+]30"),
        ((source.positions, source.faces + 9), None, "names vertex"),
        (tuple(good[:2]), None, "not whole numbers"),
        (good, (0, 0, 1), "is no lodlab.View"),
        (good, far, "eye"),
    ):
        with pytest.raises(errors.InvalidInput, match=part):
            lod.measure(triangles, source, view)
    for other in (None, 3, object()):
        with pytest.raises(errors.InvalidInput, match="source: "):
            lod.measure(good, other)
