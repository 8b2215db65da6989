# SPDX-License-Identifier: MIT
"""The smallest store and cheapest budget: small real searches, measured again by other means."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import lodlab as lod
from lodlab import _core
from lodlab.cli import verdicts
from lodlab.errors import InvalidInput, Unsupported
from lodlab.runs import fitting

SOURCE = "fractal:size=129,seed=3"
SIZE = (200, 120)
FRAMES = 9
CHUNKS = {"leaf": 16, "chunk_triangles": 128}
LIMIT = 0.5


@pytest.fixture(scope="module")
def field():
    return lod.datasets.load(SOURCE)


def fitted(field, folder, limit=LIMIT, method="chunked", options=CHUNKS, **more):
    given = {"size": SIZE, "frames": FRAMES, "progress": False, **more, **options}
    return lod.fit(field, method, folder / "s.lod", pixel_error=limit, **given)


@pytest.fixture(scope="module")
def found(field, tmp_path_factory):
    return fitted(field, tmp_path_factory.mktemp("fit"))


def measure(field, store, budget, frames=FRAMES, factor=4) -> list[float]:
    """Measured pixels on every frame of a dense sampling of the flyover, without any of fit's machinery."""
    instrument = _core.Instrument(field.core, None)
    session = store.core.session({"stream": False})
    path = lod.CameraPath.flyover(field, frames=(frames - 1) * factor + 1)
    out = []
    for view in path.views(SIZE):
        cut = session.select(view, lod.Budget(**budget))
        out.append(instrument.examine(session, cut, view, pictures=False).measured_px_max)
    return out


def test_every_frame_of_the_dense_sampling_stays_within(field, found):
    assert found.reached
    again = measure(field, lod.open(found.store.path), found.budget)
    assert len(again) == found.verified_frames == 33
    assert max(again) == found.worst_px <= LIMIT
    assert found.frames == FRAMES


def test_both_neighbours_exceed(field, found, tmp_path):
    """One rung coarser, or a budget of a tenth more: really built, flown and measured."""
    coarser, looser = found.coarser, found.looser
    assert coarser.finest_error == pytest.approx(found.finest_error * math.sqrt(2), rel=1e-5)
    assert coarser.budget == found.budget
    assert looser.budget["pixel_error"] == pytest.approx(1.1 * found.budget["pixel_error"], rel=1e-5)
    assert looser.finest_error == found.finest_error
    store = lod.build(field, "chunked", tmp_path / "c.lod", progress=False, finest_error=coarser.finest_error, **CHUNKS)
    assert store.bytes < found.bytes
    worst = max(measure(field, store, coarser.budget))
    assert LIMIT < coarser.worst_px <= worst
    assert LIMIT < looser.worst_px <= max(measure(field, found.store, looser.budget))


def test_no_budget_saves_a_coarser_rung(field, found, tmp_path):
    for k, budget in enumerate((LIMIT, 0.1 * LIMIT)):
        coarser = {"finest_error": found.coarser.finest_error, **CHUNKS}
        store = lod.build(field, "chunked", tmp_path / f"{k}.lod", progress=False, **coarser)
        assert max(measure(field, store, {"pixel_error": budget})) > LIMIT


def test_what_it_says(field, found):
    store = lod.open(found.store.path)
    assert store.options["finest_error"] == found.finest_error
    assert store.options["leaf"] == 16
    assert found.bytes == store.bytes == store.info()["bytes"]
    session = store.core.session({"stream": False})
    views = lod.CameraPath.flyover(field, frames=FRAMES).views(SIZE)
    triangles = [session.select(view, lod.Budget(**found.budget)).triangles for view in views]
    assert found.median_triangles == np.median(triangles)
    record = json.loads(json.dumps(found.to_dict()))
    assert record["store"] == str(found.store.path)
    assert record["coarser"]["worst_px"] == found.coarser.worst_px
    assert record["pixel_error"] == LIMIT and record["reached"] is True
    assert "reached: finest_error" in repr(found) and f"{found.bytes} bytes" in repr(found)
    assert [f.name for f in store.path.parent.iterdir()] == ["s.lod"]


def test_it_says_in_which_frames_its_budget_goes_unmet_and_why(field, found, capsys):
    """There the finest that the store has is drawn, and its bounds are above the budget, though what is measured
    is within the limit."""
    session = lod.open(found.store.path).core.session({"stream": False})
    views = list(lod.CameraPath.flyover(field, frames=FRAMES).views(SIZE))
    cuts = [session.select(view, lod.Budget(**found.budget)) for view in views]
    unmet = [k for k, cut in enumerate(cuts) if not cut.budget_met]
    assert 0 < len(unmet) == found.unmet_frames < FRAMES
    assert found.predicted_px == max(cut.predicted_px for cut in cuts) > LIMIT
    for k in unmet:
        finest = session.select(views[k], lod.Budget(pixel_error=1e-9))
        assert cuts[k].predicted_px == finest.predicted_px
    verdicts.print_fit(found)
    assert f"budget met: no in {len(unmet)} of {FRAMES} frames: there the finest" in capsys.readouterr().out
    verdicts.print_fit(replace(found, unmet_frames=0, unseen_frames=2))
    out = capsys.readouterr().out
    assert "budget met" not in out and "2 frames see nothing of the source" in out


def test_its_lines_can_be_typed(found):
    many = replace(found, budget={"triangles": 1_234_567}, fly_options={"stream": False, "projection": "vertical"})
    fly, check = verdicts.fit_lines(many, Path("a b"), ["--path", "my keys.toml"])
    assert "--out 'a b' --path 'my keys.toml' --triangles 1234567 --accuracy-frames 9" in fly
    assert fly.endswith("-o stream=false -o projection=vertical")
    assert check == "lodlab check 'a b' --max measured_px_max=0.5"


def test_fly_gets_the_options_that_were_measured():
    draw = _core.resolve_options("chunked", "draw", {"projection": "vertical"})
    small = fitting._fly_options("chunked", draw, 1 << 20)
    assert small["projection"] == "vertical" and "gpu_cache_mb" not in small
    assert {**draw, **small}["stream"] is False
    assert fitting._fly_options("chunked", draw, 1 << 30)["gpu_cache_mb"] > 1024  # all of it is loaded
    assert fitting._fly_options("full", {}, 1 << 40) == {}


def test_what_is_in_the_way_of_a_run_is_said_before_the_search(field, tmp_path, monkeypatch):
    monkeypatch.setattr(fitting, "_Search", None)
    (tmp_path / "file").write_text("mine")
    with pytest.raises(InvalidInput, match="fit: out is .*file, a file"):
        fitted(field, tmp_path, out=tmp_path / "file")
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "frames.csv").write_text("run\r\n")
    with pytest.raises(InvalidInput, match="holds runs already"):
        fitted(field, tmp_path, out=tmp_path / "run")


def test_a_frame_between_the_frames_is_found(field, tmp_path):
    """A path that comes close between its two frames: only the denser sampling sees it."""
    middle = np.array([1900.0, -1900.0, 0.0])
    high, low = middle + [0, 0, 40_000], middle + [0, 0, 1_800.0]
    keys = [{"t": t, "eye": eye.tolist(), "target": (middle + [900, 0, 0]).tolist()}
            for t, eye in ((0.0, high), (0.5, low), (1.0, high))]  # fmt: skip
    path = lod.CameraPath.from_keys(keys, frames=2)
    fit = fitted(field, tmp_path, path=path)
    assert (fit.frames, fit.verified_frames, fit.reached) == (2, 5, True)
    assert 0 < fit.worst_px <= LIMIT
    assert fit.coarser.t == 0.5
    from_afar = fitted(field, tmp_path, path=lod.CameraPath.from_keys(keys[::2], frames=2), force=True)
    assert from_afar.finest_error > 2 * fit.finest_error


def test_a_tighter_limit_costs_more(field, found, tmp_path):
    tight = fitted(field, tmp_path, limit=LIMIT / 4)
    assert tight.reached and tight.worst_px <= LIMIT / 4
    assert tight.finest_error < found.finest_error
    assert tight.bytes >= found.bytes and tight.median_triangles > found.median_triangles


def test_out_of_reach_is_said(field, tmp_path):
    fit = fitted(field, tmp_path, limit=1e-7)
    assert not fit.reached
    assert fit.finest_error == 0.0
    assert 1e-7 < fit.worst_px < 0.2
    assert fit.coarser is None and fit.looser is None
    assert "NOT reached" in repr(fit)
    assert lod.open(tmp_path / "s.lod").options["finest_error"] == 0.0
    assert fit.to_dict()["reached"] is False


def test_where_everything_holds_there_is_no_neighbour(tmp_path):
    """A plane far below: the coarsest store under the loosest budget."""
    fit = fitted(lod.HeightField(np.zeros((65, 65)), spacing=30.0), tmp_path)
    assert fit.reached and fit.worst_px <= 1e-3
    assert fit.coarser is None and fit.looser is None


def test_full_has_nothing_to_choose(field, tmp_path):
    fit = fitted(field, tmp_path, method="full", options={})
    assert fit.reached and fit.budget == {} and fit.looser is None
    assert fit.worst_px <= _core.SLACK_PIXELS
    fit = fitted(field, tmp_path, limit=1e-9, method="full", options={}, force=True)
    assert not fit.reached


def test_a_mesh_is_fitted_on_its_orbit(tmp_path):
    mesh = lod.datasets.load("torus:rings=24,sides=12")
    fit = fitted(mesh, tmp_path, method="full", options={}, out=tmp_path / "run")
    assert fit.reached and fit.path == "orbit" and fit.worst_px <= _core.SLACK_PIXELS
    assert (fit.run.frames["path"] == "orbit").all() and fit.run.frames["accuracy"].all()


@pytest.mark.parametrize(("kind", "extent"), [("mesh", 8.0), ("heightfield", 3.0)])
def test_rungs_go_down_from_the_extent_of_a_mesh_and_the_relief_of_a_field(kind, extent):
    source = SimpleNamespace(kind=kind, extent=extent, heights=np.array([[1.0, 4.0]]))
    rungs = fitting._rungs(source, "chunked")
    assert rungs[0] <= extent < 1.5 * rungs[0] and rungs[-1] == 0.0


def test_triangles_where_a_method_has_no_pixel_error(field, tmp_path, monkeypatch):
    table = fitting.method_table

    def without(name):
        return {**table(name), "budgets": ["triangles"]}

    monkeypatch.setattr(fitting, "method_table", without)
    fit = fitted(field, tmp_path)
    assert fit.reached and fit.worst_px <= LIMIT < fit.looser.worst_px
    more, fewer = fit.budget["triangles"], fit.looser.budget["triangles"]
    assert more / fewer == pytest.approx(1.1, rel=0.01)
    assert fit.median_triangles <= more


def test_draw_options_count(field, found, tmp_path):
    vertical = fitted(field, tmp_path, options={**CHUNKS, "projection": "vertical"})
    assert vertical.reached
    assert vertical.finest_error == found.finest_error  # a matter of the store, not of how it is projected


def test_what_cannot_be_asked(field, tmp_path):
    for limit in (0, -1.0, math.nan, math.inf, "1", True, None):
        with pytest.raises(InvalidInput, match="fit: pixel_error is .* a positive number"):
            fitted(field, tmp_path, limit=limit)
    with pytest.raises(InvalidInput, match="method 'nanite' is not known"):
        fitted(field, tmp_path, method="nanite")
    with pytest.raises(InvalidInput, match="no option 'leaves'; it has .*leaf"):
        fitted(field, tmp_path, options={"leaves": 3})
    with pytest.raises(InvalidInput, match="leaf = 48"):
        fitted(field, tmp_path, options={"leaf": 48})
    for mine in ({"finest_error": 1.0}, {"stream": True}):
        with pytest.raises(InvalidInput, match=f"fit: {next(iter(mine))} cannot be set"):
            fitted(field, tmp_path, options=mine)
    with pytest.raises(Unsupported, match="does not accept a planet"):
        fitted(lod.HeightField(np.zeros((19, 36)), planet=True), tmp_path)
    with pytest.raises(InvalidInput, match="is no folder"):
        fitted(field, tmp_path / "nowhere")
    assert not list(tmp_path.iterdir())
    (tmp_path / "s.lod").write_text("mine")
    with pytest.raises(InvalidInput, match="exists already"):
        fitted(field, tmp_path)
    assert (tmp_path / "s.lod").read_text() == "mine"


def test_a_path_that_sees_nothing_is_refused(field, tmp_path):
    away = [{"t": t, "eye": [0, 0, 9e3], "target": [0, 0, 9e4 + t], "up": [0, 1, 0]} for t in (0.0, 1.0)]
    with pytest.raises(InvalidInput, match="no frame of path keys sees the source"):
        fitted(field, tmp_path, path=lod.CameraPath.from_keys(away, frames=3))
    assert not list(tmp_path.iterdir())
