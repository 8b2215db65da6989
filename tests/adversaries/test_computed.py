# SPDX-License-Identifier: MIT
"""An honest method that selects in a compute pass and draws indirectly: it passes the contract (here on three of its
fields), and its twin on the CPU claims what the GPU draws."""

from __future__ import annotations

import numpy as np
import pytest

import lodlab as lod
from lodlab import _core
from tests.contract import FIELDS, near_views, over

from .short_contract import ShortContract


class TestComputed(ShortContract):
    method = "computed"
    test_finest_cut_is_the_source = test_finest_cut_looks_like_the_source = None  # sides of nodes are resampled


@pytest.mark.parametrize("budget", [{"pixel_error": 3.0}, {"triangles": 9000}, {"nodes": 30}])
def test_the_twin_claims_what_the_gpu_draws(tmp_path, budget):
    field = lod.HeightField(FIELDS["odd"](), spacing=(30.0, 40.0))
    store = lod.build(field, "computed", tmp_path / "s.lod", progress=False)
    session, seen = store.core.session({}), set()
    for view in [over(field, height) for height in (0.05, 0.4, 1.5)] + near_views(field, 20):
        cut, row = session.time_frame(view, _core.Budget(**budget))
        nodes = cut.nodes[cut.nodes["visible"]]
        captured = session.capture(cut, view, everything=False)
        assert np.array_equal(np.unique(captured.node), nodes["node"])
        assert len(captured) == cut.triangles == row["triangles"] and row["nodes"] == len(nodes)
        assert len(session.capture(cut, view)) >= len(captured), "the whole cut, culled nodes too"
        seen |= set(nodes["resolution"].tolist())
    assert seen == {0, 1}, "both resolutions were put to the test"


def test_a_record_is_drawn_whatever_was_selected_since(tmp_path):
    """Recorded cuts are measured, drawn and looked at for pops after later ones."""
    field = lod.HeightField(FIELDS["odd"](), spacing=(30.0, 40.0))
    session = lod.build(field, "computed", tmp_path / "s.lod", progress=False).core.session({})
    views = [over(field), over(field, height=0.02, fov=100.0)]
    cuts = [session.select(view, _core.Budget(pixel_error=p)) for view in views for p in (0.25, 50.0)]
    first = [session.capture(cut, views[0]).triangles for cut in cuts]
    for cut, triangles in reversed(list(zip(cuts, first, strict=True))):
        assert np.array_equal(session.capture(cut, views[0]).triangles, triangles)
    assert len({session.digest(cut) for cut in cuts}) == len(cuts)
    by_hand = session.cut(np.unique(cuts[0].nodes["node"]), None)
    assert np.array_equal(session.capture(by_hand, views[0]).triangles, session.capture(cuts[1], views[0]).triangles)
