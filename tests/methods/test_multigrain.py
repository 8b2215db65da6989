# SPDX-License-Identifier: MIT
"""multigrain against the contract of all methods, and what is its own: stitching across any level, planets."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
import pytest

import lodlab as lod
from lodlab import _core
from lodlab.instrument.audit import random_cut
from tests.contract import MethodContract, over


class TestMultigrain(MethodContract):
    method = "multigrain"
    build_options: ClassVar[dict[str, object]] = {"chart": 64, "levels": 4}


def flyover_views(field: lod.HeightField, count: int, size: tuple[int, int] = (640, 360)) -> list[_core.View]:
    path = lod.CameraPath.flyover(field, frames=count)
    return [path.view(f, size=size) for f in range(count)]


@pytest.fixture(scope="module", params=["jacksboro", "planet"])
def lab(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory):
    if request.param == "planet":
        earth = lod.datasets.load("earth:planet=true")
        heights = np.asarray(earth.heights)[::24, ::24] * 20.0
        field = lod.HeightField(np.ascontiguousarray(heights), planet=True)
    else:
        field = lod.datasets.load(request.param)
    folder = tmp_path_factory.mktemp(request.param)
    store = lod.build(field, "multigrain", folder / "m.lod", progress=False)
    full = lod.build(field, "full", folder / "full.lod", progress=False)
    return field, store, _core.Instrument(field.core, full.core.session({}))


def test_random_cuts_have_no_crack_and_keep_their_bounds(lab) -> None:
    field, store, instrument = lab
    session, view = store.core.session({}), flyover_views(field, 3)[1]
    random = np.random.default_rng(5)
    for _ in range(30):
        cut = session.cut(*random_cut(store.nodes, random, float(np.sqrt(random.random()))))
        found = instrument.examine(session, cut, view, pictures=False)
        assert (found.crack_edges, found.hole_samples, found.inverted_triangles) == (0, 0, 0)
        nodes, errors = found.node_errors()
        bounds = cut.nodes["error"][np.searchsorted(cut.nodes["node"], nodes)]
        assert (errors <= bounds + instrument.slack(view)).all()


@pytest.mark.parametrize(
    "budget",
    [
        {"pixel_error": 1.0},
        {"pixel_error": 2.0, "nodes": 40},
        {"triangles": 30_000},
        {"triangles": 30_000, "nodes": 60},
    ],
)
def test_flights_keep_their_budgets_without_cracks(lab, budget: dict[str, float]) -> None:
    field, store, instrument = lab
    session = store.core.session({"stream": False})
    for view in flyover_views(field, 6):
        cut, row = session.time_frame(view, _core.Budget(**budget))
        found = instrument.examine(session, cut, view, instrument.reference(view))
        assert (found.crack_edges, found.crack_pixels, found.capture_mismatch_pixels) == (0, 0, 0)
        assert cut.promises_bound
        seen = found.measured_px_max
        assert np.isnan(seen) or seen <= cut.predicted_px + _core.SLACK_PIXELS + _core.world_slack(1.0) * 640
        if cut.budget_met:
            assert row["triangles"] <= budget.get("triangles", np.inf) and row["nodes"] <= budget.get("nodes", np.inf)


@pytest.fixture(scope="module")
def earth(tmp_path_factory: pytest.TempPathFactory) -> tuple[lod.HeightField, lod.Store]:
    """Every sixth sample of the Earth, five times as high."""
    heights = np.asarray(lod.datasets.load("earth:planet=true").heights)[::6, ::6] * 5.0
    field = lod.HeightField(np.ascontiguousarray(heights), planet=True)
    folder = tmp_path_factory.mktemp("earth")
    return field, lod.build(field, "multigrain", folder / "m.lod", progress=False, chart=128, levels=4)


def earth_view(field: lod.HeightField, place: str) -> _core.View:
    def up(latitude: float, longitude: float) -> np.ndarray:
        lat, lon = np.radians(latitude), np.radians(longitude)
        return np.array([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)])

    rows, cols = field.shape
    row, col = rows * 62 // 180, cols * 86 // 360  # the Himalaya
    valley = float(np.asarray(field.heights)[row, col])
    here = up(90.0 - 180.0 * row / (rows - 1), 360.0 * col / cols)
    north = np.array([0.0, 0.0, 1.0]) - here[2] * here
    if place == "space":
        eye, target = 3.0 * field.radius * here, np.zeros(3)
    elif place == "low orbit":
        eye = (field.radius + 400e3) * here
        target = eye + 1000e3 * (north - 0.35 * here)
    else:
        eye = (field.radius + valley + 300.0) * here
        target = eye + 10e3 * (north + 0.02 * here)
    return _core.View(tuple(eye), tuple(target), up=tuple(here + north), fov=75.0, size=(480, 300))


@pytest.mark.parametrize("place", ["space", "low orbit", "ground"])
@pytest.mark.parametrize("budget", [{"pixel_error": 1.0}, {"triangles": 20_000}])
def test_what_the_horizon_culls_is_not_in_the_picture(earth, place: str, budget: dict[str, float]) -> None:
    field, store = earth
    view, session = earth_view(field, place), store.core.session({"stream": False})
    cut = session.select(view, _core.Budget(**budget))
    everything = session.cut(cut.nodes["node"], cut.nodes["resolution"])  # by hand: nothing is culled
    drawn, whole = session.draw(cut, view), session.draw(everything, view)
    assert np.array_equal(drawn.image, whole.image)
    assert np.array_equal(drawn.depth, whole.depth, equal_nan=True)
    assert np.isfinite(drawn.depth).mean() > 0.1
    if place == "ground":  # in a valley nothing tells ground that hides from ground that one is under
        return
    # The frustum alone would not have culled them: their middles are in it.
    nodes = store.nodes[np.unique(store.nodes["id"], return_index=True)[1]][cut.nodes["node"]]
    middle = np.column_stack([0.5 * (nodes["box_min"] + nodes["box_max"]), np.ones(len(nodes))])
    clip = middle @ np.asarray(view.matrix).T
    inside = (clip[:, 3] > 0) & (np.abs(clip[:, :2]) <= clip[:, 3:]).all(axis=1)
    assert (inside & ~cut.nodes["visible"]).sum() > 0.2 * inside.sum()


def open_globe(kind: str) -> lod.HeightField:
    """A globe of ridges 2 km high: closed, with a hole of voids, or a quarter of it."""
    heights = np.zeros((46, 90))
    heights[::2, ::2] = 2000.0
    if kind == "voids":
        heights[5:40, 0:20] = np.nan
    if kind == "patch":
        return lod.HeightField(heights[:23, :45], planet=True, degrees=(0.0, 11.0, 1.0, 1.0))
    return lod.HeightField(heights, planet=True)


@pytest.mark.parametrize(
    "kind", ["voids", "patch", "under the lowest sample", "in a mountain", "within the near plane"]
)
def test_what_is_seen_through_an_opening_of_a_globe_or_from_under_its_ground_is_drawn(kind: str, tmp_path) -> None:
    field = open_globe(kind)
    radius = field.radius
    top = field.core.position(np.array([20]), np.array([30]))[0]
    here = top / np.linalg.norm(top)
    side = np.cross(here, [0.0, 0.0, 1.0])
    into = side * 1e6 - here * 3e5
    behind = -2.5 * field.core.position(np.array([11]), np.array([22]))[0]
    eye, target, near = {
        "voids": (field.core.position(np.array([22]), np.array([10]))[0] * 2.0, np.zeros(3), None),
        "patch": (behind, np.zeros(3), None),
        "under the lowest sample": ((radius - 100.0) * here, (radius - 100.0) * here + into, None),
        "in a mountain": ((radius + 1000.0) * here, (radius + 1000.0) * here + into, None),
        "within the near plane": ((radius + 3000.0) * here, (radius + 3000.0) * here - here * 1e6, 5e4),
    }[kind]
    view = _core.View(tuple(eye), tuple(target), fov=40.0 if kind == "patch" else 90.0, size=(200, 150), near=near)
    store = lod.build(field, "multigrain", tmp_path / "m.lod", progress=False)
    full = lod.build(field, "full", tmp_path / "full.lod", progress=False)
    instrument, session = _core.Instrument(field.core, full.core.session({})), store.core.session({"stream": False})
    reference = instrument.reference(view)
    seen = np.isfinite(reference.depth)
    assert seen.mean() > 0.02
    for budget in ({"pixel_error": 1.0}, {"triangles": 3000}):
        cut = session.select(view, _core.Budget(**budget))
        found = instrument.examine(session, cut, view, reference)
        assert found.capture_mismatch_pixels == 0
        assert not found.measured_px_max > cut.predicted_px + _core.SLACK_PIXELS + _core.world_slack(1.0) * 200
        assert (np.isfinite(session.draw(cut, view).depth) != seen).sum() < 0.02 * seen.sum()


@pytest.mark.parametrize("normals", ["geometric", "attribute"])
@pytest.mark.parametrize("degrees", [(5.0, 70.0, 0.05, 0.05), (5.0, -60.0, 0.05, 0.05), (5.0, 5.0, 0.05, 0.05)])
def test_a_patch_of_a_planet_has_no_gap_along_its_border_at_any_budget(degrees, normals: str, tmp_path) -> None:
    lon, lat = np.radians(0.05 * np.arange(100))[None, :], np.radians(0.05 * np.arange(100))[:, None]
    heights = 1500.0 * (1.0 + np.sin(37 * lon) * np.cos(29 * lat) + 0.3 * np.sin(211 * lon + 97 * lat))
    field = lod.HeightField(heights, planet=True, degrees=degrees)
    store = lod.build(field, "multigrain", tmp_path / "m.lod", progress=False, normals=normals)
    full = lod.build(field, "full", tmp_path / "full.lod", progress=False, normals=normals)
    instrument, session = _core.Instrument(field.core, full.core.session({})), store.core.session({"stream": False})
    middle = field.core.position(np.array([50]), np.array([50]))[0]
    view = _core.View(tuple(1.15 * middle), tuple(middle), up=(0.0, 0.0, 1.0), size=(200, 150), fov=50.0)
    reference = instrument.reference(view)
    for budget in ({"pixel_error": 0.05}, {"pixel_error": 1.0}, {"triangles": 1500}, {"triangles": 6000}):
        cut, row = session.time_frame(view, _core.Budget(**budget))
        found = instrument.examine(session, cut, view, reference)
        assert (found.hole_samples, found.crack_edges, found.capture_mismatch_pixels) == (0, 0, 0)
        assert found.measured_px_max <= cut.predicted_px + _core.SLACK_PIXELS + _core.world_slack(1.0) * 200
        assert cut.budget_met and row["triangles"] == found.drawn_triangles == cut.triangles
        assert row["triangles"] <= budget.get("triangles", np.inf)


def test_by_a_pole_no_bound_is_more_than_the_relief(tmp_path) -> None:
    """Half a millimetre from column to column, and cliffs of 100 m between them: triangles as steep as rays."""
    heights = 100.0 * np.add.outer(np.arange(2), np.arange(9)).astype(np.float32)
    field = lod.HeightField(heights, planet=True, degrees=(0.0, 90.0, 1.2e-3, 2.3e-4))
    store = lod.build(field, "multigrain", tmp_path / "pole.lod", progress=False)
    assert store.nodes["error"].max() < 900.1


def test_slopes_of_a_million_take_no_digits_from_bounds(tmp_path) -> None:
    """Columns a micrometre apart, heights of metres: samples on snapped edges were taken to lie beside them."""
    heights = np.random.default_rng(2).normal(size=(17, 44))
    field = lod.HeightField(heights, planet=True, radius=100.0, degrees=(-147.0, -11.4, 4e-7, 4.6e-4))
    store = lod.build(field, "multigrain", tmp_path / "steep.lod", progress=False)
    assert len(lod.instrument.audit(store, cuts=5, progress=False).broken) == 0


@pytest.mark.parametrize("radius", [500.0, 6371000.0])
def test_an_eye_on_a_sample_of_a_patch_finds_no_crack_of_the_lattice(radius: float, tmp_path) -> None:
    """There floats are finer than the lattice of positions, which the slack of the instrument counts as well."""
    field = lod.HeightField(np.zeros((3, 4)), planet=True, radius=radius, degrees=(-24.26, -24.53, 2.2, 1.9))
    store = lod.build(field, "multigrain", tmp_path / "m.lod", progress=False)
    instrument, session = _core.Instrument(field.core, None), store.core.session({})
    for row, col in ((0, 0), (0, 2), (1, 3), (2, 1)):
        eye = field.core.position(np.array([row]), np.array([col]))[0]
        view = _core.View(tuple(eye), tuple(1.1 * eye + 0.01 * radius), size=(64, 48))
        found = instrument.examine(session, session.select(view, _core.Budget(pixel_error=1.0)), view, pictures=False)
        assert (found.hole_samples, found.crack_edges) == (0, 0)


def test_vertical_projection_on_a_planet_is_refused_since_up_is_not_z(earth) -> None:
    _, store = earth
    with pytest.raises(lod.errors.Unsupported, match="projection = vertical .* flat fields only"):
        store.core.session({"projection": "vertical"})


def test_coarse_triangles_of_a_planet_keep_the_colours_of_their_heights(tmp_path) -> None:
    heights = np.full((65, 128), 100.0, np.float32)
    heights[1, 1] = -4000.0  # somewhere there is sea; no coarse grid has this sample
    field = lod.HeightField(heights, planet=True)
    store = lod.build(field, "multigrain", tmp_path / "m.lod", progress=False)
    roots = store.nodes[store.nodes["parent"] < 0]
    coarse = [min(roots["resolution"][roots["id"] == root]) for root in np.unique(roots["id"])]
    view = lod.View((3.0 * field.radius, 0.0, 0.0), (0.0, 0.0, 0.0), size=(160, 160))
    frame = store.draw(store.cut(np.unique(roots["id"]), coarse), view)
    drawn = frame.image[np.isfinite(frame.depth)].astype(int)
    # Between their vertices triangles lie kilometres below the sphere; sea is bluer than red, land is not.
    assert len(drawn) > 1000 and (drawn[:, 0] >= drawn[:, 2]).all()


@pytest.fixture(scope="module")
def terrain(tmp_path_factory: pytest.TempPathFactory):
    """A fractal, a store of it, and its instrument; its tiles are some 8 MiB."""
    field = lod.HeightField(_core.fractal(1025, 1025, 0, 0, seed=1, roughness=0.5))
    folder = tmp_path_factory.mktemp("paging")
    store = lod.build(field, "multigrain", folder / "m.lod", progress=False)
    full = lod.build(field, "full", folder / "full.lod", progress=False)
    return field, store, _core.Instrument(field.core, full.core.session({}))


@pytest.fixture(scope="module")
def small_tiles(terrain, tmp_path_factory: pytest.TempPathFactory) -> lod.Store:
    """The same with tiles of 18 KiB, some 6 MiB in all."""
    path = tmp_path_factory.mktemp("small") / "m.lod"
    return lod.build(terrain[0], "multigrain", path, progress=False, node_resolution=64)


def chosen(cut) -> tuple[bytes, bytes]:
    return cut.nodes["node"].tobytes(), cut.nodes["resolution"].tobytes()


@pytest.mark.parametrize(
    ("adapt", "budget"),
    [
        ("topdown", {"pixel_error": 1.0}),
        ("topdown", {"pixel_error": 1.0, "nodes": 60}),
        ("dual", {"pixel_error": 1.0}),
        ("quad", {"triangles": 40_000}),
        ("level", {"triangles": 40_000}),
        ("exact", {"triangles": 40_000, "nodes": 100}),
        ("exact", {"pixel_error": 1.0}),
    ],
)
def test_streaming_settles_on_the_cut_of_loaded_data(terrain, adapt: str, budget: dict[str, float]) -> None:
    field, store, _ = terrain
    view, limits = flyover_views(field, 6)[2], _core.Budget(**budget)
    loaded = store.core.session({"stream": False, "adapt": adapt})
    session = store.core.session({"stream": True, "adapt": adapt})
    first, row = session.time_frame(view, limits)
    assert first.missing_nodes > 0
    assert row["page_misses"] > 0
    if "pixel_error" in budget:
        assert first.predicted_px > 1.0
        assert not first.budget_met
    cuts = []
    for _ in range(12):
        session.settle()
        cuts.append(session.time_frame(view, limits)[0])
    assert cuts[-1].missing_nodes == 0
    assert chosen(cuts[-1]) == chosen(cuts[-2])
    if adapt in ("topdown", "exact"):
        assert chosen(cuts[-1]) == chosen(loaded.select(view, limits))
    else:  # starts from the last cut: another one, as good
        for _ in range(12):
            wanted = loaded.select(view, limits)
        assert cuts[-1].predicted_px <= max(1.25 * wanted.predicted_px, budget.get("pixel_error", 0.0))


@pytest.mark.parametrize(
    ("adapt", "budget"),
    [
        ("topdown", {"pixel_error": 1.0, "nodes": 100}),
        ("dual", {"pixel_error": 1.0, "nodes": 100}),
        ("quad", {"triangles": 40_000}),
        ("level", {"triangles": 40_000, "nodes": 100}),
        ("exact", {"triangles": 40_000, "nodes": 100}),
    ],
)
def test_slow_storage_never_delays_a_frame_nor_opens_a_crack(terrain, adapt: str, budget: dict[str, float]) -> None:
    field, store, instrument = terrain
    session = store.core.session({"stream": True, "adapt": adapt, "fetch_delay_ms": 200})
    for view in flyover_views(field, 5, size=(160, 90)):
        cut, row = session.time_frame(view, _core.Budget(**budget))
        assert cut.missing_nodes > 0, "a frame that waits for storage misses nothing"
        assert row["nodes"] <= budget.get("nodes", np.inf)
        assert row["triangles"] <= budget.get("triangles", np.inf)
        found = instrument.examine(session, cut, view, pictures=False)
        assert (found.crack_edges, found.hole_samples) == (0, 0)


@pytest.mark.parametrize("adapt", ["topdown", "dual", "quad", "level", "exact"])
def test_small_caches_are_hard_limits_and_eviction_opens_no_crack(terrain, small_tiles, adapt: str) -> None:
    field, _, instrument = terrain
    session = small_tiles.core.session({"stream": True, "adapt": adapt, "cpu_cache_mb": 1, "gpu_cache_mb": 1})
    budget = _core.Budget(pixel_error=0.4) if adapt in ("topdown", "dual") else _core.Budget(triangles=60_000)
    uploads = 0
    for view in [*flyover_views(field, 7, size=(160, 90)), *reversed(flyover_views(field, 7, size=(160, 90)))]:
        for _ in range(3):
            session.settle()
            cut, row = session.time_frame(view, budget)
            uploads += row["upload_bytes"]
            assert row["resident_bytes"] <= 1 << 20
        found = instrument.examine(session, cut, view, pictures=False)
        assert (found.crack_edges, found.hole_samples) == (0, 0)
        seen = found.measured_px_max
        assert np.isnan(seen) or seen <= cut.predicted_px + _core.SLACK_PIXELS + _core.world_slack(1.0) * 640
    assert uploads > 1 << 20  # more than there is room for: tiles went again


def test_small_caches_are_hard_limits_on_planets_too(earth, tmp_path) -> None:
    field, _ = earth
    store = lod.build(field, "multigrain", tmp_path / "m.lod", progress=False, chart=128, levels=4, node_resolution=32)
    instrument, session = (
        _core.Instrument(field.core, None),
        store.core.session({"stream": True, "gpu_cache_mb": 3, "cpu_cache_mb": 3}),
    )
    sides = np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0], [1, 0, 0]]) * 1.5 * field.radius
    uploads = 0
    for view in [_core.View(tuple(side), (0.0, 0.0, 0.0), fov=100.0, size=(480, 300)) for side in sides]:
        for _ in range(9):
            session.settle()
            cut, row = session.time_frame(view, _core.Budget(pixel_error=0.01))
            uploads += row["upload_bytes"]
            assert row["resident_bytes"] <= 3 << 20
        found = instrument.examine(session, cut, view, pictures=False)
        assert (found.crack_edges, found.hole_samples) == (0, 0)
        assert found.measured_px_max <= cut.predicted_px + _core.SLACK_PIXELS + _core.world_slack(1.0) * 480
    assert uploads > 2 * (3 << 20)  # more than there is room for: tiles went again


def test_without_streaming_a_cut_larger_than_memory_is_drawn_in_rounds(terrain, small_tiles) -> None:
    field, _, instrument = terrain
    view = flyover_views(field, 3)[1]
    small, large = (small_tiles.core.session({"stream": False, "gpu_cache_mb": mb}) for mb in (1, 64))
    cut = small.select(view, _core.Budget(pixel_error=0.5))
    assert cut.missing_nodes == 0
    assert chosen(cut) == chosen(large.select(view, _core.Budget(pixel_error=0.5)))
    drawn, row = small.time_frame(view, _core.Budget(pixel_error=0.5))
    assert row["draw_calls"] > 1
    assert row["resident_bytes"] <= 1 << 20
    assert np.array_equal(small.draw(cut, view).image, large.draw(cut, view).image)
    assert instrument.examine(small, drawn, view, pictures=False).crack_edges == 0


def test_caches_smaller_than_the_roots_are_refused_with_the_least_size(terrain) -> None:
    _, store, _ = terrain
    for stream in (False, True):
        with pytest.raises(lod.errors.InvalidInput, match=r"gpu_cache_mb of at least \d+, not 1"):
            store.core.session({"stream": stream, "gpu_cache_mb": 1})


def test_cuts_by_hand_promise_no_more_than_selected_ones(tmp_path) -> None:
    field = lod.HeightField(_core.fractal(60, 60, 0, 0, seed=1, roughness=0.5))
    for bounds in ("drawn", "bilinear"):
        store = lod.build(field, "multigrain", tmp_path / f"{bounds}.lod", progress=False, bounds=bounds)
        session = store.core.session({"stream": False})
        roots = np.unique(store.nodes["id"][store.nodes["parent"] < 0])
        selected = session.select(over(field), _core.Budget(pixel_error=1.0))
        assert session.cut(roots, None).promises_bound == selected.promises_bound == (bounds == "drawn")


@pytest.mark.parametrize("whole", [True, False])
def test_boxes_hold_a_pole_whose_columns_have_different_heights(tmp_path, whole: bool) -> None:
    """All of a pole's row is drawn at its column 0: boxes of the other columns reach as far."""
    heights = np.full((9, 24), 500.0)
    heights[0], heights[0, 0] = 900.0, 0.0
    degrees = None if whole else (0.0, 90.0, 3.0, 2.0)
    field = lod.HeightField(heights, planet=True, radius=5000.0, degrees=degrees)
    store = lod.build(field, "multigrain", tmp_path / "s.lod", progress=False, chart=8, levels=2, node_resolution=4)
    session, nodes = store.core.session({"stream": False}), store.nodes
    for cut in session.audit_cuts():
        capture = session.capture(cut, _core.View((9e3, 0.0, 9e3), (0.0, 0.0, 5e3)))
        for node in np.unique(capture.node):
            row = nodes[nodes["id"] == node][0]
            corners = capture.triangles[capture.node == node].reshape(-1, 3)
            assert (corners >= row["box_min"] - 0.01).all() and (corners <= row["box_max"] + 0.01).all()
