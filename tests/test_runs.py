# SPDX-License-Identifier: MIT
"""Runs: two passes, their table, and what is refused. No test here asserts a speed."""

from __future__ import annotations

import json
import math
import sys

import av
import numpy as np
import PIL.Image
import pytest

import lodlab as lod
from lodlab import _core, movies
from lodlab.errors import InvalidInput, StoreError, Unsupported
from lodlab.instrument import measure, yardstick
from lodlab.runs import flight, passes, tables, toml
from lodlab.runs import run as runs

SOURCE = "fractal:size=65,seed=3"
SIZE = (160, 90)
CHUNKS = {"leaf": 16, "chunk_triangles": 128}  # small enough that a small field has several
SMALL = {"size": SIZE, "accuracy_frames": 3, "progress": False}


@pytest.fixture(scope="module")
def field():
    return lod.datasets.load(SOURCE)


@pytest.fixture(scope="module")
def store(field, tmp_path_factory):
    return lod.build(field, "chunked", tmp_path_factory.mktemp("runs") / "a.lod", progress=False, **CHUNKS)


@pytest.fixture(scope="module")
def full(field, tmp_path_factory):
    return lod.build(field, "full", tmp_path_factory.mktemp("runs") / "full.lod", progress=False)


@pytest.fixture(scope="module")
def path(field):
    return lod.CameraPath.flyover(field, frames=7)


@pytest.fixture(scope="module")
def run(store, path):
    return lod.fly(store, path, lod.Budget(pixel_error=1.0), stream=False, **SMALL)


def test_frames_have_exactly_the_columns_and_a_row_a_frame(run):
    assert tuple(run.frames.columns) == tables.FRAME_COLUMNS
    assert run.frames["frame"].tolist() == list(range(7))
    assert run.name == "chunked-px1"
    assert set(run.frames["source"]) == {SOURCE}
    assert set(run.frames["path"]) == {"flyover"}
    assert set(run.frames["device"]) == {_core.gl_info()["renderer"]}
    assert (run.frames["processed_triangles"] == 0).all(), "whole nodes are tested, no triangle is"


def test_accuracy_frames_are_evenly_spaced_and_the_others_undefined(run):
    measured = run.frames[run.frames["accuracy"]]
    assert measured["frame"].tolist() == [0, 3, 6]
    others = run.frames[~run.frames["accuracy"]]
    unknown = [c for c in tables.ACCURACY_COLUMNS if c != "predicted_px"]
    assert others[unknown].isna().all(axis=None)
    assert measured[["measured_px_max", "measured_max", "psnr_db", "crack_edges"]].notna().all(axis=None)
    assert run.frames["predicted_px"].notna().all(), "the method's claim is known in every frame"


def test_the_instrument_returns_every_accuracy_column(store, field, full, path):
    instrument = _core.Instrument(field.core, full.core.session({}))
    session = store.core.session({"stream": False})
    view = path.view(3, size=SIZE)
    cut = session.select(view, _core.Budget(pixel_error=1.0))
    row = measure(instrument, session, cut, view, instrument.reference(view))
    assert set(row) == set(tables.ACCURACY_COLUMNS)


def test_geometry_alone_measures_the_same_and_draws_no_picture(store, path, run, monkeypatch):
    monkeypatch.setattr(yardstick.Yardstick, "reference", lambda *_: None)  # nothing may need one
    monkeypatch.setattr(yardstick, "store_for", None)  # nor `full`, which draws them
    geometry = lod.fly(store, path, lod.Budget(pixel_error=1.0), metrics="geometry", **SMALL)
    drawn = ("measured_px_p99", "measured_px_rms", "psnr_db", "crack_pixels", "crack_mask_share", "ssim", "flip",
             "capture_mismatch_pixels", "pop_area", "drawn_triangles")  # fmt: skip
    assert geometry.frames[list(drawn)].isna().all(axis=None)
    same = [c for c in tables.ACCURACY_COLUMNS if c not in drawn]
    assert geometry.frames[same].equals(run.frames[same])
    with pytest.raises(InvalidInput, match="no reference .metrics='geometry'"):
        geometry.image(3, "reference")
    with pytest.raises(InvalidInput, match="metrics is 'some'; it is one of all, geometry"):
        lod.fly(store, path, lod.Budget(pixel_error=1.0), metrics="some", **SMALL)


def test_laws_hold_in_every_measured_frame(run):
    measured = run.frames[run.frames["accuracy"]]
    assert measured["promises_bound"].all()
    assert (measured["measured_px_max"] <= measured["predicted_px"] + 0.011).all()
    assert (measured["hole_samples"] == 0).all()
    assert (measured["capture_mismatch_pixels"] == 0).all()


def test_full_measures_nothing_and_has_no_budget(full, path):
    run = lod.fly(full, path, **SMALL)
    assert run.name == "full"
    assert run.frames[["budget_pixel_error", "budget_triangles", "budget_nodes"]].isna().all(axis=None)
    assert run.frames["budget_met"].all()
    measured = run.frames[run.frames["accuracy"]]
    assert (measured["measured_px_max"] <= 0.011).all()
    assert (measured["crack_edges"] == 0).all() and (measured["crack_pixels"] == 0).all()
    assert np.isinf(measured["psnr_db"]).all()


def test_counts_repeat_and_repeat_passes_change_times_only(store, path, run):
    again = lod.fly(store, path, lod.Budget(pixel_error=1.0), repeat=3, stream=False, **SMALL)
    stable = [c for c in tables.FRAME_COLUMNS if c not in tables.TIME_COLUMNS]
    assert again.frames[stable].equals(run.frames[stable])


def test_every_budget_of_a_frame_is_kept(store, path):
    for budget in ({"triangles": 2500}, {"nodes": 12}, {"pixel_error": 8.0, "triangles": 2500}):
        run = lod.fly(store, path, budget, stream=False, **SMALL)
        within = run.frames["predicted_px"] <= budget.get("pixel_error", np.inf)
        within &= run.frames["triangles"] <= budget.get("triangles", np.inf)
        within &= run.frames["nodes"] <= budget.get("nodes", np.inf)
        assert (run.frames["budget_met"] == within).all()
        assert within.any(), "nothing is shown by frames that all miss"
        assert run.name == "chunked-" + flight.budget_text(budget)


def test_streaming_runs_measure_what_was_drawn(store, path):
    run = lod.fly(store, path, lod.Budget(pixel_error=0.5), stream=True, **SMALL)
    assert run.frames["stream"].all()
    measured = run.frames[run.frames["accuracy"]]
    assert (measured["capture_mismatch_pixels"] == 0).all()
    assert (measured["measured_px_max"] <= measured["predicted_px"] + 0.011).all()


def test_a_frame_shows_itself(run):
    frame = run.image(3)
    assert frame.image.shape == (SIZE[1], SIZE[0], 4) and frame.image.dtype == np.uint8
    assert frame.depth.shape == (SIZE[1], SIZE[0])
    assert frame._repr_png_().startswith(b"\x89PNG")
    assert np.any(frame.image != run.image(3, show="level").image)
    assert "chunked-px1" in run._repr_html_()
    with pytest.raises(InvalidInput, match="frame 7 .* 0 to 6"):
        run.image(7)


def test_a_frame_shows_its_measured_error(run, store, path):
    height, width = SIZE[1], SIZE[0]
    made = run.image(3, show="error").image
    assert made.dtype == np.uint8 and made.shape[0] > height and made.shape[1] >= width
    assert np.any(made[:height, :width] != run.image(3).image)
    assert run.image(show="error").image.shape[2] == 4, "of the worst frame"
    unmeasured = lod.fly(store, path, {"pixel_error": 1.0}, **{**SMALL, "accuracy_frames": 0})
    with pytest.raises(InvalidInput, match="was not measured"):
        unmeasured.image(3, show="error")


def test_sources_too_large_for_a_reference_still_show_their_error(store, path, tmp_path, monkeypatch):
    monkeypatch.setattr(yardstick, "PICTURE_SAMPLES", 10)
    run = lod.fly(store, path, {"pixel_error": 1.0}, out=tmp_path / "run", **SMALL)
    kinds = {p.stem.partition("-")[2] for p in (tmp_path / "run" / "images").rglob("*.png")}
    assert kinds == {"", "level", "error"}
    with pytest.raises(InvalidInput, match="has no reference"):
        run.image(show="reference")
    assert "measured error" in (tmp_path / "run" / "report.html").read_text()


def test_run_directory_holds_the_run(store, path, tmp_path):
    out = tmp_path / "run"
    run = lod.fly(store, path, lod.Budget(pixel_error=1.0), out=out, images="all", stream=False, **SMALL)
    back = runs.load(out)
    assert back.frames.drop(columns=list(tables.TIME_COLUMNS)).equals(
        run.frames.drop(columns=list(tables.TIME_COLUMNS))
    )
    pictures = sorted(p.name for p in (out / "images" / "chunked-px1").iterdir())  # and nothing else
    assert pictures == [f"{f:06d}.png" for f in range(7)]
    worst = passes.worst_frame(run.frames.to_dict("records"))
    assert np.array_equal(back.image(worst).image[..., :3], run.image(worst).image[..., :3])
    assert back.image(worst, show="reference").image.shape == (SIZE[1], SIZE[0], 4)
    assert np.array_equal(back.image(worst, show="error").image, run.image(worst, show="error").image)
    record = json.loads((out / "provenance.json").read_text())
    assert record["sources"] == {SOURCE: store.source_hash}
    assert record["gl"]["renderer"] and record["start"] <= record["end"] and record["options_hash"]
    config = toml.read_config(out / "config.toml")
    assert config["sources"] == [SOURCE] and config["methods"][0]["pixel_errors"] == [1.0]
    assert config["methods"][0]["options"]["stream"] is False
    assert (out / "report.html").stat().st_size > 10_000
    assert not lod.fly(store, path, lod.Budget(pixel_error=1.0), out=out, images="all", stream=False, **SMALL)._flown
    with pytest.raises(InvalidInput, match="another configuration .*images"):
        lod.fly(store, path, lod.Budget(pixel_error=1.0), out=out, images="worst", stream=False, **SMALL)


@pytest.fixture(scope="module")
def kept(store, path, tmp_path_factory):
    """A run directory without pictures, and its run as this process knows it."""
    out = tmp_path_factory.mktemp("kept") / "run"
    return out, lod.fly(store, path, {"pixel_error": 1.0}, out=out, images="none", stream=False, **SMALL)


@pytest.mark.parametrize("show", ["shade", "level", "wire", "normal", "reference", "error"])
def test_a_run_read_from_disk_draws_every_frame_again(kept, show):
    out, run = kept
    assert np.array_equal(runs.load(out).image(4, show).image, run.image(4, show).image)


def test_a_run_read_from_disk_is_not_drawn_from_another_source_or_path(kept):
    def refused(message: str, **changed: object) -> None:
        run = runs.load(kept[0])
        run.frames = run.frames.assign(**changed)
        with pytest.raises(InvalidInput, match=f"{message}.*images='all'"):
            run.image(1)

    refused("its source has changed since: hash .* instead of", source="fractal:size=65,seed=4")
    refused("its path has changed since: hash .* instead of", path="orbit")
    refused("frame 0 had 1 triangles and now has .*: the program is another one", triangles=1)
    refused("it cannot be drawn again: .*", source="array:12345678")
    refused("it cannot be drawn again: .*", path="keys")
    refused("it streamed", stream=True)


def test_animations_hold_every_frame(run, tmp_path):
    made = run.animation(fps=20)
    assert len(made) == 7 and made._repr_html_().startswith("<img")
    made.save(tmp_path / "a.gif")
    with PIL.Image.open(tmp_path / "a.gif") as gif:
        assert (gif.n_frames, gif.size, gif.info["duration"]) == (7, SIZE, 50)
    made.save(tmp_path / "a.mp4")
    with av.open(str(tmp_path / "a.mp4")) as film:
        frames = [frame.to_ndarray(format="rgb24") for frame in film.decode(video=0)]
        assert film.streams.video[0].average_rate == 20
    assert len(frames) == 7
    # 4:2:0 and quantization: a few steps in the mean, where another frame differs by tens.
    assert np.abs(frames[3].astype(int) - run.image(3).image[..., :3]).mean() < 6.0
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.gif", "a.mp4"]


def test_films_that_cannot_be_written_are_refused_before_anything_is_drawn(tmp_path, monkeypatch):
    def never() -> None:
        pytest.fail("a frame was drawn")
        yield

    for name, fps, message in (("a.avi", 30, "ends in none of .mp4, .gif"), ("a.gif", 0, "fps is 0"),
                               ("none/a.gif", 30, "no directory"), ("a.gif", True, "fps is True")):  # fmt: skip
        with pytest.raises(InvalidInput, match=message):
            movies.save(tmp_path / name, never(), fps)
    with pytest.raises(InvalidInput, match="there is no frame"):
        movies.save(tmp_path / "a.mp4", iter(()))
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(Unsupported, match=r"lodlab\[video\]"):
        movies.save(tmp_path / "a.mp4", never())
    assert not list(tmp_path.iterdir())


def test_films_with_odd_sides_repeat_their_last_pixels(tmp_path):
    grey = np.full((31, 45, 4), 90, np.uint8)
    movies.save(tmp_path / "a.mp4", iter([grey, grey]))
    with av.open(str(tmp_path / "a.mp4")) as film:
        assert [(f.width, f.height) for f in film.decode(video=0)] == [(46, 32)] * 2


def test_budgets_are_checked_before_anything_is_drawn(store, path, tmp_path):
    with pytest.raises(InvalidInput, match="none set"):
        lod.fly(store, path, **SMALL)
    for wrong in (0.0, -1.0, math.nan):
        with pytest.raises(InvalidInput, match="pixel_error"):
            lod.fly(store, path, {"pixel_error": wrong}, **SMALL)
    with pytest.raises(InvalidInput, match="no_such"):
        lod.fly(store, path, {"pixel_error": 1.0}, no_such=1, **SMALL)
    with pytest.raises(InvalidInput, match="images"):
        lod.fly(store, path, {"pixel_error": 1.0}, images="some", out=tmp_path / "x", **SMALL)
    with pytest.raises(InvalidInput, match="repeat is 0"):
        lod.fly(store, path, {"pixel_error": 1.0}, repeat=0, **SMALL)
    assert not (tmp_path / "x").exists()


def test_a_budget_that_the_method_lacks_is_unsupported(monkeypatch):
    table = {**flight.method_table("chunked"), "budgets": ["pixel_error"]}
    monkeypatch.setattr(flight, "method_table", lambda name: table)
    with pytest.raises(Unsupported, match="no budget nodes; it takes pixel_error"):
        flight.check_budget("chunked", {"nodes": 5})


def test_a_store_without_its_source_says_how_to_pass_it(tmp_path, path, field):
    array = np.asarray(field.heights)
    lod.build(array, "chunked", tmp_path / "array.lod", progress=False)
    opened = lod.open(tmp_path / "array.lod")
    with pytest.raises(StoreError, match="source=SOURCE"):
        lod.fly(opened, path, {"pixel_error": 1.0}, **SMALL)
    with pytest.raises(StoreError, match="hash"):
        lod.open(tmp_path / "array.lod", source="fractal:size=65,seed=4")
    run = lod.fly(opened, path, {"pixel_error": 1.0}, **{**SMALL, "accuracy_frames": 0})
    assert not run.frames["accuracy"].any()
    again = lod.fly(lod.open(tmp_path / "array.lod", source=array), path, {"pixel_error": 1.0}, **SMALL)
    assert again.frames["accuracy"].sum() == 3


def test_capture_mismatch_names_run_frame_and_pixels(run):
    frames = run.frames.copy()
    frames.loc[3, "capture_mismatch_pixels"] = 13
    with pytest.raises(passes.CaptureMismatch, match=r"chunked-px1, frame 3: .* 13 pixels"):
        passes.check_capture(frames)
    passes.check_capture(run.frames)


@pytest.mark.parametrize(
    ("frames", "count", "expected"),
    [(120, 0, []), (120, 1, [59]), (120, 2, [0, 119]), (5, 12, [0, 1, 2, 3, 4]), (1, 12, [0]), (3, 3, [0, 1, 2])],
)
def test_accuracy_indices(frames, count, expected):
    assert passes.accuracy_indices(frames, count) == expected


def test_accuracy_indices_are_distinct_and_reach_both_ends():
    indices = passes.accuracy_indices(120, 12)
    assert len(set(indices)) == 12 and indices[0] == 0 and indices[-1] == 119


def test_run_names_are_safe_as_folders():
    assert flight.run_name("a/b c", "", "chunked", "morph=false", "px0.5") == "a_b_c-chunked-morph=false-px0.5"
    assert flight.run_name("..") == "run"


def test_cells_are_written_as_the_interface_says():
    values = [True, np.False_, None, math.nan, math.inf, -math.inf, np.int64(3), 0.1, np.float32(0.5), "a,b"]
    assert [tables.cell(v) for v in values] == [
        "true", "false", "", "nan", "inf", "-inf", "3", "0.1", "0.5", "a,b",
    ]  # fmt: skip


def test_summary_takes_the_worst_and_the_percentiles(run):
    rows = run.frames.to_dict("records")
    summary = tables.summarize(rows, store_bytes=10, build_seconds=0.5)
    assert {c for c in summary if not c.startswith(tables.OPTION)} == set(tables.SUMMARY_COLUMNS)
    times = run.frames["frame_ms"].to_numpy()
    assert summary["frame_ms_median"] == np.median(times)
    assert summary["frame_ms_p95"] == pytest.approx(np.percentile(times, 95))
    measured = run.frames[run.frames["accuracy"]]
    assert summary["measured_px_max_worst"] == measured["measured_px_max"].max()
    assert summary["psnr_db_worst"] == measured["psnr_db"].min()
    assert summary["accuracy_frames"] == 3
    unmeasured = [{**row, "accuracy": False, "measured_px_max": math.nan} for row in rows]
    assert math.isnan(tables.summarize(unmeasured, store_bytes=0, build_seconds=0)["measured_px_max_worst"])


def test_a_mesh_of_a_cut_is_the_surface_in_source_coordinates(store, full, field, path):
    view = path.view(3, size=SIZE)
    mesh = full.select(view, lod.Budget(pixel_error=1.0)).to_trimesh(view)
    rows, cols = field.shape
    assert len(mesh.faces) == 2 * (rows - 1) * (cols - 1)
    assert len(mesh.vertices) == rows * cols, "equal vertices are one vertex"
    grid = field.core.position(*np.divmod(np.arange(rows * cols), cols))
    step = 4.0 * np.linalg.norm(mesh.vertices - view.eye, axis=1).max() * 2.0**-23
    col = np.rint((mesh.vertices[:, 0] - grid[0, 0]) / field.spacing[0]).astype(int)
    row = np.rint((grid[0, 1] - mesh.vertices[:, 1]) / field.spacing[1]).astype(int)
    assert np.abs(mesh.vertices - grid[row * cols + col]).max() <= step
    coarse = store.select(view, lod.Budget(pixel_error=4.0))
    capture = store.capture(coarse, view)
    assert len(coarse.to_trimesh(view).faces) <= int((capture.kind == 0).sum())
    assert (capture.kind == 1).any(), "chunks have skirts, which the mesh leaves out"
