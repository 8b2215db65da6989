# SPDX-License-Identifier: MIT
"""The calibration: every metric against paper, and proof that a wrong value would be noticed."""

from __future__ import annotations

import ast
import dataclasses
import importlib
import inspect
import math

import pandas as pd
import pytest

from lodlab import errors
from lodlab.instrument import METRICS, calibrate
from lodlab.instrument.calibrate import COLUMNS, all_cases, calibrate_cases
from lodlab.instrument.cases.case import Case

NAMES = [metric.name for metric in METRICS]
CASES = all_cases()


@pytest.fixture(scope="module")
def table() -> pd.DataFrame:
    return calibrate(progress=False)


def telling(metric: str) -> Case:
    """The first case in which a metric has a value to be wrong about."""
    for case in CASES:
        value = case.expected.get(metric, 0.0)
        if math.isfinite(value) and value != 0.0:
            return case
    raise AssertionError(f"no case expects {metric} to be anything but 0, nan or inf")


def failing(table: pd.DataFrame) -> str:
    return table[~table["pass"]].to_string()


def test_every_metric_returns_its_paper_values(table: pd.DataFrame) -> None:
    assert table["pass"].all(), failing(table)


def test_a_row_per_metric_and_case(table: pd.DataFrame) -> None:
    assert tuple(table.columns) == COLUMNS
    assert len(table) == sum(len(case.expected) for case in CASES)
    assert not table.duplicated(["metric", "case"]).any()
    assert list(table["metric"].unique()) == NAMES  # none without a case, in the order of the table


@pytest.mark.parametrize("metric", NAMES)
def test_no_metric_is_only_known_to_be_nothing(metric: str) -> None:
    assert telling(metric).expected[metric] > 0.0


def test_tolerances_are_a_thousandth_or_a_hundredth_of_a_pixel(table: pd.DataFrame) -> None:
    relative = table["tolerance"] / table["expected"].abs()
    counts = table["metric"].str.endswith(("_pixels", "_samples", "_edges", "_triangles"))
    finite = table["expected"].abs().between(0.0, math.inf, inclusive="neither")
    assert (table["tolerance"][counts] == 0.0).all()
    assert relative[finite & ~counts].max() <= 1e-3 * (1.0 + 1e-12)
    assert table["tolerance"].where(table["expected"] == 0.0, 0.0).max() <= 0.01


def test_an_expectation_that_is_wrong_by_one_percent_fails() -> None:
    wrong = []
    for metric in NAMES:
        case = telling(metric)
        for factor in (0.99, 1.01):
            wrong.append(dataclasses.replace(case, expected={metric: factor * case.expected[metric]}))
    rows = calibrate_cases(wrong)
    assert len(rows) == 2 * len(NAMES)
    assert not rows["pass"].any(), rows[rows["pass"]].to_string()


@pytest.mark.parametrize("value", [0.0, math.nan, math.inf])
def test_a_finite_value_is_neither_nothing_nor_undefined_nor_infinite(value: float) -> None:
    case = dataclasses.replace(telling("measured_px_max"), expected={"measured_px_max": value})
    assert not calibrate_cases([case])["pass"].any()


@pytest.mark.parametrize(("metric", "paper"), [("psnr_db", math.inf), ("pop_area", math.nan)])
def test_infinite_and_undefined_are_not_finite(metric: str, paper: float) -> None:
    case = next(c for c in CASES if metric in c.expected and repr(c.expected[metric]) == repr(paper))
    rows = calibrate_cases([case, dataclasses.replace(case, expected={metric: 40.0})])
    assert list(rows[rows["metric"] == metric]["pass"]) == [True, False]


def test_a_case_of_no_metric_is_refused() -> None:
    case = dataclasses.replace(CASES[0], expected={"sharpness": 1.0})
    with pytest.raises(errors.InvalidInput, match="expects 'sharpness', which is no metric"):
        calibrate_cases([case])


def test_progress_is_shown_when_it_is_wanted(capsys: pytest.CaptureFixture[str]) -> None:
    calibrate_cases(CASES[:1], progress=False)
    assert capsys.readouterr().err == ""
    calibrate_cases(CASES[:1], progress=True)
    assert "calibrate" in capsys.readouterr().err


@pytest.mark.parametrize("module", ["case", "cracks", "meshes", "pixels", "planet", "samples"])
def test_paper_values_come_from_paper(module: str) -> None:
    """Cases import what sources and views are made of, and the names of metrics; nothing that measures."""
    tree = ast.parse(inspect.getsource(importlib.import_module(f"lodlab.instrument.cases.{module}")))
    imported = [n for n in ast.walk(tree) if isinstance(n, ast.Import | ast.ImportFrom)]
    own = {(n.module, a.name) for n in imported if isinstance(n, ast.ImportFrom) and n.level > 0 for a in n.names}
    own = {(source, name) for source, name in own if source != "case"}
    sources = {("base", "Source"), ("heightfield", "HeightField"), ("mesh", "Mesh"), ("shapes", "icosphere")}
    made = {(f"sources.{module}", name) for module, name in sources}
    assert own <= {("_core", "View"), ("metrics", "METRICS"), *made}
    for node in imported:
        if isinstance(node, ast.Import):
            assert {alias.name for alias in node.names} <= {"math", "numpy"}
