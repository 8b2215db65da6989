# SPDX-License-Identifier: MIT
"""What maps that come while one flies must keep to, whatever the method: views, and two checks."""

from __future__ import annotations

import numpy as np

import lodlab as lod
from lodlab import _core

BUDGET = _core.Budget(pixel_error=1.0)


def views(field: lod.HeightField, count: int) -> list[_core.View]:
    """Low over the field, along its diagonal."""
    x0, y0 = field.origin
    dx, dy = field.spacing
    top = float(np.nanmax(field.heights))
    out = []
    for at in np.linspace(150, 800, count):
        eye = (x0 + at * dx, y0 - at * dy, top + 40 * dx)
        out.append(_core.View(eye, (eye[0] + 90 * dx, eye[1] - 90 * dy, top - 60 * dx), fov=60.0, size=(160, 90)))
    return out


def settled(session: object, view: _core.View, frames: int = 12) -> tuple[_core.Cut, dict]:
    for _ in range(frames):
        session.settle()
        cut, row = session.time_frame(view, BUDGET)
    return cut, row


def slow_storage_delays_no_frame(field: lod.HeightField, store: lod.Store) -> None:
    instrument = _core.Instrument(field.core, None)
    session = store.core.session({"stream": True, "fetch_delay_ms": 200, "gpu_cache_mb": 24, "cpu_cache_mb": 16})
    for view in views(field, 5):
        cut, row = session.time_frame(view, BUDGET)
        assert cut.missing_nodes > 0, "a frame that waits for storage misses nothing"
        assert row["resident_bytes"] <= 24 << 20
        found = instrument.examine(session, cut, view, pictures=False)
        assert (found.crack_edges, found.hole_samples) == (0, 0)


def memory_is_within(field: lod.HeightField, store: lod.Store, *, stream: bool, gpu_cache_mb: int) -> None:
    small = store.core.session({"stream": stream, "gpu_cache_mb": gpu_cache_mb, "cpu_cache_mb": 8})
    large = store.core.session({"stream": False})
    uploads = 0
    for view in views(field, 6) + views(field, 6)[::-1]:
        for _ in range(3):
            small.settle()
            cut, row = small.time_frame(view, BUDGET)
            uploads += row["upload_bytes"]
            assert row["resident_bytes"] <= gpu_cache_mb << 20
        if not stream:  # in rounds, if need be
            assert np.array_equal(small.draw(cut, view).image, large.draw(cut, view).image)
    assert uploads > gpu_cache_mb << 20  # tiles went, and came again
