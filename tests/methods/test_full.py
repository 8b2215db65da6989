# SPDX-License-Identifier: MIT
"""full: the source, drawn whole. Law 5 of the instrument: it measures no error, no cracks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import lodlab as lod
from lodlab import _core
from lodlab.instrument import measure
from tests.contract import MethodContract


class TestFull(MethodContract):
    method = "full"


@pytest.mark.parametrize("spec", ["jacksboro", "earth:vertical_scale=20", "earth:planet=true"])
def test_measures_nothing_on_real_terrain(spec: str, tmp_path: Path) -> None:
    field = lod.datasets.load(spec)
    store = lod.build(field, "full", tmp_path / "full.lod", progress=False)
    session = store.core.session({})
    instrument = _core.Instrument(field.core, session)
    view = lod.CameraPath.flyover(field, frames=5).view(2, size=(640, 360))
    cut = session.select(view, _core.Budget(pixel_error=1.0))
    row = measure(instrument, session, cut, view, instrument.reference(view))
    far = np.linalg.norm(np.asarray(view.eye)) + (2 * field.radius if field.planet else 4e7)
    assert row["measured_px_max"] <= 0.01
    assert row["measured_max"] <= 4 * far * 2.0**-23
    assert row["crack_edges"] == row["crack_pixels"] == row["hole_samples"] == 0
    assert row["capture_mismatch_pixels"] == 0
    assert row["psnr_db"] == np.inf
