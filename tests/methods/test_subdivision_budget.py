# SPDX-License-Identifier: MIT
"""Budgets of subdivision, found on the GPU in the frame that is drawn."""

from __future__ import annotations

import numpy as np
import pytest

import lodlab as lod
from lodlab.instrument.yardstick import Yardstick


@pytest.mark.parametrize("pipeline", ["compute", "geometry"])
def test_a_limit_counts_what_is_in_sight_alone_also_where_all_is_captured(tmp_path, pipeline):
    blob = lod.datasets.load("blob:size=20")
    store = lod.build(blob, "subdivision", tmp_path / "a.lod", degree=9, target=100, progress=False)
    session = store.session(pipeline=pipeline).core
    instrument = Yardstick(blob, metrics="geometry", progress=False).instrument()
    random = np.random.default_rng(0)
    for limit in (400, 1500, 3000):
        way = random.normal(size=3)
        view = lod.View(0.4 * blob.extent * way / np.linalg.norm(way), (0, 0, 0), size=(96, 72))
        cut, cost = session.time_frame(view, lod.Budget(triangles=limit))
        assert 0 < cost["triangles"] == cut.triangles < len(session.capture(cut, view))
        assert instrument.examine(session, cut, view, None, True, None).capture_mismatch_pixels == 0


@pytest.mark.parametrize("pipeline", ["compute", "geometry"])
def test_cuts_by_hand_are_drawn_whole_and_limits_kept_however_near_the_eye(tmp_path, pipeline):
    blob = lod.datasets.load("blob:size=20")
    store = lod.build(blob, "subdivision", tmp_path / "a.lod", degree=9, target=100, progress=False)
    session = store.session(pipeline=pipeline).core
    at = blob.positions[0]
    view = lod.View(at * (1.0 + 1e-9), at, size=(96, 72), near=1e-9)
    hand = session.cut(np.unique(store.nodes["id"]), np.empty(0, np.int32))
    assert len(session.capture(hand, view, everything=False).triangles) == hand.triangles
    cut, cost = session.time_frame(view, lod.Budget(triangles=1))
    assert 0 < cost["triangles"] == cut.triangles == cut.visible_nodes
