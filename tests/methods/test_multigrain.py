# SPDX-License-Identifier: MIT
"""multigrain against the contract of all methods, and what is its own: stitching across any level, planets."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
import pytest

import lodlab as lod
from lodlab import _core
from lodlab.instrument.audit import random_cut
from tests.contract import MethodContract


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
    session = store.core.session({})
    for view in flyover_views(field, 6):
        cut, row = session.time_frame(view, _core.Budget(**budget))
        found = instrument.examine(session, cut, view, instrument.reference(view))
        assert (found.crack_edges, found.crack_pixels, found.capture_mismatch_pixels) == (0, 0, 0)
        assert cut.promises_bound
        seen = found.measured_px_max
        assert np.isnan(seen) or seen <= cut.predicted_px + _core.SLACK_PIXELS + 4 * 2.0**-23 * 640
        if cut.budget_met:
            assert row["triangles"] <= budget.get("triangles", np.inf) and row["nodes"] <= budget.get("nodes", np.inf)
