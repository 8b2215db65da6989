# SPDX-License-Identifier: MIT
"""seamless against the contract of all methods, and what is its own: edges that agree, the paper's settings that do
not, fields of any size."""

from __future__ import annotations

import sqlite3
from typing import ClassVar

import numpy as np
import pytest

import lodlab as lod
from lodlab import _core
from lodlab.instrument.audit import any_cut
from tests.contract import MethodContract


class TestSeamless(MethodContract):
    method = "seamless"
    build_options: ClassVar[dict[str, object]] = {"patch": 8}


class TestSeamlessWithThreeResolutions(MethodContract):
    method = "seamless"
    build_options: ClassVar[dict[str, object]] = {"patch": 8, "resolutions": 3}


class Lab:
    """A field with a store and what measures it."""

    def __init__(self, field: lod.HeightField, folder, **options: object) -> None:
        self.field = field
        self.store = lod.build(field, "seamless", folder / "s.lod", progress=False, **options)
        full = lod.build(field, "full", folder / "full.lod", progress=False)
        self.instrument = _core.Instrument(field.core, full.core.session({}))

    def views(self, count: int, size: tuple[int, int] = (640, 360)) -> list[_core.View]:
        path = lod.CameraPath.flyover(self.field, frames=count)
        return [path.view(f, size=size) for f in range(count)]

    def examine(self, session, cut, view):
        return self.instrument.examine(session, cut, view, self.instrument.reference(view))


@pytest.fixture(scope="module", params=[2, 3])
def lab(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Lab:
    folder = tmp_path_factory.mktemp(f"seamless-{request.param}")
    return Lab(lod.datasets.load("jacksboro"), folder, patch=16, resolutions=request.param)


@pytest.fixture(scope="module")
def averaged(tmp_path_factory: pytest.TempPathFactory) -> Lab:
    folder = tmp_path_factory.mktemp("seamless-average")
    return Lab(lod.datasets.load("jacksboro"), folder, patch=16, pyramid="average")


@pytest.mark.parametrize(
    "budget",
    [
        {"pixel_error": 0.5},
        {"pixel_error": 4.0},
        {"triangles": 20_000},
        {"triangles": 1_500},
        {"nodes": 12},
        {"pixel_error": 1.0, "triangles": 30_000},
    ],
)
def test_flights_keep_their_budgets_without_cracks(lab: Lab, budget: dict[str, float]) -> None:
    session = lab.store.core.session({"stream": False})
    for view in lab.views(6):
        cut, row = session.time_frame(view, _core.Budget(**budget))
        found = lab.examine(session, cut, view)
        assert (found.crack_edges, found.crack_pixels, found.capture_mismatch_pixels) == (0, 0, 0)
        assert cut.promises_bound
        seen = found.measured_px_max
        assert np.isnan(seen) or seen <= cut.predicted_px + _core.SLACK_PIXELS + _core.world_slack(1.0) * 640
        if cut.budget_met:
            assert row["triangles"] <= budget.get("triangles", np.inf) and row["nodes"] <= budget.get("nodes", np.inf)
        if "pixel_error" in budget and len(budget) == 1:
            assert cut.budget_met


def test_random_cuts_have_no_crack_and_keep_their_bounds(lab: Lab) -> None:
    session, view = lab.store.core.session({}), lab.views(3)[1]
    random = np.random.default_rng(5)
    for _ in range(30):
        cut = any_cut(session, lab.store.nodes, random)
        found = lab.instrument.examine(session, cut, view, pictures=False)
        assert (found.crack_edges, found.hole_samples, found.inverted_triangles) == (0, 0, 0)
        nodes, errors = found.node_errors()
        bounds = cut.nodes["error"][np.searchsorted(cut.nodes["node"], nodes)]
        assert (errors <= bounds + lab.instrument.slack(view)).all()


def test_no_triangle_is_degenerate(lab: Lab) -> None:
    session = lab.store.core.session({"stream": False})
    for view in lab.views(3):
        cut = session.select(view, _core.Budget(pixel_error=1.0))
        triangles = session.capture(cut, view, everything=False).triangles[..., :2]
        a, b = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
        assert (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0] > 0.0).all()
        assert len(triangles) == cut.triangles


def test_what_is_selected_is_a_cut_by_hand(lab: Lab) -> None:
    session = lab.store.core.session({"stream": False})
    for view in lab.views(5):
        cut = session.select(view, _core.Budget(pixel_error=1.0))
        again = session.cut(cut.nodes["node"].astype(np.int64), cut.nodes["resolution"].astype(np.int32))
        seen = cut.nodes["visible"]
        assert np.array_equal(again.nodes["error"][seen], cut.nodes["error"][seen])
        assert (again.nodes["error"] <= cut.nodes["error"]).all()


def test_patches_by_hand_must_agree_on_their_edges(lab: Lab) -> None:
    session, nodes = lab.store.core.session({}), lab.store.nodes
    ids = np.unique(nodes["id"][nodes["level"] == 1])
    assert len(session.cut(ids, None).nodes) == len(ids)
    unlike = np.zeros(len(ids), np.int32)
    unlike[0] = nodes["resolution"].max()
    with pytest.raises(lod.errors.InvalidInput, match="edge of node .* must agree"):
        session.cut(ids, unlike)


def test_culling_saves_half_of_the_triangles_in_the_middle(lab: Lab) -> None:
    height, width = lab.field.shape
    dx, dy = lab.field.spacing
    x0, y0 = lab.field.origin
    middle = (x0 + width * dx / 2, y0 - height * dy / 2, float(np.nanmax(lab.field.heights)) + 100.0)
    view = _core.View(middle, (middle[0], middle[1] + 1000.0, middle[2] - 200.0), size=(640, 360))
    session = lab.store.core.session({"stream": False})
    cut = session.select(view, _core.Budget(pixel_error=1.0))
    everything = session.cut(cut.nodes["node"].astype(np.int64), cut.nodes["resolution"].astype(np.int32)).triangles
    assert cut.triangles <= everything / 2


def cracks(lab: Lab, budget: dict[str, float], **options: object) -> int:
    session = lab.store.core.session({"stream": False, **options})
    found = 0
    for view in lab.views(8, size=(160, 90)):
        cut = session.select(view, _core.Budget(**budget))
        assert not cut.promises_bound
        found += lab.instrument.examine(session, cut, view, pictures=False).crack_edges
    return found


@pytest.mark.filterwarnings("ignore:seamless")
def test_the_papers_settings_crack_where_the_premise_fails(lab: Lab, averaged: Lab) -> None:
    budget = {"pixel_error": 1.0}
    assert cracks(lab, budget, metric="distance", rho="2") == 0
    assert cracks(lab, budget, metric="distance", rho="0.7") > 0
    assert cracks(lab, budget, metric="distance", distance="midpoint", rho="2") > 0
    assert cracks(averaged, budget) > 0


def test_a_premise_that_fails_is_named(lab: Lab) -> None:
    with pytest.warns(UserWarning, match="needs rho >= 1"):
        lab.store.core.session({"metric": "distance", "rho": "0.9"})
    with pytest.warns(UserWarning, match="nearest point"):
        lab.store.core.session({"distance": "midpoint"})


@pytest.mark.parametrize("rho", ["0", "-1", "inf", "nan", "much", ""])
def test_rho_is_a_number_above_zero(lab: Lab, rho: str) -> None:
    with pytest.raises(lod.errors.InvalidInput, match="rho="):
        lab.store.core.session({"rho": rho})


def test_precision_changes_the_number_of_triangles(lab: Lab) -> None:
    session, view = lab.store.core.session({"stream": False}), lab.views(3)[1]
    counts = [session.select(view, _core.Budget(pixel_error=p)).triangles for p in (0.01, 0.5, 2.0, 10.0, 200.0)]
    assert counts == sorted(counts, reverse=True)
    assert counts[0] > 25 * counts[-1]


@pytest.mark.parametrize(
    ("rows", "cols"), [(2, 2), (2, 100), (100, 2), (3, 5), (17, 17), (18, 17), (65, 130), (90, 33)]
)
@pytest.mark.parametrize("resolutions", [2, 3])
def test_fields_of_any_size(tmp_path, rows: int, cols: int, resolutions: int) -> None:
    heights = _core.fractal(rows, cols, 0, 0, seed=4, roughness=0.5)
    lab = Lab(lod.HeightField(heights, spacing=(30.0, 40.0)), tmp_path, patch=16, resolutions=resolutions)
    session, view = lab.store.core.session({"stream": False}), lab.views(3, (64, 40))[1]
    for budget in ({"pixel_error": 0.001}, {"pixel_error": 5.0}, {"triangles": 300}):
        cut = session.select(view, _core.Budget(**budget))
        found = lab.examine(session, cut, view)
        assert (found.crack_edges, found.hole_samples, found.inverted_triangles) == (0, 0, 0)


def test_an_eye_on_a_vertex_or_an_edge(lab: Lab) -> None:
    session = lab.store.core.session({"stream": False})
    dx, dy = lab.field.spacing
    x0, y0 = lab.field.origin
    heights = np.asarray(lab.field.heights)
    for row, col in ((32, 32), (32, 40), (16, 48)):
        eye = (x0 + col * dx, y0 - row * dy, float(heights[row, col]))
        view = _core.View(eye, (eye[0] + 100.0, eye[1] + 50.0, eye[2]), size=(64, 40))
        cut = session.select(view, _core.Budget(pixel_error=1.0))
        assert np.isfinite(cut.predicted_px)
        assert lab.instrument.examine(session, cut, view, pictures=False).crack_edges == 0


def test_selection_keeps_two_bytes_an_edge(lab: Lab) -> None:
    """All the memory that a patch takes: the hierarchy itself is arithmetic."""
    nodes = lab.store.nodes
    _, first = np.unique(nodes["id"], return_index=True)
    patches = np.bincount(nodes["level"][first])
    with sqlite3.connect(lab.store.path) as database:
        (stored,) = database.execute("SELECT length(bytes) FROM array WHERE name = 'codes'").fetchone()
    assert 0 < stored <= 2 * sum(2 * n + 3 * np.sqrt(n) for n in patches)


def test_parents_stand_in_for_what_is_missing_without_cracks(lab: Lab) -> None:
    loaded = lab.store.core.session({"stream": False})
    session = lab.store.core.session({"stream": True, "fetch_delay_ms": 20})
    misses = 0
    for view in lab.views(10, size=(160, 90)):
        cut, row = session.time_frame(view, _core.Budget(pixel_error=1.0))
        found = lab.examine(session, cut, view)
        assert (found.crack_edges, found.hole_samples, found.capture_mismatch_pixels) == (0, 0, 0)
        assert found.measured_px_max <= cut.predicted_px + _core.SLACK_PIXELS + _core.world_slack(1.0) * 640
        misses += row["page_misses"]
    assert misses > 0
    budget = _core.Budget(pixel_error=1.0, triangles=20_000)
    for _ in range(30):
        session.settle()
        cut, row = session.time_frame(view, budget)
        assert row["triangles"] <= 20_000
    assert np.array_equal(cut.nodes, loaded.select(view, budget).nodes)


def random_view(field: lod.HeightField, random: np.random.Generator) -> _core.View:
    """Anywhere about the field: over it, beside it, on its ground, on a vertex, looking anywhere."""
    rows, cols = field.shape
    dx, dy = field.spacing
    x0, y0 = field.origin
    row, col = random.uniform(-0.3, 1.3) * rows, random.uniform(-0.3, 1.3) * cols
    if random.random() < 0.3:
        row, col = round(row), round(col)
    top = float(np.nanmax(field.heights))
    height = top + random.choice([0.0, -0.5 * top, random.random() ** 3 * cols * dx])
    eye = np.array([x0 + col * dx, y0 - row * dy, height])
    return _core.View(tuple(eye), tuple(eye + random.normal(size=3)), fov=random.uniform(20, 120), size=(64, 40))


@pytest.mark.parametrize("options", [{}, {"metric": "distance", "rho": "1"}, {"metric": "distance", "rho": "3"}])
def test_neighbours_agree_whatever_the_view(lab: Lab, options: dict[str, object]) -> None:
    """`cut` compares the strides of every shared edge, of patches of any levels, in whole numbers."""
    session, random = lab.store.core.session({"stream": False, **options}), np.random.default_rng(11)
    for _ in range(200):
        pixels = 10.0 ** random.uniform(-2, 2)
        budget = {"pixel_error": pixels}
        if not options and random.random() < 0.5:  # hard budgets lower a given rho, below 1 too
            budget = {"triangles": int(10 ** random.uniform(2, 5))}
        cut = session.select(random_view(lab.field, random), _core.Budget(**budget))
        session.cut(cut.nodes["node"].astype(np.int64), cut.nodes["resolution"].astype(np.int32))


def test_the_papers_metric_agrees_at_rho_1_on_a_vertex(tmp_path) -> None:
    """Eyes on lattice points, where distances tie: one in 200 disagreed."""
    field = lod.HeightField(_core.fractal(129, 129, 0, 0, seed=4, roughness=0.5), spacing=0.1)
    session = lod.build(field, "seamless", tmp_path / "s.lod", patch=8, progress=False).core.session(
        {"stream": False, "metric": "distance", "rho": "1"}
    )
    view = _core.View((2.9000000000000004, -11.2, -1e6), (2.9, -10.2, -1e6), size=(64, 40))
    cut = session.select(view, _core.Budget(pixel_error=1.0))
    session.cut(cut.nodes["node"].astype(np.int64), cut.nodes["resolution"].astype(np.int32))


@pytest.mark.parametrize("budget", [{"triangles": 60_000}, {"nodes": 300}, {"pixel_error": 0.3, "triangles": 60_000}])
def test_a_cold_session_keeps_hard_budgets_while_much_is_missing(tmp_path, budget: dict[str, float]) -> None:
    """Where more patches are missing than are blocked one by one, everything becomes coarser, and stays so."""
    field = lod.HeightField(_core.fractal(513, 513, 0, 0, seed=4, roughness=0.5), spacing=30.0)
    store = lod.build(field, "seamless", tmp_path / "s.lod", patch=8, progress=False)
    session = store.core.session({"stream": True, "fetch_delay_ms": 20})
    for view in lod.CameraPath.flyover(field, frames=8).views((64, 40)):
        cut, row = session.time_frame(view, _core.Budget(**budget))
        assert row["triangles"] <= budget.get("triangles", np.inf) and row["nodes"] <= budget.get("nodes", np.inf)
        session.cut(cut.nodes["node"].astype(np.int64), cut.nodes["resolution"].astype(np.int32))


def test_the_papers_metric_right_above_an_edge_refines_and_knows_its_coarsest_cut(tmp_path) -> None:
    """At no distance every fineness above 0 splits what can be split, 0 itself nothing."""
    heights = (np.add.outer(np.arange(58), np.arange(2)) % 2).astype(np.float32)
    store = lod.build(lod.HeightField(heights), "seamless", tmp_path / "edge.lod", progress=False)
    view = _core.View((0.0, -28.0, -13.0), (0.0, -57.0, 1.0), size=(96, 64))
    session = store.core.session({"metric": "distance"})
    coarsest = session.select(view, _core.Budget(triangles=1))
    assert (coarsest.least_triangles, coarsest.least_nodes) == (coarsest.triangles, coarsest.visible_nodes)
    assert session.select(view, _core.Budget(pixel_error=1e-9)).triangles > coarsest.triangles
