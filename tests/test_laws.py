# SPDX-License-Identifier: MIT
"""The table of laws: each breaks on exactly the rows that break it, and names the first of them."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

import lodlab as lod
from lodlab import _core, laws

GOOD = {
    "run": "a",
    "method": "chunked",
    "path": "still",
    "budget_pixel_error": 2.0,
    "budget_triangles": 100.0,
    "budget_nodes": 10.0,
    "budget_met": True,
    "promises_bound": True,
    "accuracy": True,
    "triangles": 100,
    "nodes": 10,
    "predicted_px": 2.0,
    "measured_px_max": 1.5,
    "hole_samples": 0,
    "crack_edges": 0,
    "crack_pixels": 0.0,
    "capture_mismatch_pixels": 0.0,
    "inverted_triangles": 0,
    "slanted_filler_triangles": 0,
    "raised_filler_triangles": 0,
    "drawn_triangles": 100.0,
    "pop_px_max": 0.0,
}


def rows(**changes):
    """Five frames of a run that keeps every law, but for frame 3 and on."""
    frames = pd.DataFrame([{**GOOD, "frame": f} for f in range(5)])
    frames.loc[0, "pop_px_max"] = np.nan
    for column, value in changes.items():
        frames[column] = frames[column].astype(type(value))
        frames.loc[3:, column] = value
    return frames


def verdicts(frames):
    return {v.law: v.verdict for v in laws.judge(frames)}


def test_every_law_holds_where_nothing_is_wrong():
    found = verdicts(rows())
    assert set(found) == {law.name for law in laws.LAWS} - {"baseline"}
    assert set(found.values()) == {"holds"}
    assert set(verdicts(rows(method="full")).values()) == {"broken", "holds"}, "full measures nothing"


@pytest.mark.parametrize(
    ("law", "column", "value", "text"),
    [
        ("error", "measured_px_max", 2.1, "2.10 over 2.00 px"),
        ("error", "measured_px_max", np.inf, "∞ over"),
        ("budgets", "nodes", 11, "11 nodes"),
        ("pixel_error", "budget_pixel_error", 1.999, "2.00 px predicted under 2.00 px"),
        ("capture", "capture_mismatch_pixels", 7.0, "7 pixels differ"),
        ("holes", "hole_samples", 3, "3 samples uncovered"),
        ("winding", "inverted_triangles", 4, "4 triangles inverted"),
        ("fillers", "slanted_filler_triangles", 2, "2 fillers slant"),
        ("raised", "raised_filler_triangles", 2, "2 fillers rise"),
        ("counts", "drawn_triangles", 101.0, "100 reported, 101 counted"),
        ("still", "pop_px_max", 0.5, "still jumps by 0.500 px"),
    ],
)
def test_a_law_breaks_alone_and_says_where(law, column, value, text):
    frames = rows(**{column: value})
    broken = [v for v in laws.judge(frames) if v.verdict == "broken"]
    assert [v.law for v in broken] == [law]
    assert text in broken[0].sentence and f"frame {4 if law == 'still' else 3}" in broken[0].sentence
    assert law not in {v.law for v in laws.judge(frames.iloc[:3]) if v.verdict == "broken"}


def test_a_budget_of_triangles_breaks_too():
    frames = rows(triangles=101)
    frames.loc[3:, "drawn_triangles"] = 101.0
    broken = [v for v in laws.judge(frames) if v.verdict == "broken"]
    assert [v.law for v in broken] == ["budgets"] and "101 triangles" in broken[0].sentence


def test_the_slack_is_a_hundredth_of_a_pixel():
    assert verdicts(rows(measured_px_max=2.0100))["error"] == "holds"
    assert verdicts(rows(measured_px_max=2.0106))["error"] == "broken"


def test_a_claim_that_is_no_number_is_no_promise_kept():
    found = verdicts(rows(predicted_px=np.nan))
    assert found["error"] == found["pixel_error"] == "broken"


@pytest.mark.parametrize(
    ("column", "law"), [("triangles", "budgets"), ("nodes", "budgets"), ("predicted_px", "pixel_error")]
)
def test_a_budget_missed_openly_is_neither_held_nor_broken(column, law):
    frames = rows(**{column: 1000.0 if column == "predicted_px" else 1000})
    frames.loc[3:, "budget_met"] = False
    frames["drawn_triangles"] = frames["triangles"]
    found = {v.law: v for v in laws.judge(frames)}
    other = {"budgets", "pixel_error"} - {law}
    assert found[law].verdict == found["met"].verdict == "missed" and found[other.pop()].verdict == "holds"
    assert "missed openly in 2 of 5 frames" in found[law].sentence and "first in a, frame 3" in found[law].sentence
    frames.loc[4, "budget_met"] = True
    assert verdicts(frames)[law] == "broken"


@pytest.mark.parametrize("law", ["capture", "holes", "winding", "fillers", "raised"])
def test_what_is_nan_does_not_hold(law):
    column = next(entry.columns[0] for entry in laws.LAWS if entry.name == law)
    frames = rows(**{column: np.nan})
    (some,) = [v for v in laws.judge(frames) if v.law == law]
    assert some.verdict == "holds" and f"(3 frames; {column} was not decided in 2)" in some.sentence
    frames[column] = np.nan
    (none,) = [v for v in laws.judge(frames) if v.law == law]
    assert none.verdict == "open" and "not decided" in none.sentence
    frames[column] = np.inf
    assert verdicts(frames)[law] == "broken"


def test_cracks_that_were_not_decided_are_not_none():
    frames = rows(crack_pixels=np.nan)
    (some,) = [v for v in laws.judge(frames) if v.law == "cracks"]
    assert some.verdict == "holds" and "(3 frames; crack_pixels was not decided in 2)" in some.sentence
    frames["crack_pixels"] = np.nan
    assert verdicts(frames)["cracks"] == "open"


def test_a_baseline_that_was_not_looked_at_does_not_measure_zero():
    frames = rows()
    frames[["method", "measured_px_max", "crack_pixels"]] = ["full", 0.0, np.nan]
    (some,) = [v for v in laws.judge(frames) if v.law == "baseline"]
    assert some.verdict == "holds" and "crack_pixels not decided" in some.sentence
    assert "no crack pixels" not in some.sentence
    frames["measured_px_max"] = np.nan
    assert verdicts(frames)["baseline"] == "open"


def test_the_slack_is_the_cores(monkeypatch):
    monkeypatch.setattr(_core, "SLACK_PIXELS", 0.2)
    assert verdicts(rows(measured_px_max=2.2))["error"] == "holds"
    monkeypatch.setattr(_core, "world_slack", lambda distance: distance)
    assert verdicts(rows(measured_px_max=1000.0))["error"] == "holds"


def test_cracks_are_told_and_never_broken():
    (told,) = [v for v in laws.judge(rows(crack_pixels=5.0)) if v.law == "cracks"]
    assert told.verdict == "open" and "5 pixels" in told.sentence
    assert verdicts(rows(crack_edges=2))["cracks"] == "holds"


def test_a_still_camera_may_take_frames_to_settle():
    frames = rows(pop_px_max=0.5)
    frames.loc[4, "pop_px_max"] = 0.0
    (still,) = [v for v in laws.judge(frames) if v.law == "still"]
    assert still.verdict == "holds" and "after 4 frames" in still.sentence
    frames["path"] = "flyover"
    assert "still" not in verdicts(frames)


@pytest.mark.parametrize(
    ("column", "value"), [("measured_px_max", 0.5), ("crack_edges", 1), ("crack_pixels", 1.0), ("pop_px_max", 1.0)]
)
def test_the_baseline_measures_zero(column, value):
    frames = rows()
    frames[["method", "measured_px_max"]] = ["full", 0.0]
    assert verdicts(frames)["baseline"] == "holds"
    frames[column] = frames[column].astype(float)
    frames.loc[3, column] = value
    assert verdicts(frames)["baseline"] == "broken"


def test_laws_are_judged_even_where_the_view_sees_nothing():
    frames = rows(hole_samples=3)
    frames["measured_px_max"] = np.nan
    found = verdicts(frames)
    assert found["error"] == "open" and found["holes"] == "broken"


def test_rows_of_an_older_version_leave_laws_open():
    found = {v.law: v for v in laws.judge(rows().drop(columns=["inverted_triangles", "pop_px_max"]))}
    assert found["winding"].verdict == found["still"].verdict == "open"
    assert "inverted_triangles" in found["winding"].sentence


def test_real_runs_keep_the_laws(tmp_path):
    config = {
        "sources": ["fractal:size=65,seed=3"],
        "frames": 3,
        "size": [96, 64],
        "accuracy_frames": 2,
        "pixel_errors": [4.0],
        "images": "none",
        "methods": [{"name": "full"}, {"name": "chunked", "options": {"leaf": 16, "chunk_triangles": 128}}],
    }
    frames = lod.sweep(config, out=tmp_path / "run", progress=False).frames
    found = {v.law: v.verdict for v in laws.judge(frames, 96)}
    assert set(found.values()) <= {"holds", "open"}
    assert {"error", "baseline", "capture", "holes"} <= {law for law, verdict in found.items() if verdict == "holds"}
