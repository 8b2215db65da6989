# SPDX-License-Identifier: MIT
"""Run directories whose files were cut off or changed: nothing is read as if it were whole."""

from __future__ import annotations

import csv
import shutil

import pytest

import lodlab as lod
from lodlab.errors import StoreError

CONFIG = {
    "sources": ["fractal:size=33"], "paths": ["still"], "frames": 3, "size": [48, 32], "accuracy_frames": 1,
    "metrics": "geometry", "images": "none", "methods": [{"name": "chunked", "pixel_errors": [1, 2]}],
}  # fmt: skip
TABLES = ("frames.csv", "summary.csv")


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder = tmp_path_factory.mktemp("damage") / "run"
    lod.sweep(CONFIG, out=folder, progress=False)
    return folder


@pytest.fixture
def run(whole, tmp_path):
    return shutil.copytree(whole, tmp_path / "run")


def refused(run, message):
    """Both readers refuse it."""
    with pytest.raises(StoreError, match=message):
        lod.check(run, max={"frame_ms": 1e9})
    with pytest.raises(StoreError, match=message):
        lod.report.write(run)


def change(file, edit):
    """Writes a table's rows as `edit` leaves them."""
    with file.open(newline="") as opened:
        rows = list(csv.reader(opened))
    edit(rows)
    with file.open("w", newline="") as opened:
        csv.writer(opened).writerows(rows)


@pytest.mark.parametrize("table", TABLES)
@pytest.mark.parametrize("share", [0.0, 0.6, 0.75, 0.99])
def test_a_table_that_is_cut_off_is_refused_and_a_sweep_mends_it(run, table, share):
    data = (run / table).read_bytes()
    (run / table).write_bytes(data[: int(share * len(data))])
    refused(run, rf"{table} is damaged.* \(?(it is empty|row \d has \d+ of \d+ cells|its last row).*flies again")
    lod.sweep(run / "config.toml", out=run, progress=False)
    assert lod.check(run, max={"frame_ms": 1e9}) == []


@pytest.mark.parametrize("table", TABLES)
def test_a_table_without_the_end_of_its_last_row_is_refused(run, table):
    data = (run / table).read_bytes()
    assert data.endswith(b"\r\n")
    (run / table).write_bytes(data[:-2])  # nothing says that the last cell is whole
    refused(run, "its last row, [26], is cut off")


def test_rows_that_are_gone_are_missed(run):
    data = (run / "frames.csv").read_bytes().splitlines(keepends=True)
    for left, count in ((data[:-1], 2), (data[:1], 0)):
        (run / "frames.csv").write_bytes(b"".join(left))
        assert "chunked-px2" in {v.run for v in lod.check(run, max={"frame_ms": 1e9}) if v.missing}
        with pytest.raises(StoreError, match=f"run chunked-px[12] has {count} of 3 frames"):
            lod.report.write(run)


@pytest.mark.parametrize(
    ("table", "column"), [("frames.csv", "run"), ("frames.csv", "pop_area"), ("summary.csv", "frames")]
)
def test_a_missing_column_is_named(run, table, column):
    def drop(rows):
        at = rows[0].index(column)
        rows[:] = [row[:at] + row[at + 1 :] for row in rows]

    change(run / table, drop)
    refused(run, f"{table} is damaged, or of another version: it has no column {column}")


@pytest.mark.parametrize("table", TABLES)
@pytest.mark.parametrize(("column", "kind"), [("budget_pixel_error", "number"), ("budget_met", "flag")])
def test_a_cell_of_another_kind_is_named(run, table, column, kind):
    def spoil(rows):
        rows[1][rows[0].index(column)] = "maybe"

    change(run / table, spoil)
    refused(run, f"column {column} holds what is no {kind}")


def test_bytes_that_are_no_table_are_refused_by_sweeps_too(run):
    for table in TABLES:
        saved = (run / table).read_bytes()
        (run / table).write_bytes(bytes(range(256)))
        refused(run, f"{table} is damaged.*no table")
        with pytest.raises(StoreError, match="no table"):
            lod.sweep(run / "config.toml", out=run, progress=False)
        (run / table).write_bytes(saved)


@pytest.mark.parametrize("name", ["provenance.json", "noise.csv"])
def test_what_the_runs_can_do_without_is_named(run, name):
    data = (run / name).read_bytes()
    (run / name).write_bytes(data[: len(data) // 2])
    with pytest.raises(StoreError, match=rf"{name} is damaged.*without it"):
        lod.report.write(run)
    (run / name).unlink()
    lod.report.write(run)


def test_a_configuration_that_is_cut_off_within_its_options_is_continued(run):
    text = (run / "config.toml").read_text()
    assert "projection" in text
    (run / "config.toml").write_text(text[: text.index("projection")])
    lod.sweep(CONFIG, out=run, progress=False)
    assert (run / "config.toml").read_text() == text
