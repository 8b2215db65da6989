# SPDX-License-Identifier: MIT
"""Notebooks carry no outputs, run from beginning to end at small scale, and leave their page and table."""

from __future__ import annotations

import csv
import importlib.util
import json
import math
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))
QUANTITIES = {
    "chunked": {"bytes per output vertex", "bytes per sample", "D_min", "T_g", "largest screen error"},
    "multigrain": {
        "samples per second",
        "hierarchy bytes per sample",
        "triangles per second, least",
        "throughput, loading / loaded",
        "adapt time, mean",
        "draw time, whole path",
        "screen error, mean",
    },
    "seamless": {"triangles", "traversed", "rendered", "culled", "CPU", "GPU", "crack edges", "beyond prediction"},
    "subdivision": {
        "store / plain arrays",
        "bytes a triangle",
        "build time",
        "average distance",
        "measured error",
        "processed / rendered",
        "frame time",
        "bound / measured, median",
        "root mean square error",
    },
}
COLUMNS = "paper,table,row,quantity,unit,paper_value,our_value,source,method,options,device,scale".split(",")


def runner():
    spec = importlib.util.spec_from_file_location("run_notebooks", ROOT / "scripts" / "run_notebooks.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as file:
        reader = csv.DictReader(file)
        assert reader.fieldnames == COLUMNS
        return list(reader)


def test_there_is_a_notebook_for_each_paper():
    assert [p.name for p in NOTEBOOKS] == [f"{name}.ipynb" for name in QUANTITIES]


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda p: p.stem)
def test_notebook_is_kept_without_outputs(notebook):
    for cell in json.loads(notebook.read_text(encoding="utf-8"))["cells"]:
        if cell["cell_type"] == "code":
            assert cell["outputs"] == [] and cell["execution_count"] is None


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda p: p.stem)
def test_notebook_runs_at_small_scale(notebook, tmp_path, monkeypatch):
    monkeypatch.setenv("LODLAB_SCALE", "small")
    page = runner().run(notebook, tmp_path)
    assert "Traceback" not in page.read_text(encoding="utf-8")
    rows = rows_of(page.with_suffix(".csv"))
    quantities = {row["quantity"] for row in rows}
    assert QUANTITIES[notebook.stem] <= quantities
    for row in rows:
        assert row["scale"] == "small" and row["method"] == notebook.stem
        assert math.isfinite(float(row["our_value"])), row


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda p: p.stem)
def test_results_at_full_scale_are_kept(notebook):
    rows = rows_of(ROOT / "docs" / "results" / f"{notebook.stem}.csv")
    assert rows
    assert {row["scale"] for row in rows} == {"full"}
