# SPDX-License-Identifier: MIT
"""What is accepted works, and what cannot is refused with its limit: sizes, near planes, directions, environment."""

import os
import subprocess
import sys

import numpy as np
import pytest

import lodlab as lod
from lodlab import _core
from lodlab.cli import doctor


@pytest.fixture(scope="module")
def hills():
    return lod.HeightField(_core.fractal(70, 80, 3, 4, seed=5, roughness=0.5))  # 2.4 km, 30 m


def look(near=None, **more):
    return _core.View((1000, -2600, 1800), (1000, -1000, 200), size=(96, 64), near=near, **more)


@pytest.mark.parametrize("method", [m["name"] for m in lod.methods() if "heightfield" in m["accepts"]])
def test_a_near_plane_that_leaves_no_depth_is_refused_and_a_nearer_one_draws_the_same(method, hills, tmp_path):
    store = lod.build(hills, method, tmp_path / "s.lod", progress=False)
    instrument = _core.Instrument(hills.core, None)
    cut = store.select(look(near=1.0), lod.Budget(pixel_error=1.0))
    picture = store.draw(cut, look(near=1.0)).image
    assert (store.draw(cut, look(near=1e-20)).image == picture).all()
    measured = instrument.examine(store.default_session.core, cut.core, look(near=1e-20))
    assert measured.capture_mismatch_pixels == 0
    with pytest.raises(lod.errors.InvalidInput, match=r"near 1e-30 is less than 1e-25 of .* at least \d"):
        store.draw(cut, look(near=1e-30))


def test_a_near_plane_that_no_float_holds_is_no_view():
    with pytest.raises(lod.errors.InvalidInput, match="near 1e-40 is not a distance within 1e-36 to 1e36"):
        look(near=1e-40)
    with pytest.raises(lod.errors.InvalidInput, match=r"near 1e-38 \(a ten-thousandth"):
        _core.View((0, 0, 0), (0, 1e-34, 0))


@pytest.mark.parametrize("length", [1e200, 1e-200])
def test_up_is_a_direction_however_long(length):
    short, long = (look(up=(0.0, a, 2.0 * a)).matrix for a in (1.0, length))
    assert np.allclose(short, long, rtol=1e-12)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"target": (1e200, 0, 0)}, "not within 1e36"),
        ({"target": (np.inf, 0, 0)}, "not finite"),
        ({"eye": (0, 0, np.nan)}, "not finite"),
        ({"fov": np.nan}, "fov nan degrees"),
        ({"fov": 1e-9}, "fov 1e-09 degrees"),
        ({"size": (10**12, 64)}, "16384"),
        ({"near": np.inf}, "near inf"),
    ],
)
def test_a_view_beyond_its_limits_names_value_and_limit(given, message):
    with pytest.raises(lod.errors.InvalidInput, match=message):
        _core.View(**{"eye": (0, 0, 0), "target": (1, 0, 0), **given})


@pytest.mark.parametrize("spacing", [1e-30, 1e15, 1e30])
def test_random_cuts_of_fields_of_any_spacing(spacing, tmp_path):
    heights = np.random.default_rng(0).normal(size=(17, 20)) * 3 * spacing
    field = lod.HeightField(heights, spacing=spacing)
    for method in ("chunked", "multigrain", "seamless"):
        store = lod.build(field, method, tmp_path / f"{method}.lod", progress=False)
        assert lod.instrument.audit(store, cuts=3, progress=False).broken.empty


@pytest.mark.parametrize("value", ["abc", "0", "-1", "1e9", "2048"])
def test_a_wrong_number_of_threads_is_one_line(value):
    command = [sys.executable, "-m", "lodlab", "build", "fractal:size=9", "full", "x.lod"]
    done = subprocess.run(command, env={**os.environ, "LODLAB_THREADS": value}, capture_output=True, text=True)
    assert done.returncode == 2
    assert done.stderr == f"error: LODLAB_THREADS: '{value}' is not a number from 1 to 1024\n"


@pytest.mark.parametrize(
    ("name", "value", "what"),
    [
        ("LODLAB_THREADS", "abc", "threads"),
        ("LODLAB_WINDOW_SAMPLES", "many", "samples read at once"),
        ("LODLAB_WINDOW_SAMPLES", "-5", "samples read at once"),
        ("LODLAB_DATA", "/nowhere", "data folder"),
        ("LODLAB_SHADER_DIR", "/nowhere", "a triangle"),
    ],
)
def test_the_doctor_finds_a_wrong_environment_and_says_which(name, value, what, monkeypatch):
    monkeypatch.setenv(name, value)
    wrong = [finding for finding in doctor.examine() if finding.ok is False]
    assert wrong[0].what == what
    assert name in wrong[0].text and wrong[0].cure
