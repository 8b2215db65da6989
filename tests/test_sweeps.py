# SPDX-License-Identifier: MIT
"""Comparisons and sweeps: the grid, the run directory, resuming, worker processes."""

from __future__ import annotations

import csv
import random
import signal
import subprocess
import sys
import time
import tomllib
from pathlib import Path

import numpy as np
import pytest

import lodlab as lod
from lodlab import lab
from lodlab.errors import InvalidInput, StoreError, Unsupported
from lodlab.runs import configs, directory, tables, toml
from lodlab.stores import methods

pytestmark = pytest.mark.usefixtures("unrendered")

SOURCE = "fractal:size=65,seed=3"
CONFIG = {
    "sources": [SOURCE],
    "frames": 5,
    "size": [96, 64],
    "accuracy_frames": 2,
    "pixel_errors": [1.0, 4.0],
    "methods": [{"name": "full"}, {"name": "chunked", "options": {"leaf": 16, "chunk_triangles": 128}}],
}
# What differs from one run of a computer program to the next.
TIMES = [*tables.TIME_COLUMNS]


def stable(frames):
    return frames.drop(columns=TIMES)


def stable_summary(summary):
    times = [f"{c}_{s}" for c in TIMES for s in ("median", "p95", "p99", "median_low", "median_high")]
    return summary.drop(columns=[*times, "build_seconds", "store_bytes"])


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    return lod.sweep(CONFIG, out=tmp_path_factory.mktemp("sweep") / "run", progress=False)


def test_runs_and_rows_stand_in_the_order_of_the_configuration(swept):
    assert swept.runs == ["full", "chunked-px1", "chunked-px4"]
    assert swept.frames["run"].tolist() == [name for name in swept.runs for _ in range(5)]
    assert tuple(swept.frames.columns) == tables.FRAME_COLUMNS
    columns = tuple(swept.summary.columns)
    assert columns[: len(tables.SUMMARY_COLUMNS)] == tables.SUMMARY_COLUMNS
    assert {"option.leaf", "option.morph"} <= set(columns[len(tables.SUMMARY_COLUMNS) :])
    assert (swept.summary["store_bytes"] > 0).all() and (swept.summary["build_seconds"] >= 0).all()
    assert not swept.frames["stream"].any(), "sweeps load everything first, so that their rows repeat"


def test_files_hold_the_spellings_of_the_interface(swept):
    lines = (swept.directory / "frames.csv").read_text().splitlines()
    assert lines[0] == ",".join(tables.FRAME_COLUMNS)
    full = dict(zip(tables.FRAME_COLUMNS, next(csv.reader([lines[1]])), strict=True))
    assert full["budget_met"] == "true" and full["stream"] == "false" and full["budget_pixel_error"] == ""
    assert full["accuracy"] == "true" and full["psnr_db"] == "inf"
    unmeasured = dict(zip(tables.FRAME_COLUMNS, next(csv.reader([lines[2]])), strict=True))
    assert unmeasured["accuracy"] == "false" and unmeasured["measured_px_max"] == "nan"
    chunked = swept.frames[swept.frames["method"] == "chunked"]["options"].iloc[0]
    assert chunked.startswith("{") and ": " not in chunked and '"stream":false' in chunked


def test_frozen_configuration_repeats_the_run(swept, tmp_path):
    again = lod.sweep(swept.directory / "config.toml", out=tmp_path / "again", progress=False)
    assert stable(again.frames).equals(stable(swept.frames))
    assert (tmp_path / "again" / "config.toml").read_bytes() == (swept.directory / "config.toml").read_bytes()


def test_a_sweep_of_geometry_says_so_in_its_configuration(tmp_path):
    small = CONFIG | {"methods": CONFIG["methods"][1:], "pixel_errors": [4.0], "frames": 2}
    result = lod.sweep(small, metrics="geometry", out=tmp_path / "run", progress=False)
    assert tomllib.loads((tmp_path / "run" / "config.toml").read_text())["metrics"] == "geometry"
    assert result.frames["flip"].isna().all() and result.frames["measured_px_max"].notna().all()
    assert [file.name.split("-")[0] for file in (tmp_path / "run" / "stores").iterdir()] == ["chunked"]


def test_jobs_give_the_same_rows(swept, tmp_path):
    side_by_side = lod.sweep(CONFIG, out=tmp_path / "jobs", jobs=2, progress=False)
    assert stable(side_by_side.frames).equals(stable(swept.frames))
    assert stable_summary(side_by_side.summary).equals(stable_summary(swept.summary))


def test_jobs_take_sources_in_memory(field_array, tmp_path):
    kept = {**CONFIG, "sources": ["mine"], "pixel_errors": [2.0]}
    one = lod.sweep(kept, out=tmp_path / "a", sources={"mine": field_array}, progress=False)
    two = lod.sweep(kept, out=tmp_path / "b", sources={"mine": field_array}, jobs=2, progress=False)
    assert stable(two.frames).equals(stable(one.frames))


@pytest.fixture(scope="module")
def field_array():
    return np.asarray(lod.datasets.load(SOURCE).heights)


def test_finished_sweep_is_read_not_repeated(swept):
    before = (swept.directory / "frames.csv").stat().st_mtime_ns
    again = lod.sweep(CONFIG, out=swept.directory, progress=False)
    assert (swept.directory / "frames.csv").stat().st_mtime_ns == before
    assert again.frames.equals(swept.frames)


def test_another_configuration_in_the_directory_is_refused(swept):
    with pytest.raises(InvalidInput, match="another configuration .*frames: 5 there, 6 now"):
        lod.sweep({**CONFIG, "frames": 6}, out=swept.directory, progress=False)


def test_a_configuration_that_failed_before_its_first_run_may_be_mended(tmp_path):
    with pytest.raises(InvalidInput, match="size 0 x 0"):
        lod.sweep({**CONFIG, "size": [0, 0]}, out=tmp_path, progress=False)
    mended = {**CONFIG, "methods": [{"name": "full"}], "frames": 2, "accuracy_frames": 0}
    assert lod.sweep(mended, out=tmp_path, progress=False).runs


@pytest.mark.parametrize("wrong", [{"methods": [3]}, {"paths": 3}, {"methods": [{"name": "full", "options": 3}]}])
def test_values_of_another_kind_are_named(wrong):
    with pytest.raises(InvalidInput, match="3"):
        configs.freeze({**CONFIG, **wrong})


def test_half_written_rows_are_dropped_and_the_run_repeated(swept, tmp_path):
    """What a killed process leaves: frames without their summary, and a line that was cut off."""
    out = tmp_path / "cut"
    out.mkdir()
    (out / "config.toml").write_bytes((swept.directory / "config.toml").read_bytes())
    frames = (swept.directory / "frames.csv").read_bytes()
    summary = (swept.directory / "summary.csv").read_bytes().splitlines(keepends=True)
    (out / "frames.csv").write_bytes(frames[: int(len(frames) * 0.8)])
    (out / "summary.csv").write_bytes(b"".join(summary[:2]) + summary[2][:40])
    again = lod.sweep(CONFIG, out=out, progress=False)
    assert stable(again.frames).equals(stable(swept.frames))


def test_killed_sweeps_end_with_the_same_rows(swept, tmp_path):
    rng = random.Random(7)
    out = tmp_path / "killed"
    config = tmp_path / "config.toml"
    config.write_text(toml.toml_text(configs.freeze(CONFIG)))
    command = [sys.executable, "-m", "lodlab", "sweep", str(config), "--out", str(out)]
    killed = 0
    for _ in range(5):
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            process.wait(timeout=rng.uniform(0.5, 4.0))
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGKILL)
            killed += 1
        process.wait()
    assert killed, "no kill came in time to matter"
    last = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert last.returncode == 0, last.stderr
    again = lod.Sweep.load(out)
    assert stable(again.frames).equals(stable(swept.frames))
    assert stable_summary(again.summary).equals(stable_summary(swept.summary))
    assert again.noise["column"].tolist() == list(tables.TIME_COLUMNS), "the null comparison is made at the end"
    assert not list(out.glob(".*.tmp")) or (out / "report.html").exists()


def test_workers_end_with_a_killed_parent(tmp_path):
    config = tmp_path / "config.toml"
    config.write_text(toml.toml_text({**configs.freeze(CONFIG), "frames": 2000}))
    command = [sys.executable, "-m", "lodlab", "sweep", str(config), "--out", str(tmp_path / "out"), "--jobs", "2"]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        workers = wait_for(lambda: spawned_by(process.pid), 60)
        assert workers, "no worker was spawned"
    finally:
        process.kill()
        process.wait()
    assert wait_for(lambda: not any(alive(pid) for pid in workers), 30), "workers outlived their parent"


def wait_for(found, seconds):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        value = found()
        if value:
            return value
        time.sleep(0.1)
    return found()


def alive(pid):
    try:
        with open(f"/proc/{pid}/stat") as file:
            return file.read().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def spawned_by(parent):
    found = []
    for entry in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = entry.read_text().rpartition(")")[2].split()
            command = entry.with_name("cmdline").read_bytes()
        except (FileNotFoundError, ProcessLookupError):
            continue
        if int(fields[1]) == parent and b"spawn_main" in command:
            found.append(int(entry.parent.name))
    return found


def test_ctrl_c_keeps_what_was_finished(tmp_path):
    config = tmp_path / "config.toml"
    config.write_text(toml.toml_text({**configs.freeze(CONFIG), "frames": 400}))
    out = tmp_path / "out"
    command = [sys.executable, "-m", "lodlab", "sweep", str(config), "--out", str(out)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    summary = out / "summary.csv"
    assert wait_for(lambda: summary.exists() and summary.read_text().count("\n") > 1, 120)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "stopped" in errors and "Traceback" not in errors
    assert "full" in lod.Sweep.load(out).runs


def test_two_writers_are_refused(swept):
    with directory.RunDirectory(swept.directory):
        with pytest.raises(StoreError, match="another process"):
            lod.sweep(CONFIG, out=swept.directory, progress=False)


def test_compare_flies_every_method_that_can_and_full(field_array):
    result = lod.compare(field_array, pixel_errors=[2.0], frames=3, size=(96, 64), accuracy_frames=1, progress=False)
    able = [m["name"] for m in lod.methods() if "heightfield" in m["accepts"]]
    assert result.summary["method"].tolist() == able
    assert result.directory.exists() and len(result.run(result.runs[0]).frames) == 3


def test_compare_takes_a_path_in_memory(field_array):
    field = lod.HeightField(field_array)
    path = lod.CameraPath.orbit(field, frames=4)
    result = lod.compare(field, pixel_errors=[2.0], path=path, size=(96, 64), accuracy_frames=1, progress=False)
    assert set(result.frames["path"]) == {"orbit"} and result.frames["frame"].max() == 3


def test_methods_that_do_not_accept_a_source_are_refused_by_name(field_array):
    planet = lod.HeightField(field_array, planet=True)
    refusing = next(m["name"] for m in lod.methods() if "planet" not in m["accepts"])
    with pytest.raises(Unsupported, match=f"{refusing} does not accept a planet"):
        lod.compare(planet, methods=[refusing], frames=2, size=(64, 64), progress=False)
    fine = lod.compare(planet, frames=2, size=(64, 64), accuracy_frames=1, progress=False)
    assert refusing not in set(fine.summary["method"])


def test_compare_leaves_out_and_names_what_needs_another_mesh(monkeypatch):
    fault = "method discrete needs a closed mesh: this one has 3 edges of one triangle"
    monkeypatch.setattr(methods, "lacking", lambda source, method: fault if method == "discrete" else "")
    monkeypatch.setattr(lab, "lacking", methods.lacking)
    few = {"pixel_errors": [2.0], "frames": 2, "size": (64, 64), "accuracy_frames": 1, "progress": False}
    with pytest.warns(UserWarning, match=f"left out: {fault}"):
        result = lod.compare("icosphere:level=2", **few)
    assert "full" in set(result.summary["method"]) and "discrete" not in set(result.summary["method"])
    with pytest.raises(InvalidInput, match=fault):
        lod.compare("icosphere:level=2", methods=["discrete"], **few)


def test_option_grids_name_their_runs_by_what_varies():
    config = configs.freeze(
        {
            **CONFIG,
            "paths": ["flyover", "orbit"],
            "pixel_errors": [1.0],
            "methods": [{"name": "chunked", "options": {"morph": ["true", "false"], "finest_error": 0.5}}],
        }
    )
    names = [task.flight.name for task in configs.plan(config)]
    assert names == [
        "flyover-chunked-morph=true-px1",
        "flyover-chunked-morph=false-px1",
        "orbit-chunked-morph=true-px1",
        "orbit-chunked-morph=false-px1",
    ]
    assert config["methods"][0]["options"]["finest_error"] == 0.5
    assert configs.freeze(config) == config, "freezing twice changes nothing"


def test_several_kinds_of_budget_are_combined():
    config = configs.freeze({**CONFIG, "pixel_errors": [1.0, 2.0], "triangles": [500, 900]})
    budgets = [task.flight.budget for task in configs.plan(config) if task.method == "chunked"]
    assert budgets == [
        {"pixel_error": p, "triangles": t} for p in (1.0, 2.0) for t in (500, 900)
    ]  # fmt: skip
    assert sum(task.method == "full" for task in configs.plan(config)) == 1


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"frmaes": 3}, "no key 'frmaes'; it has sources"),
        ({"frames": 0}, "frames is 0"),
        ({"frames": 2.5}, "frames is 2.5; it is int"),
        ({"images": "some"}, "images is 'some'"),
        ({"size": [64]}, "size is"),
        ({"pixel_errors": [0]}, "pixel_errors holds 0"),
        ({"pixel_errors": []}, "none set"),
        ({"sources": []}, "at least one"),
        ({"sources": ["a", "a"]}, "twice"),
        ({"methods": []}, "no methods"),
        ({"methods": [{"name": "chunky"}]}, "'chunky' is not known; there are full, chunked"),
        ({"methods": [{"name": "chunked", "options": {"morf": 1}}]}, "no option 'morf'; it has"),
        ({"methods": [{"name": "chunked", "options": {"finest_error": -1}}]}, "finest_error"),
        ({"methods": [{"name": "chunked", "options": {"finest_error": []}}]}, "empty list"),
        ({"methods": [{"options": {}}]}, "no name"),
    ],
)
def test_mistakes_in_configurations_are_named(change, message):
    with pytest.raises(InvalidInput, match=message.replace("[", r"\[")):
        configs.freeze({**CONFIG, **change})


def test_mistakes_are_found_before_anything_is_built(tmp_path):
    for change in ({"sources": ["no-such-place"]}, {"paths": ["loop"]}, {"size": [0, 64]}):
        out = tmp_path / str(next(iter(change)))
        with pytest.raises(InvalidInput):
            lod.sweep({**CONFIG, **change}, out=out, progress=False)
        assert not (out / "stores").exists()
    with pytest.raises(InvalidInput, match="not valid TOML"):
        broken = tmp_path / "broken.toml"
        broken.write_text("sources = [")
        lod.sweep(broken, out=tmp_path / "x", progress=False)
    with pytest.raises(InvalidInput, match="jobs is 0"):
        lod.sweep(CONFIG, out=tmp_path / "y", jobs=0, progress=False)


def test_runs_made_one_by_one_become_a_sweep(field_array, tmp_path):
    field = lod.HeightField(field_array)
    path = lod.CameraPath.flyover(field, frames=3)
    store = lod.build(field, "chunked", tmp_path / "a.lod", progress=False)
    small = {"size": (96, 64), "accuracy_frames": 2, "progress": False}
    runs = [lod.fly(store, path, {"pixel_error": p}, **small) for p in (1.0, 4.0)]
    both = lod.sweep(runs)
    assert both.runs == ["chunked-px1", "chunked-px4"] and len(both.frames) == 6
    assert lod.charts.pareto(both).figure().axes
    with pytest.raises(InvalidInput, match="list holds runs"):
        lod.sweep([1])


def test_toml_reads_back_what_was_written():
    config = {
        "a": [1, 2.5, "x\"y\\z é\n"], "b": True, "c": -0.0, "d": float("inf"), "gone": None,
        "t": {"k": "v"}, "methods": [{"name": "m", "options": {"e": 0.25, "f": []}}, {"name": "n"}],
    }  # fmt: skip
    back = tomllib.loads(toml.toml_text(config))
    del config["gone"]
    assert back == config
