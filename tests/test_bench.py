# SPDX-License-Identifier: MIT
"""The benchmark harness: its statistics, its bars, and its records on a source small enough for a test.

No test here asserts a speed: `lodlab bench --check` does that, on a quiet machine.
"""

from __future__ import annotations

import json
import math
import re
import shlex
from pathlib import Path

import numpy as np
import pytest

import lodlab as lod
from lodlab import _core, datasets
from lodlab.bench import costs, lab, meshes, multigrain, subdivision, suite
from lodlab.errors import InvalidInput
from lodlab.paths.path import CameraPath

FIELDS = {
    "bench", "case", "value", "unit", "reference", "reference_value", "ratio", "device", "commit", "options", "seed",
}  # fmt: skip


def record(**values):
    return lab.record("draw", "chunked/jacksboro", 1.0, "triangles/s", **values)


def test_bootstrap_interval_holds_the_median_and_narrows_with_samples():
    noise = np.random.default_rng(3).normal(1.0, 0.1, 400)
    few = lab.bootstrap_median(noise[:20])
    many = lab.bootstrap_median(noise)
    for median, low, high in (few, many):
        assert low <= median <= high
    assert many[2] - many[1] < few[2] - few[1]
    assert many[1] < 1.0 < many[2]
    assert lab.bootstrap_median(noise) == many, "the interval is not repeatable"


def test_bootstrap_refuses_too_few():
    with pytest.raises(InvalidInput, match="at least 5"):
        lab.bootstrap_median(np.ones(4))


def test_interleaved_swaps_the_order_from_pair_to_pair():
    calls = []

    def one(name, value):
        calls.append(name)
        return value

    pairs = lab.interleaved(lambda: one("a", 1.0), lambda: one("b", 2.0), 4)
    assert calls == list("ab" + "ab" + "ba" + "ab" + "ba")
    assert (pairs == [1.0, 2.0]).all()


def test_check_names_what_falls_short(tmp_path):
    bars = tmp_path / "bars.toml"
    bars.write_text(
        '[[bar]]\nbench = "draw"\ncase = "chunked/*"\nfield = "ratio_low"\nmin = 0.95\n'
        '[[bar]]\nbench = "select"\ncase = "chunked/*"\nfield = "value"\nmax = 10.0\n'
    )
    assert suite.check([record(ratio_low=0.96)], bars) == []
    assert "0.94 " in suite.check([record(ratio_low=0.94)], bars)[0]
    assert len(suite.check([record(ratio_low=math.nan)], bars)) == 1, "an unmeasured figure passed"
    assert len(suite.check([record(ratio_low=0.96) | {"case": "full/jacksboro"}], bars)) == 1
    slow = lab.record("select", "chunked/x", 10.5, "us/frame")
    assert "above 10" in suite.check([slow], bars)[0]


def test_a_bar_may_stand_on_a_detail(tmp_path):
    bars = tmp_path / "bars.toml"
    bars.write_text('[[bar]]\nbench = "draw"\ncase = "chunked/*"\nfield = "details.p99_us"\nmax = 5.0\n')
    assert suite.check([record(details={"p99_us": 4.0})], bars) == []
    assert "details.p99_us 6 " in suite.check([record(details={"p99_us": 6})], bars)[0]
    assert len(suite.check([record()], bars)) == 1, "a detail that is not there passed"


def test_a_bar_of_a_file_stands_where_the_file_is(tmp_path, monkeypatch):
    monkeypatch.setenv("LODLAB_DATA", str(tmp_path))
    monkeypatch.delenv("LODLAB_REQUIRE_DATA", raising=False)
    bars = tmp_path / "bars.toml"
    bars.write_text('[[bar]]\nbench = "draw"\ncase = "full/x"\nfile = "x.off"\nfield = "value"\nmin = 5.0\n')
    assert suite.check([record()], bars) == []
    (tmp_path / "x.off").write_text("OFF 0 0 0")
    assert suite.check([record()], bars) == ["draw full/x: not measured"]
    said: list[str] = []
    assert lab.Lab(tmp_path, said.append).lacks("y.off", "draw full/y") and "y.off is not there" in said[0]


def bring_ball(folder, monkeypatch):
    """The folder holds further data: a ball."""
    ball = datasets.load("icosphere:level=2")
    lines = ["OFF", f"{ball.samples} {len(ball.faces)} 0", *(" ".join(map(str, p)) for p in ball.positions.tolist())]
    (folder / "ball.off").write_text("\n".join([*lines, *("3 {} {} {}".format(*f) for f in ball.faces.tolist())]))
    monkeypatch.setenv("LODLAB_DATA", str(folder))


def test_benches_of_meshes_make_their_records(tmp_path, monkeypatch):
    bring_ball(tmp_path, monkeypatch)
    monkeypatch.setattr(meshes, "FILES", {"ball": "ball.off", "cube": "cube.off"})
    monkeypatch.setattr(lab, "SIZE", (160, 90))
    for cases in ("DRAWN", "MEASURED", "BUILT", "PROMISED"):
        monkeypatch.setattr(meshes, cases, (("full", "ball"), ("full", "cube")))
    shared = lab.Lab(tmp_path, lambda text: None)
    benches = (meshes.draw, meshes.measure, meshes.build, meshes.accuracy)
    made = [one for bench in benches for one in bench(shared)]
    assert [(r["bench"], r["case"]) for r in made[:4]] == [
        ("draw", "full/ball"), ("draw", "full/ball/discard"), ("measure", "full/ball"), ("build", "full/ball")
    ]  # fmt: skip
    assert all(r["value"] > 0.0 for r in made) and made[3]["unit"] == "faces/s"
    assert [r["case"] for r in made[4:]] == [f"full/ball/{p}px" for p in ("0.5", "1", "2", "4", "8")]


def test_benches_of_subdivision_make_their_records(tmp_path, monkeypatch):
    bring_ball(tmp_path, monkeypatch)
    monkeypatch.setattr(subdivision, "FILES", {"dragon": "ball.off"})
    monkeypatch.setattr(lab, "SIZE", (160, 90))
    said: list[str] = []
    shared = lab.Lab(tmp_path, said.append)
    monkeypatch.setattr(subdivision, "FINE", 10**6)
    assert list(subdivision.refine(shared)) == [] and "no view draws 1000000 triangles" in said[-1]
    monkeypatch.setattr(subdivision, "FINE", 0)
    made = [*subdivision.refine(shared), *subdivision.size(shared)]
    names = ["compute", "geometry", "16", "11"]
    assert [r["case"] for r in made] == [f"subdivision/dragon/{name}" for name in names]
    assert all(0.0 < r["value"] < 2.05 for r in made[:2]) and made[2]["value"] > made[3]["value"] > 0.0
    assert 0.0 < made[2]["details"]["rms_percent_of_diagonal"] < 0.1


def test_a_bar_without_a_limit_is_refused(tmp_path):
    bars = tmp_path / "bars.toml"
    bars.write_text('[[bar]]\nbench = "draw"\ncase = "x"\nfield = "value"\n')
    with pytest.raises(InvalidInput, match="min or max"):
        suite.check([record()], bars)


def test_bars_of_the_project_name_benches_that_exist():
    import tomllib

    bars = tomllib.loads(suite.bars_file().read_text())["bar"]
    assert {bar["bench"] for bar in bars} <= set(suite.names())
    assert {bar["bench"] for bar in bars} == set(suite.names())


def test_unknown_bench_lists_the_known_ones():
    with pytest.raises(InvalidInput, match="known: draw, select"):
        suite.run(["drawing"])


def test_records_carry_the_promised_fields_and_become_json():
    one = record(ratio=math.nan, details={"chunks": np.int64(3), "share": np.float64(0.5)})
    assert one.keys() >= FIELDS
    back = json.loads(suite.to_json([one]))[0]
    assert back["ratio"] is None and back["details"] == {"chunks": 3, "share": 0.5}


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    source = datasets.load("jacksboro")
    path = tmp_path_factory.mktemp("bench") / "jacksboro.lod"
    store = _core.build(source.core, "chunked", str(path), {}, "new", None)
    flight = CameraPath.flyover(source, frames=5)
    return store, store.session({"stream": False}), [flight.view(f, size=(320, 180)) for f in range(5)]


def test_static_reference_holds_the_very_triangles_of_the_cut(session):
    _, chunked, views = session
    cut = chunked.select(views[2], _core.Budget(pixel_error=2.0))
    capture = chunked.capture(cut, views[2], False)
    reference = _core.StaticMesh(capture, datasets.load("jacksboro").core)
    assert reference.triangles == cut.triangles == len(capture)
    assert reference.vertices == len(np.unique(capture.triangles.reshape(-1, 3), axis=0))
    assert reference.time_draw(views[2], False) > 0.0
    assert reference.time_draw(views[2], True) > 0.0


def test_select_is_timed_for_every_frame_and_repeat(session):
    store, chunked, views = session
    budget = _core.Budget(pixel_error=2.0)
    times, chunks = _core.time_select(chunked, views, budget, 3)
    assert times.shape == (3, 5) and (times > 0.0).all()
    assert chunks.tolist() == [chunked.select(v, budget).visible_nodes for v in views]
    scan = _core.time_scan(store, views, 2.0, 3)
    assert scan.shape == (3, 5) and (scan > 0.0).all()


def test_a_planet_resampled_has_no_fewer_triangles_and_its_own_heights():
    rows, cols = np.mgrid[0:21, 0:40]
    planet = lod.HeightField((10.0 * rows).astype(np.float32), planet=True)
    coarse = multigrain._resampled(planet, 150)
    below, cells = coarse.heights.shape[0] - 1, coarse.heights.shape[1]
    assert cells == 2 * below and 2 * cells * (below - 1) >= 150 > 2 * (cells - 2) * (below - 2)
    assert np.allclose(coarse.heights, np.linspace(0.0, 200.0, below + 1)[:, None])


def test_random_cuts_are_counted_with_their_cracks(tmp_path):
    shared = lab.Lab(tmp_path, lambda text: None)
    for tile in multigrain.TILES:
        found = multigrain._cuts_of(shared, tile, 5)
        assert found["details"]["cuts"] == 5 and found["details"]["crack_edges"] == 0 and found["value"] > 0.0


def test_the_demo_that_is_timed_is_the_one_of_the_makefile():
    text = (Path(__file__).parents[1] / "Makefile").read_text().replace("\\\n", " ")
    (line,) = re.findall(r"^\t.venv/bin/lodlab (compare .*)", text, re.MULTILINE)
    assert shlex.split(line) == [*costs.DEMO, "--out", "runs/demo"]
