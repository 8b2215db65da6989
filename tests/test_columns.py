# SPDX-License-Identifier: MIT
"""The sentences of the result columns: that every column has one, and that all who show them show the same."""

from __future__ import annotations

import html
import re
from pathlib import Path

import pytest

from lodlab import cli
from lodlab.report import page
from lodlab.runs import columns, tables

PAGE = Path(__file__).parent.parent / "docs" / "columns.md"


@pytest.mark.parametrize("name", dict.fromkeys((*tables.FRAME_COLUMNS, *tables.SUMMARY_COLUMNS)))
def test_no_column_without_unit_and_sentence(name):
    column = columns.describe(name)
    assert column.name == name and column.unit and column.text.endswith("."), "add it to python/lodlab/runs/columns.py"


def test_columns_that_are_none_have_no_sentence():
    for name in ("", "frame_sm", "triangles_worst_median", "frames_median", "_worst", "run_ms"):
        with pytest.raises(KeyError):
            columns.describe(name)


def test_sentences_of_a_run_say_over_what_and_which_end():
    assert columns.describe("frame_ms_p95").text.endswith("95th percentile over the frames.")
    assert columns.describe("psnr_db_worst").text.endswith("Smallest over the measured frames.")
    assert columns.describe("measured_px_max_worst").text.endswith("Largest over the measured frames.")
    assert columns.describe("predicted_px_worst").text.endswith("Largest over the frames.")  # known in every frame
    assert columns.describe("gpu_ms_median_low").text.endswith("of the median, over frames and timing passes.")


def test_page_of_columns_is_current():
    wanted = columns.markdown()
    assert PAGE.read_text(encoding="utf-8") == wanted, "the head of runs/columns.py says how it is written"
    named = set(re.findall(r"^\| `(\w+)`", wanted, re.MULTILINE))
    assert named >= {*tables.FRAME_COLUMNS, *tables.NOISE_COLUMNS}
    for name in tables.SUMMARY_COLUMNS:
        assert name in named or any(name.endswith(end) and name.removesuffix(end) in named for end in named)


def test_tables_of_the_report_say_what_their_columns_are():
    import pandas as pd

    summary = pd.DataFrame([dict.fromkeys(tables.SUMMARY_COLUMNS, 1.0)])
    heads = dict(re.findall(r'<th title="(\w+)([^"]*)">', page.summary_table(summary)))
    assert list(heads) == [name for name, _, _ in page.COLUMNS]
    for name, rest in heads.items():
        assert html.unescape(rest).endswith(columns.describe(name).text)


def test_help_of_check_says_what_columns_are(capsys):
    assert cli.run(["check", "--help"]) == 0
    out = capsys.readouterr().out
    text = " ".join(out.split())
    for part in (columns.COSTS, columns.ACCURACY, columns.OF_RUNS):
        for column in part:
            assert re.search(rf"\b{column.name} (\[{column.unit}\] )?{re.escape(column.text)}", text), column
    for name in ("budget_met", "promises_bound", "stream", "filler_triangles"):
        assert columns.describe(name).text in text
    assert max(map(len, out.splitlines())) <= 80
