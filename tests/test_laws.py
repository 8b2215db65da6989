# SPDX-License-Identifier: MIT
"""The table of laws: each breaks on exactly the rows that break it, and names the first of them."""

from __future__ import annotations

import re

import numpy as np
import pandas as pd
import pytest

import lodlab as lod
from lodlab import _core, cli, laws
from lodlab.instrument import metrics

pytestmark = pytest.mark.usefixtures("unrendered")

GOOD = {
    "run": "a",
    "method": "chunked",
    "path": "still",
    "stream": False,
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
    "source_kind": "heightfield",
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


def test_an_infinite_error_breaks_a_law_though_nothing_was_promised():
    frames = rows(measured_px_max=np.inf)
    assert {law for law, verdict in verdicts(frames).items() if verdict == "broken"} == {"error", "finite"}
    frames["promises_bound"] = False
    (broken,) = [v for v in laws.judge(frames) if v.verdict == "broken"]
    assert broken.law == "finite" and "first in a, frame 3" in broken.sentence and broken.runs == ("a",)


def test_every_run_that_breaks_a_law_is_known_by_name():
    frames = pd.concat([rows().assign(run="good"), rows(hole_samples=1), rows(hole_samples=2).assign(run="b")])
    assert laws.broken_by_run(laws.judge(frames)) == {"a": ["holes"], "b": ["holes"]}


def test_a_rows_own_slack_counts():
    frames = rows(measured_px_max=2.5).assign(slack_px=0.6)
    assert verdicts(frames)["error"] == "holds"
    frames.loc[4, "slack_px"] = 0.4
    (broken,) = [v for v in laws.judge(frames) if v.verdict == "broken"]
    assert "frame 4" in broken.sentence


def test_a_budget_of_triangles_breaks_too():
    frames = rows(triangles=101)
    frames.loc[3:, "drawn_triangles"] = 101.0
    broken = [v for v in laws.judge(frames) if v.verdict == "broken"]
    assert [v.law for v in broken] == ["budgets"] and "101 triangles" in broken[0].sentence


def test_the_slack_is_a_hundredth_of_a_pixel():
    assert verdicts(rows(measured_px_max=2.0100))["error"] == "holds"
    assert verdicts(rows(measured_px_max=2.0106))["error"] == "broken"


def test_claims_of_rounding_say_nothing_of_how_tight_bounds_are():
    frames = rows(predicted_px=2e-12, measured_px_max=8e-5)  # frames 3 and 4
    (found,) = (v for v in laws.judge(frames) if v.law == "error")
    assert found.verdict == "holds" and "in the median it is 75 % of it" in found.sentence
    frames["predicted_px"], frames["measured_px_max"] = 2e-12, 8e-5
    (found,) = (v for v in laws.judge(frames) if v.law == "error")
    assert found.verdict == "holds" and "median" not in found.sentence


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


OF_FIELDS = {
    "holes": "hole_samples",
    "fillers": "slanted_filler_triangles",
    "raised": "raised_filler_triangles",
}


def test_laws_of_fields_do_not_apply_to_meshes():
    mesh = rows().assign(run="m", source_kind="mesh", **dict.fromkeys(OF_FIELDS.values(), np.nan))
    found = verdicts(mesh)
    assert not OF_FIELDS.keys() & found.keys() and set(found.values()) == {"holds"}
    both = pd.concat([mesh, rows()], ignore_index=True)
    for law in laws.judge(both):
        if law.law in OF_FIELDS:
            assert law.verdict == "holds" and "(5 frames)" in law.sentence


@pytest.mark.parametrize(("law", "column"), OF_FIELDS.items())
def test_meshes_beside_fields_hide_nothing_of_them(law, column):
    mesh = rows().assign(run="m", source_kind="mesh", **dict.fromkeys(OF_FIELDS.values(), np.nan))
    both = pd.concat([mesh, rows(**{column: 2})], ignore_index=True)
    assert laws.broken_by_run(laws.judge(both)) == {"a": [law]}
    both.loc[both["run"] == "a", column] = np.nan
    assert verdicts(both)[law] == "open"


def test_an_infinite_error_of_a_mesh_is_broken_without_holes_to_count():
    frames = rows(measured_px_max=np.inf).assign(source_kind="mesh", hole_samples=np.nan)
    (finite,) = [v for v in laws.judge(frames) if v.law == "finite"]
    assert finite.verdict == "broken" and "an infinite error" in finite.sentence


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
    monkeypatch.setattr(_core, "world_slack", lambda distance: distance)  # a unit is 1108 pixels at a unit's distance
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
    assert verdicts(rows(pop_px_max=0.5))["still"] == "broken"
    assert verdicts(rows(pop_px_max=0.5).assign(stream=True))["still"] == "open", "data may yet be on its way"
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


CONFIG = {
    "sources": ["fractal:size=65,seed=3"],
    "frames": 3,
    "size": [96, 64],
    "accuracy_frames": 2,
    "pixel_errors": [4.0],
    "images": "none",
    "methods": [{"name": "full"}, {"name": "chunked", "options": {"leaf": 16, "chunk_triangles": 128}}],
}


@pytest.fixture
def with_holes(monkeypatch):
    """Metrics of every method but full say that a sample is not covered, and its error infinite."""

    def worse(metric, value):
        def of(measurement):
            return value if measurement.predicted_px > 0.0 else metric.of(measurement)

        return metrics.Metric(metric.name, metric.unit, metric.text, of)

    values = {"hole_samples": 1, "measured_px_max": np.inf}
    torn = [worse(m, values[m.name]) if m.name in values else m for m in metrics.METRICS]
    monkeypatch.setattr(metrics, "METRICS", tuple(torn))


def test_a_sweep_that_breaks_promises_says_so_after_its_results_are_written(tmp_path, with_holes):
    out = tmp_path / "run"
    with pytest.warns(lod.errors.BrokenPromise) as told:
        result = lod.sweep(CONFIG, out=out, progress=False)
    said = [str(w.message) for w in told if w.category is lod.errors.BrokenPromise]
    assert len(said) == 3, said
    assert all("chunked-px4" in text and "frame 0" in text for text in said)
    assert any(text.startswith("law holes: ") for text in said)
    assert set(lod.Sweep.load(out).runs) == set(result.runs) == {"full", "chunked-px4"}
    (row,) = re.findall(r'<tr class="broken" title="breaks: ([^"]*)"><td>([^<]*)', (out / "report.html").read_text())
    assert row == ("error, finite, holes", "chunked-px4")


def test_the_command_line_ends_with_status_1_after_a_broken_promise(tmp_path, capsys, with_holes):
    store, out = tmp_path / "a.lod", tmp_path / "run"
    assert cli.run(["build", CONFIG["sources"][0], "chunked", str(store), "-o", "leaf=16"]) == 0
    fly = ["fly", str(store), "--out", str(out), "--pixel-error", "4", "--frames", "2", "--size", "96x64"]
    for _ in range(2):  # once more: the run is there, and is read
        capsys.readouterr()
        assert cli.run([*fly, "--accuracy-frames", "1", "--images", "none"]) == 1
        said = capsys.readouterr()
        assert "error: law holes: " in said.err and "first in chunked-px4, frame 0 (1 samples uncovered)" in said.err
        assert f"report: {out / 'report.html'}" in said.out
    assert lod.Sweep.load(out).runs == ["chunked-px4"]
    compare = [
        "compare",
        CONFIG["sources"][0],
        "--methods",
        "chunked",
        "--out",
        str(tmp_path / "both"),
        "--frames",
        "1",
    ]
    assert cli.run([*compare, "--size", "96x64", "--pixel-errors", "4", "--images", "none"]) == 1
    assert cli.run(["sweep", str(tmp_path / "both" / "config.toml"), "--out", str(tmp_path / "again")]) == 1


def test_real_runs_keep_the_laws(tmp_path, recwarn):
    frames = lod.sweep(CONFIG, out=tmp_path / "run", progress=False).frames
    assert not [w for w in recwarn if w.category is lod.errors.BrokenPromise]
    found = {v.law: v.verdict for v in laws.judge(frames, 96)}
    assert set(found.values()) <= {"holds", "open"}
    assert {"error", "baseline", "capture", "holes"} <= {law for law, verdict in found.items() if verdict == "holds"}
