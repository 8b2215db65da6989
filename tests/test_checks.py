# SPDX-License-Identifier: MIT
"""The gate: a real run directory, and copies of it with single figures edited by hand."""

from __future__ import annotations

import csv
import io
import math
import shutil

import pytest

import lodlab as lod
from lodlab.errors import InvalidInput
from lodlab.runs.checks import Violation, check

FRAMES = 5
MEASURED = [0, 2, 4]


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """A run of 5 frames, 3 of them measured."""
    folder = tmp_path_factory.mktemp("check")
    store = lod.build("fractal:size=65,seed=3", "chunked", folder / "a.lod", progress=False, leaf=16)
    lod.fly(
        store, "flyover", {"pixel_error": 1.0}, size=(160, 90), frames=FRAMES, accuracy_frames=3,
        images="none", out=folder / "run", progress=False, stream=False,
    )  # fmt: skip
    return folder / "run"


@pytest.fixture
def run(flown, tmp_path):
    return shutil.copytree(flown, tmp_path / "run")


def edit(run, name: str, change) -> None:
    """Rewrites a table: `change` gets its rows, dicts of texts, and changes or drops them."""
    file = run / name
    rows = list(csv.DictReader(io.StringIO(file.read_text(), newline="")))
    columns = list(rows[0])
    change(rows)
    with file.open("w", newline="") as out:
        writer = csv.DictWriter(out, columns)
        writer.writeheader()
        writer.writerows(rows)


def put(column: str, row: int, value: str):
    return lambda rows: rows[row].update({column: value})


def test_a_run_within_its_limits_passes(run):
    limits = {"measured_px_max": 1.0, "predicted_px": 1.0, "hole_samples": 0, "measured_px_max_worst": 1.0}
    assert check(run, max=limits, min={"psnr_db": 10, "budget_met": 1, "store_bytes": 1}) == []


@pytest.mark.parametrize("frame", MEASURED)
def test_a_frame_outside_is_named(run, frame):
    edit(run, "frames.csv", put("measured_px_max", frame, "1.25"))
    assert check(run, max={"measured_px_max": 1.25}) == []
    (found,) = check(run, max={"measured_px_max": 1.2})
    assert found == Violation("chunked-px1", frame, "measured_px_max", 1.25, "max", 1.2)
    assert str(found) == f"run chunked-px1, frame {frame}: measured_px_max is 1.25 (limit: at most 1.2)"


def test_frames_that_were_not_measured_count_for_accuracy_only(run):
    edit(run, "frames.csv", put("measured_px_max", 1, "99"))
    assert check(run, max={"measured_px_max": 2.0}) == []
    edit(run, "frames.csv", put("predicted_px", 1, "99"))  # known in every frame
    edit(run, "frames.csv", put("frame_ms", 3, "1e9"))
    assert [(v.column, v.frame) for v in check(run, max={"predicted_px": 1.0, "frame_ms": 1e8})] == [
        ("predicted_px", 1),
        ("frame_ms", 3),
    ]


def test_flags_count_as_numbers(run):
    edit(run, "frames.csv", put("budget_met", 4, "false"))
    (found,) = check(run, min={"budget_met": 1})
    assert (found.frame, found.value, found.bound) == (4, 0.0, "min")
    assert check(run, min={"promises_bound": 1}) == []


@pytest.mark.parametrize("value", ["nan", ""])
def test_an_undefined_figure_passes_no_gate(run, value):
    edit(run, "frames.csv", put("measured_px_max", 2, value))
    (found,) = check(run, max={"measured_px_max": 9.0})
    assert found.frame == 2 and math.isnan(found.value)
    assert "frame 2: measured_px_max is nan (limit: at most 9)" in str(found)
    edit(run, "summary.csv", put("psnr_db_worst", 0, value))
    assert [(v.run, v.frame, v.column) for v in check(run, min={"psnr_db_worst": 0.0})] == [
        ("chunked-px1", None, "psnr_db_worst")
    ]


def test_infinite_figures(run):
    edit(run, "frames.csv", put("psnr_db", 0, "inf"))
    assert check(run, min={"psnr_db": 1.0}) == []
    edit(run, "frames.csv", put("measured_px_max", 0, "inf"))
    assert [v.value for v in check(run, max={"measured_px_max": 1e300})] == [math.inf]


def test_figures_of_a_run(run):
    edit(run, "summary.csv", put("triangles_median", 0, "1001"))
    (found,) = check(run, max={"triangles_median": 1000})
    assert (found.run, found.frame, found.value) == ("chunked-px1", None, 1001.0)


def test_a_run_that_was_not_measured_is_missing(run):
    def nothing_measured(rows):
        for row in rows:
            row.update(accuracy="false")

    edit(run, "frames.csv", nothing_measured)
    (found,) = check(run, max={"measured_px_max": 9.0})
    assert found.missing and found.frame is None
    assert "measured_px_max is missing" in str(found)
    edit(run, "summary.csv", put("accuracy_frames", 0, "0"))
    assert check(run, max={"measured_px_max": 9.0}) == [found]


@pytest.mark.parametrize(("column", "row"), [("frame_ms", 1), ("measured_px_max", 2)])
def test_a_frame_that_is_gone_is_missing(run, column, row):
    edit(run, "frames.csv", lambda rows: rows.pop(row))
    (found,) = check(run, max={column: 1e9})
    assert found.missing and found.column == column


def test_a_run_that_never_ended_is_missing(run):
    config = run / "config.toml"
    text = config.read_text()
    assert text.count("pixel_errors = [") == 1
    config.write_text(text.replace("pixel_errors = [", "pixel_errors = [2.0,"))
    (found,) = check(run, max={"frame_ms": 1e9})
    assert found.missing and found.run == "chunked-px2"


def test_pops_are_undefined_in_the_first_frame_alone(run):
    edit(run, "frames.csv", put("pop_px_max", 0, "nan"))
    assert check(run, max={"pop_px_max": 1e9}) == []
    edit(run, "frames.csv", put("pop_px_max", 2, "nan"))
    assert [v.frame for v in check(run, max={"pop_px_max": 1e9})] == [2]


@pytest.mark.parametrize(
    ("wrong", "meant"),
    [("frame_sm", "frame_ms"), ("mesured_px_max", "measured_px_max"), ("measured_px", "measured_px_max"),
     ("PSNR", "psnr_db"), ("cracks", "crack_edges"), ("triangle_median", "triangles_median"), ("worst", "_worst")],
)  # fmt: skip
def test_a_wrong_column_gets_close_ones_and_not_all(run, wrong, meant):
    with pytest.raises(InvalidInput, match=f"no column '{wrong}' to limit; close to it: .*{meant}") as refused:
        check(run, max={wrong: 1})
    assert len(str(refused.value)) < 300
    with pytest.raises(InvalidInput, match="no column 'zzz' to limit; there are .*frame_ms.*measured_px_max.*store_b"):
        check(run, max={"zzz": 1})


def test_what_is_no_question(run, tmp_path):
    with pytest.raises(InvalidInput, match="no limits"):
        check(run)
    for bad in (math.nan, "low", None):
        with pytest.raises(InvalidInput, match="the max of frame_ms is .*, no number"):
            check(run, max={"frame_ms": bad})
    for unknown in ("run", "frame", "accuracy", "gpu_clock"):
        with pytest.raises(InvalidInput, match=f"no column '{unknown}' to limit; (there are|close to it)"):
            check(run, min={unknown: 1})
    with pytest.raises(InvalidInput, match="no directory"):
        check(tmp_path / "nowhere", max={"frame_ms": 1})
    (tmp_path / "empty").mkdir()
    with pytest.raises(InvalidInput, match="no file .*frames.csv"):
        check(tmp_path / "empty", max={"frame_ms": 1})
    edit(run, "summary.csv", lambda rows: rows.clear())
    with pytest.raises(InvalidInput, match="holds no finished run"):
        check(run, max={"frame_ms": 1})
