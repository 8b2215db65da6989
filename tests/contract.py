# SPDX-License-Identifier: MIT
"""What every method must satisfy. A method's test inherits `MethodContract` and names itself; `MeshContract`
(mesh_contract.py) is the same over meshes.

Laws are those of the instrument: bounds are upper bounds, hard budgets are hard, `pixel_error` is
reached or missed openly, a still camera's cut is fixed, the finest cut is the source where the method
says so. The slack is the instrument's.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
from hypothesis import HealthCheck, given, reject, settings
from hypothesis import strategies as st

import lodlab as lod
from lodlab import _core
from lodlab.instrument import measure
from lodlab.instrument.audit import any_cut
from lodlab.instrument.metrics import pixel_slack
from lodlab.stability import fields, trials
from tests.pictures import assert_same_picture

FIELDS = {
    "smallest": lambda: np.array([[0.0, 3.0], [1.0, 7.0]]),
    "strip": lambda: fields.hills(2, 150),
    "odd": lambda: fields.hills(131, 90),
    "flat": lambda: fields.flat(67, 70),
    "spike": lambda: fields.spike(90, 140),
    "cliff": lambda: fields.cliff(80, 121),
    "voids": lambda: fields.holed(fields.hills(130, 150)),
}

#: (lon0, lat0, dlon, dlat) of patches of 41 x 61 samples: a border row is a parallel, no great circle.
PATCHES = {
    "north": (170.0, 70.0, 0.5, 0.5),
    "south": (-20.0, -10.0, 0.5, 0.5),
    "equator": (0.0, 12.0, 1.0, 0.5),
    "at the pole": (0.0, 90.0, 3.0, 1.0),
    "coarse": (-90.0, 80.0, 4.0, 1.5),
}


def over(field: lod.HeightField | lod.Mesh, height: float = 0.4, fov: float = 60.0, size=(200, 120)) -> _core.View:
    """An oblique view from the south-west corner towards the middle; of a mesh from beside it."""
    if field.kind == "mesh":
        middle = field.bounds.mean(axis=0)
        eye = middle + (0.5 + height) * field.extent * np.array([-0.7, -0.8, 0.6])
        return _core.View(tuple(eye), tuple(middle), fov=fov, size=size)
    rows, cols = field.shape
    dx, dy = field.spacing
    x0, y0 = field.origin
    span = max(cols * dx, rows * dy)
    middle = np.array([x0 + 0.5 * cols * dx, y0 - 0.5 * rows * dy, float(np.nanmean(field.heights))])
    eye = middle + np.array([-0.7 * span, -0.7 * span, height * span + float(np.nanmax(field.heights))])
    return _core.View(tuple(eye), tuple(middle), fov=fov, size=size)


def near_views(field: lod.HeightField | lod.Mesh, count: int) -> list[_core.View]:
    """From beside, on and under the ground, with most of it out of sight."""
    rng = np.random.default_rng(11)
    if field.kind == "mesh":
        eyes = field.bounds.mean(axis=0) + 0.5 * field.extent * rng.uniform(-1.0, 1.0, (count, 3))
        return [
            _core.View(tuple(eye), tuple(eye + field.extent * rng.normal(size=3)), fov=50.0, size=(96, 64))
            for eye in eyes
        ]
    rows, cols = field.shape
    (dx, dy), (x0, y0) = field.spacing, field.origin
    low, high = float(np.nanmin(field.heights)), float(np.nanmax(field.heights))
    views = []
    for _ in range(count):
        x, y = rng.uniform(-0.1, 1.1, 2)
        eye = np.array([x0 + x * cols * dx, y0 - y * rows * dy, rng.uniform(low, high + 4.0 * dx)])
        views.append(_core.View(tuple(eye), tuple(eye + rng.normal(size=3) * (9.0, 9.0, 3.0)), fov=50.0, size=(96, 64)))
    return views


def stored(nodes: np.ndarray, cut: _core.Cut) -> np.ndarray:
    """The rows of `store.nodes` that a cut's nodes have, each at the resolution that it is drawn with."""
    rows = {(node, k): i for i, (node, k) in enumerate(zip(nodes["id"], nodes["resolution"], strict=True))}
    return nodes[[rows[pair] for pair in zip(cut.nodes["node"], cut.nodes["resolution"], strict=True)]]


def float_slack(capture: _core.Capture, view: _core.View) -> float:
    """The slack of the laws at the largest distance to the eye, source units."""
    if len(capture.triangles) == 0:
        return 0.0
    far = np.linalg.norm(capture.triangles.reshape(-1, 3) - np.asarray(view.eye), axis=1).max()
    return _core.world_slack(far)


def scratch() -> Path:
    """A folder for stores that tests without a `tmp_path` of their own (hypothesis) build again and again."""
    folder = Path(tempfile.gettempdir()) / f"lodlab-contract-{os.getpid()}"
    folder.mkdir(exist_ok=True)
    return folder


def drawn(make: Callable[..., object], *recipe: object, **values: object) -> object:
    """What the random search draws, where it is not refused: that is another example."""
    try:
        return make(*recipe, **values)
    except lod.errors.InvalidInput:
        reject()


class Measured:
    """A store with what measures it."""

    def __init__(self, method: str, source: lod.HeightField | lod.Mesh, folder: Path, **options: object) -> None:
        self.source = source
        self.store = lod.build(source, method, folder / "store.lod", progress=False, **options)
        full = lod.build(source, "full", folder / "reference.lod", progress=False, mode="force")
        self.full = full.core.session({})
        self.instrument = _core.Instrument(source.core, self.full)

    def session(self, **options: object) -> _core.Session:
        known = {o["name"] for m in _core.methods() if m["name"] == self.store.method for o in m["options"]}
        if "stream" in known:
            options.setdefault("stream", False)
        return self.store.core.session(options)

    def measure(self, session: _core.Session, cut: _core.Cut, view: _core.View) -> dict[str, float]:
        return measure(self.instrument, session, cut, view, self.instrument.reference(view))


class MethodContract:
    """Inherit, set `method`, and, where small fields need it, `build_options`."""

    method: ClassVar[str]
    build_options: ClassVar[dict[str, object]] = {}
    #: A pixel error that the cut by itself reaches anywhere.
    loose: ClassVar[float] = 4.0
    #: What runs in a child that is killed: `build_for_ever`, or another where the child needs another core.
    forever: ClassVar = None
    #: Columns that are 0 of every drawn cut.
    whole: ClassVar[tuple[str, ...]] = ("hole_samples",)
    #: Pixel error above which it may not be decided whether a picture shows cracks.
    decided: ClassVar[float] = 1.0

    # What it is tried on

    @staticmethod
    def smallest_source() -> lod.HeightField | lod.Mesh:
        return lod.HeightField(FIELDS["smallest"]())

    @staticmethod
    def any_source() -> lod.HeightField | lod.Mesh:
        return lod.HeightField(FIELDS["odd"]())

    @staticmethod
    def killed_source() -> lod.HeightField | lod.Mesh:
        return lod.HeightField(killed_field())

    def random_source(self, random: np.random.Generator) -> dict[str, object]:
        return trials.random_source(random, "planet" in self.info["accepts"] and random.random() < 0.5, most=90)

    def check_whole(self, found: _core.Measurement | dict[str, float]) -> None:
        for column in self.whole:
            assert (found[column] if isinstance(found, dict) else getattr(found, column)) == 0, column

    @pytest.fixture(scope="class", params=sorted(FIELDS))
    @classmethod
    def made(cls, request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Measured:
        field = lod.HeightField(FIELDS[request.param](), spacing=(30.0, 40.0))
        return Measured(cls.method, field, tmp_path_factory.mktemp(request.param), **cls.build_options)

    @property
    def info(self) -> dict:
        return next(m for m in _core.methods() if m["name"] == self.method)

    # Law 1

    @pytest.mark.parametrize("pixel_error", [0.25, 1.0, 6.0])
    def test_measured_never_exceeds_predicted(self, made: Measured, pixel_error: float) -> None:
        session = made.session()
        for view in (over(made.source), over(made.source, height=0.02, fov=100.0)):
            cut = session.select(view, _core.Budget(pixel_error=pixel_error))
            row = made.measure(session, cut, view)
            assert cut.promises_bound
            assert row["measured_px_max"] <= row["predicted_px"] + pixel_slack(view)
            self.check_whole(row)
            assert row["capture_mismatch_pixels"] == 0

    def test_stored_bounds_hold_node_by_node(self, made: Measured) -> None:
        session, view = made.session(), over(made.source)
        nodes, slack = made.store.nodes, made.instrument.slack(view)
        seen: set[int] = set()
        for level in np.unique(nodes["level"]):
            cut = session.cut(self.level_cut(nodes, level), None)
            bounds = dict(zip(cut.nodes["node"], stored(nodes, cut)["error"], strict=True))
            found = made.instrument.examine(session, cut, view, pictures=False)
            self.check_whole(found)
            drawn, errors = found.node_errors()
            beyond = {n: (e, bounds[n]) for n, e in zip(drawn, errors, strict=True) if not e <= bounds[n] + slack}
            assert not beyond, f"level {level}: node: (measured, bound) {beyond}"
            seen |= set(drawn.tolist())
        assert len(seen) >= len(np.unique(nodes["level"]))

    @staticmethod
    def level_cut(nodes: np.ndarray, level: int) -> np.ndarray:
        """All nodes of one level, and the leaves above it."""
        parents = set(nodes["parent"].tolist())
        leaf = np.array([i not in parents for i in nodes["id"]])
        return np.unique(nodes["id"][(nodes["level"] == level) | (leaf & (nodes["level"] < level))])

    # Law 2

    @pytest.mark.parametrize("triangles", [1, 50, 700, 5000, 10**9])
    def test_triangle_budget_is_hard(self, made: Measured, triangles: int) -> None:
        self.check_hard(made, "triangles", triangles)

    @pytest.mark.parametrize("nodes", [1, 3, 10, 10**9])
    def test_node_budget_is_hard(self, made: Measured, nodes: int) -> None:
        self.check_hard(made, "nodes", nodes)

    def check_hard(self, made: Measured, name: str, limit: int) -> None:
        budgets = self.info["budgets"]
        if budgets and name not in budgets:
            pytest.skip(f"{self.method} has no {name} budget")
        session, view = made.session(), over(made.source)
        cut, row = session.time_frame(view, _core.Budget(**{name: limit}))
        assert row["triangles"] == cut.triangles == self.submitted(session, cut, view)
        if not budgets:  # they are ignored: the one cut is drawn and counts as met
            assert cut.budget_met
            return
        coarsest = session.select(view, _core.Budget(**{name: 1}))
        spent = row[name]
        assert cut.budget_met == (spent <= limit)
        if not cut.budget_met:
            assert spent == {"triangles": coarsest.triangles, "nodes": coarsest.visible_nodes}[name]

    def test_hard_budgets_hold_wherever_the_cheapest_cut_fits(self, made: Measured) -> None:
        """Beside and inside the ground children are culled whose parents are not: a split may cost less than none."""
        kinds = {"triangles", "nodes"} & set(self.info["budgets"])
        if not kinds:
            pytest.skip(f"{self.method} has no hard budget")
        for view in near_views(made.source, 6):
            session, drawn = made.session(), []

            def select(session=session, view=view, drawn=drawn, **budget: float) -> _core.Cut:
                cut = session.select(view, _core.Budget(**budget))
                drawn.append((budget, cut.triangles, cut.visible_nodes, cut.least_triangles))
                spent = {"triangles": cut.triangles, "nodes": cut.visible_nodes}
                over = any(spent[k] > budget.get(k, np.inf) for k in kinds)
                assert over == (cut.least_triangles is not None)
                if over:
                    assert not cut.budget_met
                    assert spent == {"triangles": cut.least_triangles, "nodes": cut.least_nodes}
                return cut

            for k in sorted(kinds):
                least = max({"triangles": (c := select(**{k: 1})).triangles, "nodes": c.visible_nodes}[k], 1)
                for limit in {max(least - 1, 1), least, least + 1, 3 * least}:
                    select(**{k: limit})
                    select(**{k: limit, "pixel_error": 1e6})
            if len(kinds) == 2:
                for triangles, nodes in [(t, n) for _, t, n, _ in drawn] + [(1, 1), (1, 4)]:
                    select(triangles=max(triangles, 1), nodes=max(nodes, 1))
            for budget, _, _, least_triangles in drawn:
                if least_triangles is None:
                    continue
                for _, triangles, nodes, _ in drawn:
                    fits = triangles <= budget.get("triangles", np.inf) and nodes <= budget.get("nodes", np.inf)
                    assert not fits, f"over {budget}, although {triangles} triangles in {nodes} nodes can be drawn"

    def test_hard_budgets_hold_while_flying_once_what_they_need_is_there(self, made: Measured) -> None:
        """Nothing is missing from a method that does not stream: its first frame holds them."""
        if "triangles" not in self.info["budgets"]:
            pytest.skip(f"{self.method} has no budget of triangles")
        stream = {"stream": True} if "stream" in {o["name"] for o in self.info["options"]} else {}
        for view in near_views(made.source, 3):
            least = max(made.session().select(view, _core.Budget(triangles=1)).triangles, 1)
            session, budget = made.session(**stream), _core.Budget(triangles=least)
            for _ in range(40):
                cut, row = session.time_frame(view, budget)
                if row["triangles"] <= least:
                    break
                assert cut.missing_nodes > 0 and not cut.budget_met
                session.settle()
            assert row["triangles"] <= least

    @staticmethod
    def submitted(session: _core.Session, cut: _core.Cut, view: _core.View) -> int:
        return len(session.capture(cut, view, everything=False).triangles)

    def test_pixel_error_is_reached_or_missed_openly(self, made: Measured) -> None:
        """Missed: no cut claims less. The finest cut: every visible node is a finest one, or exact as drawn."""
        session, view, nodes = made.session(), over(made.source, height=0.1), made.store.nodes
        if not self.info["budgets"]:
            assert session.select(view, _core.Budget(pixel_error=0.01)).budget_met
            return
        finest = session.select(view, _core.Budget(pixel_error=1e-300))
        for pixel_error in (0.01, 0.5, self.loose, 1000.0):
            cut = session.select(view, _core.Budget(pixel_error=pixel_error))
            assert cut.budget_met == (cut.predicted_px <= pixel_error)
            assert cut.budget_met or cut.predicted_px <= finest.predicted_px
        assert finest.budget_met == (finest.predicted_px <= 1e-300)
        inner = np.isin(nodes["id"], nodes["parent"])
        sharpest = {n: nodes["error"][nodes["id"] == n].min() for n in np.unique(nodes["id"][~inner])}
        drawn = finest.nodes[finest.nodes["visible"]]
        for node, error, own in zip(
            drawn["node"], drawn["error"], stored(nodes, finest)["error"][finest.nodes["visible"]], strict=True
        ):
            assert error == 0.0 or own == sharpest.get(node), f"node {node} could be finer, and is off by {error}"

    @pytest.mark.parametrize("bad", [0, -1, float("nan")])
    def test_budgets_that_are_no_budgets(self, bad: float) -> None:
        for name in ("pixel_error", "triangles", "nodes"):
            with pytest.raises((lod.errors.InvalidInput, TypeError, ValueError)):
                self.smallest().select(_core.View((0, 0, 50), (1, 1, 0)), _core.Budget(**{name: bad}))

    def smallest(self) -> _core.Session:
        file = scratch() / f"{self.method}.lod"
        return lod.build(self.smallest_source(), self.method, file, progress=False, mode="force").core.session({})

    # Law 3

    def test_finest_cut_is_the_source(self, made: Measured) -> None:
        if not self.info["reproduces_source"]:
            pytest.skip(f"{self.method} resamples")
        session, view = made.session(), over(made.source)
        nodes = made.store.nodes
        cut = session.cut(self.level_cut(nodes, nodes["level"].max()), None)
        row = made.measure(session, cut, view)
        capture = session.capture(cut, view)
        assert row["measured_max"] <= made.store.info()["quantum"] + float_slack(capture, view)

    def test_finest_cut_looks_like_the_source(self, made: Measured) -> None:
        if not self.info["reproduces_source"]:
            pytest.skip(f"{self.method} resamples")
        session, view = made.session(), over(made.source, size=(320, 200))
        nodes = made.store.nodes
        cut = session.cut(self.level_cut(nodes, nodes["level"].max()), None)
        reference = made.full.draw(made.full.select(view, _core.Budget(pixel_error=1.0)), view)
        assert_same_picture(
            session.draw(cut, view).image,
            reference.image,
            f"{self.method}-finest",
            level=6,
            share=0.004,
            why="heights are rounded to the quantum, which tilts normals; edges may fall on other pixels",
        )

    # Law 4

    def test_still_camera_has_a_fixed_cut(self, made: Measured) -> None:
        session, view = made.session(), over(made.source, height=0.1)
        budget = _core.Budget(pixel_error=2.0)
        first = session.digest(session.select(view, budget))
        for _ in range(20):
            assert session.digest(session.select(view, budget)) == first

    def test_history_does_not_matter(self, made: Measured) -> None:
        session, here = made.session(), over(made.source, height=0.1)
        budget = _core.Budget(pixel_error=1.0)
        wanted = session.digest(made.session().select(here, budget))
        for height in (3.0, 0.01, 0.5):
            session.select(over(made.source, height=height), budget)
            assert session.digest(session.select(here, budget)) == wanted

    def test_equal_digests_draw_the_same(self, made: Measured) -> None:
        """Cuts of equal digests emit the same triangles."""
        session, view = made.session(), over(made.source)
        drawn: dict[str, bytes] = {}
        for height, pixel_error in ((0.4, 0.25), (0.4, 0.25), (0.4, self.loose), (0.4, 50.0), (0.02, self.loose)):
            cut = session.select(over(made.source, height=height), _core.Budget(pixel_error=pixel_error))
            triangles = session.capture(cut, view).triangles.tobytes()
            assert drawn.setdefault(session.digest(cut), triangles) == triangles

    # Coverage, cuts by hand

    def test_no_clear_colour_shows_through(self, made: Measured) -> None:
        """Where everything lies within the error of a border, as of a strip at several pixels, nothing is decided."""
        session = made.session()
        for pixel_error in (0.5, 8.0):
            view = over(made.source, height=0.15, size=(400, 240))
            cut = session.select(view, _core.Budget(pixel_error=pixel_error))
            crack_pixels = made.measure(session, cut, view)["crack_pixels"]
            assert crack_pixels == 0 or (pixel_error > self.decided and np.isnan(crack_pixels))

    def test_a_cut_covers_the_source_once(self, made: Measured) -> None:
        session, nodes = made.session(), made.store.nodes
        roots = np.unique(nodes["id"][nodes["parent"] < 0])
        assert list(session.cut(roots, None).nodes["node"]) == sorted(roots)
        with pytest.raises(lod.errors.InvalidInput, match="gap|missing"):
            session.cut(roots[1:], None)
        with pytest.raises(lod.errors.InvalidInput, match="twice|overlap"):
            session.cut(np.concatenate([roots, roots[:1]]), None)
        with pytest.raises(lod.errors.InvalidInput, match="not within|no node"):
            session.cut(np.array([10**9]), None)

    def test_a_cut_by_hand_claims_nothing(self, made: Measured) -> None:
        """It has no view; what is always exact may say so."""
        session, nodes = made.session(), made.store.nodes
        for cut in (session.cut(np.unique(nodes["id"][nodes["parent"] < 0]), None), *session.audit_cuts()):
            exact = self.method == "full" and not cut.nodes["error"].any()
            assert np.isnan(cut.predicted_px) or (exact and cut.predicted_px == 0.0)

    @settings(max_examples=25, deadline=None, suppress_health_check=list(HealthCheck))
    @given(seed=st.integers(0, 2**31))
    def test_random_valid_cuts_hold_their_bounds(self, seed: int) -> None:
        random, folder = np.random.default_rng(seed), scratch()
        source = drawn(trials.make_source, self.random_source(random))
        view = drawn(trials.make_view, trials.ground_of(source), trials.random_view(random))
        options = {} if source.kind == "planet" else self.build_options  # which a planet may refuse
        store = lod.build(source, self.method, folder / "random.lod", progress=False, mode="force", **options)
        instrument, session = _core.Instrument(source.core, None), store.core.session({})
        cut = any_cut(session, store.nodes, random)
        found = drawn(instrument.examine, session, cut, view, pictures=False)
        self.check_whole(found)
        assert found.measured_max <= stored(store.nodes, cut)["error"].max() + instrument.slack(view)

    @pytest.mark.parametrize("place", sorted(PATCHES))
    def test_no_cut_leaves_out_a_border_sample_of_a_patch_of_a_planet(self, place: str, tmp_path: Path) -> None:
        heights = 300.0 * fields.hills(41, 61)
        field = lod.HeightField(heights, planet=True, degrees=PATCHES[place])
        if "planet" not in self.info["accepts"]:
            with pytest.raises(lod.errors.Unsupported, match="planet"):
                lod.build(field, self.method, tmp_path / "p.lod", progress=False)
            return
        store = lod.build(field, self.method, tmp_path / "p.lod", progress=False, **self.build_options)
        instrument, session = _core.Instrument(field.core, None), store.core.session({})
        up = field.core.position(np.array([20]), np.array([30]))[0]
        view, random = _core.View(tuple(1.5 * up), tuple(up), size=(160, 100)), np.random.default_rng(7)
        for _ in range(6):
            cut = any_cut(session, store.nodes, random)
            found = instrument.examine(session, cut, view, pictures=False)
            assert (found.hole_samples, found.crack_edges, found.inverted_triangles) == (0, 0, 0)
            bound = stored(store.nodes, cut)["error"].max()
            assert found.measured_max <= bound + instrument.slack(view)
        if place == "north":
            assert len(lod.instrument.audit(store, cuts=2, progress=False).broken) == 0

    @settings(max_examples=40, deadline=None, suppress_health_check=list(HealthCheck))
    @given(seed=st.integers(0, 2**31))
    def test_any_view_is_answered(self, seed: int) -> None:
        session, ground = self.any_session()
        view = drawn(trials.make_view, ground, trials.random_view(np.random.default_rng(seed)))
        cut = session.select(view, _core.Budget(pixel_error=1.0))
        assert np.isfinite(cut.predicted_px)
        frame = session.draw(cut, view)
        assert frame.image.shape == (view.size[1], view.size[0], 4)

    _any: ClassVar[dict[str, tuple[_core.Session, object]]] = {}

    def any_session(self) -> tuple[_core.Session, trials.Ground]:
        if self.method not in self._any:
            folder = scratch()
            source = self.any_source()
            store = lod.build(source, self.method, folder / f"{self.method}-any.lod", progress=False, mode="force")
            self._any[self.method] = store.core.session({}), trials.ground_of(source)
        return self._any[self.method]

    # Determinism, interruption

    def test_same_input_same_content(self, tmp_path: Path) -> None:
        source = self.any_source()
        hashes = set()
        for i, threads in enumerate((1, 2, 2)):
            _core.set_thread_count(threads)
            store = lod.build(source, self.method, tmp_path / f"{i}.lod", progress=False, **self.build_options)
            hashes.add(store.info()["content_hash"])
        _core.set_thread_count(0)
        assert len(hashes) == 1

    @pytest.mark.parametrize("delay", [0.0, 0.02, 0.05, 0.1, 0.2])
    def test_killed_build_resumes_or_says_incomplete(self, tmp_path: Path, delay: float) -> None:
        path = tmp_path / "killed.lod"
        context = multiprocessing.get_context("spawn")
        ready = context.Event()
        child = context.Process(target=self.forever or build_for_ever, args=(self.method, str(path), ready))
        child.start()
        assert ready.wait(60)
        time.sleep(delay)
        os.kill(child.pid, signal.SIGKILL)
        child.join()
        source = self.killed_source()
        if path.exists():
            lod.open(path).core.verify()
        else:
            with pytest.raises(lod.errors.StoreError):
                lod.open(path)
        store = lod.build(source, self.method, path, progress=False, mode="force" if path.exists() else "resume")
        clean = lod.build(source, self.method, tmp_path / "clean.lod", progress=False)
        assert store.info()["content_hash"] == clean.info()["content_hash"]
        store.core.verify()

    def test_unknown_and_bad_options(self, tmp_path: Path) -> None:
        source = self.smallest_source()
        with pytest.raises(lod.errors.InvalidInput, match="known"):
            lod.build(source, self.method, tmp_path / "a.lod", progress=False, no_such_option=1)
        with pytest.raises(lod.errors.InvalidInput, match="finest_error"):
            lod.build(source, self.method, tmp_path / "a.lod", progress=False, finest_error=-1.0)
        assert not list(tmp_path.iterdir())


def killed_field() -> np.ndarray:
    return _core.fractal(700, 900, 0, 0, seed=5, roughness=0.5)


def build_for_ever(method: str, path: str, ready) -> None:  # noqa: ANN001 - a multiprocessing event
    """Runs in a child that is killed: builds the same store again and again."""
    field = lod.HeightField(killed_field())
    ready.set()
    while True:
        lod.build(field, method, path, progress=False, mode="force")
