# SPDX-License-Identifier: MIT
"""Results that must not mix: what rows rest on is known by its hash, a directory grows and never contradicts itself,
and a run directory is enough to fly it again."""

from __future__ import annotations

import json
import os
import warnings

import numpy as np
import pytest

import lodlab as lod
from lodlab import _core, disk, pictures
from lodlab.errors import InvalidInput, StoreError
from lodlab.report import page as report
from lodlab.runs import configs
from lodlab.stores import build

pytestmark = pytest.mark.usefixtures("unrendered")

SMALL = {"frames": 3, "size": (96, 64), "accuracy_frames": 1, "progress": False}
CONFIG = {
    "sources": ["fractal:size=33,seed=3"],
    "frames": 3,
    "size": [96, 64],
    "accuracy_frames": 1,
    "images": "none",
    "pixel_errors": [2.0],
    "methods": [{"name": "full"}, {"name": "chunked", "options": {"leaf": 8}}],
}
TIMES = ("_ms", "build_seconds")


def stable(table):
    """The columns that repeat."""
    return table[[c for c in table if not any(t in c for t in TIMES)]].reset_index(drop=True)


@pytest.fixture(scope="module")
def heights():
    return np.array(lod.datasets.load(CONFIG["sources"][0]).heights)


def keys(lift=0.0):
    return f"""
[[key]]
t = 0
eye = [300, -1100, {3000 + lift}]
target = [500, -500, 2000]
[[key]]
t = 1
eye = [600, -1000, 2800]
target = [500, -500, 2000]
"""


# ---- what has changed under its name ---------------------------------------------------------------


def test_a_changed_key_frame_file_is_refused_by_its_name(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text(keys())
    made = lod.sweep({**CONFIG, "paths": [str(file)]}, out=tmp_path / "run", progress=False)
    assert (tmp_path / "run" / "paths" / "mine.toml").read_text() == keys()
    assert set(made.frames["path"]) == {"paths/mine.toml"}
    file.write_text(keys(lift=1e-3))
    with pytest.raises(InvalidInput, match="path mine.toml has changed"):
        lod.sweep({**CONFIG, "paths": [str(file)]}, out=tmp_path / "run", progress=False)
    assert lod.Sweep.load(tmp_path / "run").frames.equals(made.frames)


def test_a_changed_source_file_is_refused_by_its_name(tmp_path, heights):
    file = tmp_path / "dem.npy"
    np.save(file, heights)
    config = {**CONFIG, "sources": [f"{file}:spacing=30"]}
    made = lod.sweep(config, out=tmp_path / "run", progress=False)
    np.save(file, heights + np.float32(1))
    for again in (config, {**config, "pixel_errors": [2.0, 4.0]}, tmp_path / "run" / "config.toml"):
        with pytest.raises(InvalidInput, match=r"source .*dem\.npy:spacing=30.* has changed"):
            lod.sweep(again, out=tmp_path / "run", progress=False)
    with pytest.raises(InvalidInput, match=r"config\.toml: source .* has changed"):
        lod.sweep(tmp_path / "run" / "config.toml", out=tmp_path / "other", progress=False)
    assert lod.Sweep.load(tmp_path / "run").frames.equals(made.frames)


def test_changed_poses_and_arrays_of_python_are_refused_by_their_names(tmp_path, heights):
    path = lod.CameraPath.orbit(lod.HeightField(heights), frames=3)
    lower = lod.CameraPath.orbit(lod.HeightField(heights - 5.0), frames=3)
    mine = {**CONFIG, "sources": ["mine"], "paths": ["orbit"]}

    def fly(array, chosen):
        return lod.sweep(mine, out=tmp_path / "run", sources={"mine": array}, paths={"orbit": chosen}, progress=False)

    made = fly(heights, path)
    with pytest.raises(InvalidInput, match="source mine has changed"):
        fly(heights + np.float32(1), lod.CameraPath.orbit(lod.HeightField(heights + np.float32(1)), frames=3))
    fly(heights, lower)  # key frames under a name of their own: another path, not that one changed
    assert set(lod.Sweep.load(tmp_path / "run").frames["path"]) == {"orbit", "paths/orbit.toml"}
    with pytest.raises(InvalidInput, match=r"path orbit\.toml has changed"):
        fly(heights, lod.CameraPath.orbit(lod.HeightField(heights - 9.0), frames=3))
    assert set(made.frames["poses_hash"]) < set(lod.Sweep.load(tmp_path / "run").frames["poses_hash"])


def test_a_changed_colour_raster_is_refused_and_its_store_is_not_reused(tmp_path, heights):
    raster = tmp_path / "colour.png"
    grey = np.full((*heights.shape, 4), 255, np.uint8)
    pictures.save(raster, grey)
    config = {**CONFIG, "methods": [{"name": "chunked", "options": {"leaf": 8, "attribute": str(raster)}}]}
    made = lod.sweep(config, out=tmp_path / "run", progress=False)
    assert all(len(h) == 32 for h in made.frames["attribute_hash"])
    grey[..., 0] = 0
    pictures.save(raster, grey)
    with pytest.raises(InvalidInput, match=r"raster .*colour\.png has changed"):
        lod.sweep(config, out=tmp_path / "run", progress=False)
    other = lod.sweep(config, out=tmp_path / "other", stores=tmp_path / "run" / "stores", progress=False)
    assert set(other.frames["attribute_hash"]).isdisjoint(made.frames["attribute_hash"])
    assert len(list((tmp_path / "run" / "stores").glob("chunked-*.lod"))) == 2


def test_fly_knows_its_directory_by_hashes_too(tmp_path, heights):
    store = lod.build(heights, "chunked", tmp_path / "a.lod", progress=False)
    file = tmp_path / "k.json"
    file.write_text(json.dumps({"key": [{"t": 0, "eye": [300, -1500, 3000], "target": [500, -500, 0]}]}))
    run = lod.fly(store, file, {"pixel_error": 2.0}, out=tmp_path / "run", images="none", **SMALL)
    assert (tmp_path / "run" / "paths" / "k.json").is_file() and set(run.frames["path"]) == {"paths/k.json"}
    again = lod.fly(store, file, {"pixel_error": 2.0}, out=tmp_path / "run", images="none", **SMALL)
    assert stable(again.frames).equals(stable(run.frames))
    file.write_text(json.dumps({"key": [{"t": 0, "eye": [300, -1500, 3001], "target": [500, -500, 0]}]}))
    with pytest.raises(InvalidInput, match=r"path k\.json has changed"):
        lod.fly(store, file, {"pixel_error": 2.0}, out=tmp_path / "run", images="none", **SMALL)
    other = lod.build(heights + np.float32(1), "chunked", tmp_path / "b.lod", progress=False)
    lod.fly(other, "flyover", {"pixel_error": 2.0}, out=tmp_path / "run", images="none", **SMALL)
    assert lod.Sweep.load(tmp_path / "run").frames["source_hash"].nunique() == 2


# ---- a grid that grows -----------------------------------------------------------------------------


def test_a_grid_grows_and_what_is_done_stays(tmp_path):
    small = lod.sweep(CONFIG, out=tmp_path / "run", progress=False)
    grown = {
        **CONFIG,
        "sources": [*CONFIG["sources"], "fractal:size=17,seed=4"],
        "pixel_errors": [2.0, 8.0],
        "methods": [*CONFIG["methods"][:1], {"name": "chunked", "options": {"leaf": [8, 16]}}, {"name": "seamless"}],
    }
    large = lod.sweep(grown, out=tmp_path / "run", progress=False)
    once = lod.sweep(grown, out=tmp_path / "once", stores=tmp_path / "run" / "stores", progress=False)
    assert stable(large.frames).equals(stable(once.frames))
    shared = list(stable(once.summary))
    assert set(large.summary) == set(once.summary)
    assert stable(large.summary)[shared].equals(stable(once.summary))
    assert (tmp_path / "run" / "config.toml").read_text().count("fractal:size=17") == 2 + len(["hashes"])
    kept = large.frames[large.frames["frame_ms"].isin(small.frames["frame_ms"])]
    assert len(kept) == len(small.frames) and any("leaf=8" in run for run in kept["run"])
    assert {"option.leaf", "option.rho"} <= set(large.summary.columns)
    before = (tmp_path / "run" / "frames.csv").read_bytes()
    lod.sweep(CONFIG, out=tmp_path / "run", progress=False)  # a part of what is there
    assert (tmp_path / "run" / "frames.csv").read_bytes() == before


def test_flights_and_comparisons_share_a_directory(tmp_path):
    source = CONFIG["sources"][0]
    lod.compare(source, methods=["chunked"], pixel_errors=[2.0], out=tmp_path / "run", images="none", **SMALL)
    store = lod.build(source, "chunked", tmp_path / "a.lod", progress=False)
    run = lod.fly(store, "flyover", {"pixel_error": 4.0}, out=tmp_path / "run", images="none", **SMALL)
    assert lod.Sweep.load(tmp_path / "run").runs == ["full", "chunked-px2", "chunked-px4"]
    assert run.name == "chunked-px4"
    lod.compare(source, methods=["seamless"], pixel_errors=[2.0], out=tmp_path / "run", images="none", **SMALL)
    assert "seamless-px2" in lod.Sweep.load(tmp_path / "run").runs


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"size": [64, 64]}, "size"),
        ({"accuracy_frames": 2}, "accuracy_frames: 1 there, 2 now"),
        ({"repeat": 2}, "repeat"),
    ],
)
def test_only_what_contradicts_is_refused(change, message):
    with pytest.raises(InvalidInput, match=f"another configuration .*{message}"):
        configs.grow(configs.freeze(CONFIG), configs.freeze({**CONFIG, **change}), "run")


def test_options_that_are_no_grid_together_stay_apart():
    other = {**CONFIG, "methods": [{"name": "chunked", "options": {"leaf": 16, "finest_error": 1.0}}]}
    grown = configs.grow(configs.freeze(CONFIG), configs.freeze(other), "run")
    assert [m["name"] for m in grown["methods"]] == ["full", "chunked", "chunked"]
    assert len(configs.plan(grown)) == 3


def test_frames_without_their_summary_row_are_not_believed(tmp_path):
    """What is left when a process is killed while a grid that grows renames what is done."""
    made = lod.sweep(CONFIG, out=tmp_path / "run", progress=False)
    file = tmp_path / "run" / "frames.csv"
    file.write_text(file.read_text().replace("chunked-px2", "chunked-leaf=8-px2"))
    again = lod.sweep(CONFIG, out=tmp_path / "run", progress=False)
    assert stable(again.frames).equals(stable(made.frames))


# ---- a directory that is enough --------------------------------------------------------------------


def test_a_directory_of_arrays_and_paths_in_memory_is_flown_again_from_its_configuration(
    tmp_path, heights, monkeypatch
):
    holed = heights.copy()
    holed[4:9, 7:11] = np.nan
    field = lod.HeightField(holed, spacing=(30.0, 25.0), origin=(500.0, -200.0))
    poses = lod.CameraPath.from_keys(
        [{"t": 0, "eye": [900, -900, 4000], "target": [901, -500, 0], "fov": 50}], frames=3, name="my loop"
    )
    config = {**CONFIG, "sources": ["mine"], "paths": ["loop"], "fov": 50.0}
    given = {"sources": {"mine": field}, "paths": {"loop": poses}}
    made = lod.sweep(config, out=tmp_path / "run", jobs=2, **given, progress=False)
    assert np.array_equal(np.load(tmp_path / "run" / "sources" / "mine.npy"), field.heights, equal_nan=True)
    monkeypatch.chdir(tmp_path)
    again = lod.sweep("run/config.toml", out="again", progress=False)
    assert stable(again.frames).equals(stable(made.frames))
    with pytest.raises(InvalidInput, match="neither a file"):
        lod.sweep(config, out="none", **given, keep_mb=0, progress=False)
        lod.sweep("none/config.toml", out="b", progress=False)
    damaged = np.load("run/sources/mine.npy")
    damaged[0, 0] += 1
    np.save("run/sources/mine.npy", damaged)
    with pytest.raises(StoreError, match="source mine: .* is damaged"):
        lod.sweep("run/config.toml", out="c", progress=False)


def test_stores_of_a_named_folder_are_reused_whatever_their_names(tmp_path):
    stores = tmp_path / "stores"
    stores.mkdir()
    lod.build(CONFIG["sources"][0], "chunked", stores / "my own.lod", progress=False, leaf=8)
    (stores / "no store.lod").write_text("no")
    made = lod.sweep(CONFIG, out=tmp_path / "run", stores=stores, progress=False)
    assert made.runs == ["full", "chunked-px2"]
    assert sorted(f.name.split("-")[0] for f in stores.iterdir()) == ["full", "my own.lod", "no store.lod"]
    assert not (tmp_path / "run" / "stores").exists()


# ---- what a run says of itself ---------------------------------------------------------------------


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    return lod.build(CONFIG["sources"][0], "chunked", tmp_path_factory.mktemp("id") / "a.lod", progress=False, leaf=8)


def test_a_run_that_was_not_measured_says_so(store, recwarn):
    run = lod.fly(store, "flyover", {"pixel_error": 2.0}, **{**SMALL, "accuracy_frames": 0})
    assert "not measured" in repr(run) and "nan" not in repr(run)


def test_empty_pictures_are_no_agreement(store):
    away = lod.CameraPath.from_keys([{"t": 0, "eye": [500, 900, 3000], "target": [500, 901, 9000]}], frames=3)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        run = lod.fly(store, away, {"pixel_error": 2.0}, **SMALL)
    measured = run.frames[run.frames["accuracy"]]
    assert measured[["psnr_db", "ssim", "flip", "measured_px_max"]].isna().all(axis=None)
    assert "nothing in view" in repr(run)


def test_every_face_loads_everything_first_by_default(store):
    known = {m["name"]: {o["name"]: o["default"] for o in m["options"]} for m in lod.methods()}
    assert {name: d["stream"] for name, d in known.items() if "stream" in d} == {
        name: False for name, d in known.items() if "stream" in d
    }
    rows = [lod.fly(store, "flyover", {"pixel_error": 2.0}, **SMALL) for _ in range(2)]
    assert not rows[0].frames["stream"].any() and stable(rows[0].frames).equals(stable(rows[1].frames))


def test_frames_with_stand_ins_are_warned_of_once(store):
    with pytest.warns(UserWarning, match="coarser stand-ins") as seen:
        lod.fly(store, "zoom", {"pixel_error": 0.01}, stream=True, fetch_delay_ms=200, **SMALL)
    assert sum("stand-ins" in str(w.message) for w in seen) == 1


def test_equal_builds_count_equal_bytes(tmp_path):
    field = lod.datasets.load("fractal:size=129,seed=2")
    sizes = set()
    try:
        for count in (1, 2):
            _core.set_thread_count(count)
            made = lod.build(field, "chunked", tmp_path / f"{count}.lod", progress=False, leaf=8)
            sizes.add((made.bytes, made.info()["content_hash"]))
            assert 0 < made.bytes < os.path.getsize(made.path)
    finally:
        _core.set_thread_count(0)  # as the environment says
    assert len(sizes) == 1


def test_the_report_says_with_how_many_jobs_times_were_taken(tmp_path):
    lod.sweep({**CONFIG, "methods": ["full"]}, out=tmp_path / "run", progress=False)
    page = (tmp_path / "run" / "report.html").read_text()
    assert "times taken with 1 run at a time" in page
    lod.sweep(CONFIG, out=tmp_path / "run", jobs=2, progress=False)
    assert "times taken with 1 and 2 runs at a time; runs that share the machine" in report.write(
        tmp_path / "run"
    ).read_text()  # fmt: skip


def test_hashes_of_poses_ignore_the_last_bits_and_nothing_else():
    from lodlab.paths.path import poses_hash

    def views(shift):
        return [lod.View((6.4e6 + shift, 0, 0), (0, 0, 0), up=(0, 0, 1), size=(96, 64), near=1.0)]

    assert poses_hash(views(0.0)) == poses_hash(views(1e-9))
    assert poses_hash(views(0.0)) != poses_hash(views(0.01))
    wider = [lod.View((6.4e6, 0, 0), (0, 0, 0), up=(0, 0, 1), size=(97, 64), near=1.0)]
    assert poses_hash(wider) != poses_hash(views(0.0))


def test_store_names_do_not_change_for_sources_without_colours(tmp_path):
    field = lod.datasets.load(CONFIG["sources"][0])
    resolved = _core.resolve_options("full", "build", {})
    digest = disk.short_hash({"source": field.hash(), "options": resolved})
    assert build.store_for(field, "full", {}, tmp_path, progress=False).path.name == f"full-{digest}.lod"
