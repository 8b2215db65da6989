# SPDX-License-Identifier: MIT
"""subdivision with its displacement paged: what is not there yet is drawn flat, said, and cracks nowhere."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import lodlab as lod
from lodlab import _core

MIB = 1 << 20
BUDGET = _core.Budget(pixel_error=0.5)


@pytest.fixture(scope="module")
def mesh() -> lod.Mesh:
    return lod.datasets.load("blob:size=60")


@pytest.fixture(scope="module")
def store(mesh: lod.Mesh, tmp_path_factory: pytest.TempPathFactory) -> lod.Store:
    """Of ten pages, three of which go into 2 MiB beside the rest."""
    folder = tmp_path_factory.mktemp("paging")
    return lod.build(mesh, "subdivision", folder / "a.lod", degree=17, target=640, progress=False)


def _view(mesh: lod.Mesh, way: tuple[float, float, float], far: float = 0.8) -> _core.View:
    middle, direction = mesh.bounds.mean(axis=0), np.array(way) / np.linalg.norm(way)
    return _core.View(tuple(middle + far * mesh.extent * direction), tuple(middle), size=(320, 240))


def _fly(session: _core.Session, view: _core.View, frames: int = 4) -> list[tuple[_core.Cut, dict]]:
    out = []
    for _ in range(frames):
        out.append(session.time_frame(view, BUDGET))
        session.settle()
    return out


@pytest.mark.parametrize(("options", "why"), [
    ({"stream": True}, "the control mesh and one page of displacement need"),
    ({"stream": False}, "stream=false needs"),
])  # fmt: skip
def test_a_budget_below_one_page_or_below_all_is_refused(
    mesh: lod.Mesh, tmp_path: Path, options: dict[str, bool], why: str
) -> None:
    fine = lod.build(mesh, "subdivision", tmp_path / "a.lod", degree=33, target=200, progress=False)
    with pytest.raises(_core.InvalidInput, match=rf"subdivision: {why} gpu_cache_mb of at least \d+, not 1"):
        fine.session(gpu_cache_mb=1, **options)


@pytest.mark.parametrize("pipeline", ["compute", "geometry"])
def test_memory_is_kept_and_nothing_comes_twice_while_still(mesh: lod.Mesh, store: lod.Store, pipeline: str) -> None:
    session = store.session(stream=True, gpu_cache_mb=2, pipeline=pipeline).core
    for way in ((0.4, -0.8, 0.3), (-1.0, 0.2, 0.1), (0.4, -0.8, 0.3)):
        drawn = _fly(session, _view(mesh, way), 8)
        assert all(cost["resident_bytes"] <= 2 * MIB for _, cost in drawn)
        assert all(cost["triangles"] == cut.triangles for cut, cost in drawn)
        assert all(cut.missing_nodes > 0 and not cut.budget_met for cut, _ in drawn)
        assert drawn[-1][0].triangles > len(drawn[-1][0].nodes)
        assert len({session.digest(cut) for cut, _ in drawn[3:]}) == 1
        assert max(cost["upload_bytes"] for _, cost in drawn[4:]) < 1000, "the frame's state alone"


@pytest.mark.parametrize("metric", ["bound", "length", "curvature"])
def test_what_has_all_come_is_what_is_drawn_without_streaming(mesh: lod.Mesh, store: lod.Store, metric: str) -> None:
    session, whole = (store.session(stream=stream, metric=metric).core for stream in (True, False))
    for way in ((0.4, -0.8, 0.3), (-1.0, 0.2, 0.1)):
        view = _view(mesh, way)
        cut = _fly(session, view)[-1][0]
        wanted = whole.select(view, BUDGET)
        assert (cut.missing_nodes, cut.triangles) == (0, wanted.triangles)
        assert session.digest(cut) == whole.digest(wanted)
        seen = session.capture(cut, view, everything=False)
        np.testing.assert_array_equal(seen.triangles, whole.capture(wanted, view, everything=False).triangles)


def test_a_cut_is_drawn_again_after_its_pages_went(mesh: lod.Mesh, store: lod.Store) -> None:
    session, whole = store.session(stream=True, gpu_cache_mb=2).core, store.session().core
    here, there = _view(mesh, (0.4, -0.8, 0.3)), _view(mesh, (-0.4, 0.8, -0.3))
    cut = _fly(session, here)[-1][0]
    first = session.capture(cut, here).triangles
    _fly(session, there)
    np.testing.assert_array_equal(session.capture(cut, here).triangles, first)
    np.testing.assert_array_equal(whole.capture(cut, here).triangles, first)


def test_stand_ins_keep_their_claims_and_crack_nowhere(mesh: lod.Mesh, store: lod.Store) -> None:
    session = store.session(stream=True, gpu_cache_mb=2).core
    instrument = _core.Instrument(mesh.core, None)
    for way in ((0.4, -0.8, 0.3), (-1.0, 0.2, 0.1)):
        view = _view(mesh, way)
        for cut, _ in _fly(session, view, 3):
            found = instrument.examine(session, cut, view, pictures=False)
            assert found.crack_edges == 0
            assert found.measured_max <= cut.nodes["error"].max() + instrument.slack(view)
            assert cut.predicted_px > BUDGET.pixel_error


def test_pages_that_come_while_the_mesh_moves_lie_where_it_is(mesh: lod.Mesh, store: lod.Store) -> None:
    session, whole = store.session(stream=True).core, store.session().core
    view, rest = _view(mesh, (0.4, -0.8, 0.3)), store.control_positions
    for frame in range(5):
        moved = rest * (1.0 + 0.02 * frame, 1.0, 1.0)
        cut, _ = session.time_frame(view, BUDGET, control_positions=moved)
        session.settle()
    assert cut.missing_nodes == 0
    wanted = whole.select(view, BUDGET, control_positions=moved)
    seen = session.capture(cut, view, everything=False)
    np.testing.assert_array_equal(seen.triangles, whole.capture(wanted, view, everything=False).triangles)
