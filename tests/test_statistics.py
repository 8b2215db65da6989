# SPDX-License-Identifier: MIT
"""Intervals of median times, runs compared frame by frame, the noise floor: times with known noise. No test here
asserts a speed."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

import lodlab as lod
from lodlab import charts, figures
from lodlab.chart import COLOURS, INK
from lodlab.instrument import statistics
from lodlab.runs import tables

pytestmark = pytest.mark.usefixtures("unrendered")

FRAMES = 120
SHAPE = np.linspace(4.0, 9.0, FRAMES) * (1.0 + 0.2 * np.sin(np.arange(FRAMES) / 7.0))  # ms, as along a path


def timed(seed, passes=1, noise=0.05, factor=1.0):
    """(passes, frames) of a run whose frames cost SHAPE, timed with noise."""
    return factor * SHAPE * np.exp(noise * np.random.default_rng(seed).standard_normal((passes, FRAMES)))


def interval(times):
    return statistics.median_intervals(times[:, :, None])[:, 0]


@pytest.mark.parametrize("passes", [1, 2, 3, 5])
def test_intervals_contain_the_median_and_repeat(passes):
    times = timed(1, passes)
    low, high = interval(times)
    assert low < np.median(np.median(times, axis=0)) < high
    assert np.array_equal(interval(times), interval(times)), "the interval is not repeatable"


def even(seed, passes, drift=0.0):
    """(passes, frames) of frames that all cost 1 ms, with noise; `drift` moves whole passes."""
    rng = np.random.default_rng(seed)
    times = np.exp(0.2 * rng.standard_normal((passes, FRAMES)))
    return times * np.exp(drift * rng.standard_normal((passes, 1)))


@pytest.mark.parametrize("drift", [0.0, 0.05])
def test_intervals_narrow_with_repeats(drift):
    widths = [np.mean([np.diff(interval(even(s, passes, drift))) for s in range(20)]) for passes in (3, 6, 12)]
    assert widths[0] > 1.1 * widths[1] > 1.1 * 1.1 * widths[2], widths


def test_intervals_of_several_passes_cover_what_moves_whole_passes():
    """One pass cannot know that it was a slow one; frames drawn alone would cover the truth two times in three."""
    hits = sum(low <= 1.0 <= high for low, high in (interval(even(s, 3, drift=0.05)) for s in range(200)))
    assert hits / 200 >= 0.89
    blind = (np.median(even(s, 3, drift=0.05), axis=0)[None] for s in range(200))
    assert sum(low <= 1.0 <= high for low, high in map(interval, blind)) / 200 < 0.75


def test_intervals_are_those_of_drawn_samples():
    """Against the bootstrap as it is written in books: passes drawn, frames drawn, medians."""
    rng = np.random.default_rng(3)
    times = np.random.default_rng(4).gamma(9.0, 0.5, (3, 41))
    medians = []
    for _ in range(20_000):
        frames = np.median(times[rng.integers(3, size=3)], axis=0)
        medians.append(np.median(frames[rng.integers(41, size=41)]))
    expected = np.quantile(medians, [0.025, 0.975])
    assert interval(times) == pytest.approx(expected, abs=0.15 * float(np.diff(expected)[0]))  # of 1000 resamples


def test_intervals_cover_the_truth_as_often_as_they_say():
    truth = 1.0  # the median of the log-normal
    hits = 0
    for seed in range(400):
        low, high = interval(np.exp(0.3 * np.random.default_rng(seed).standard_normal((1, 40))))
        hits += low <= truth <= high
    assert 0.91 <= hits / 400 <= 0.985


def test_a_single_time_has_no_interval():
    assert np.isnan(interval(np.array([[5.0]]))).all()
    assert np.isfinite(interval(np.array([[5.0], [6.0]]))).all(), "two passes of one frame have one"


def test_every_column_has_its_own_interval():
    times = np.stack([timed(1, 3), 10.0 * timed(1, 3)], axis=2)
    both = statistics.median_intervals(times)
    assert both[:, 1] == pytest.approx(10.0 * both[:, 0])


def test_equal_methods_are_not_told_apart_and_shifted_ones_are():
    wrong = sum(statistics.told_apart(timed(s)[0], timed(s + 1000)[0]) for s in range(200))
    assert wrong <= 20, "the interval of 95 % is wrong one time in twenty, not more"
    for seed in range(20):
        assert statistics.told_apart(timed(seed)[0], timed(seed + 1000, factor=1.2)[0])
        assert statistics.told_apart(timed(seed)[0], timed(seed + 1000, factor=0.8)[0])


def test_frames_are_compared_one_by_one():
    """Frames differ by far more than the 5 % between the runs: only the ratio in each frame shows it."""
    a, b = timed(1, noise=0.02)[0], timed(2, noise=0.02, factor=1.05)[0]
    (low, high), (other_low, _) = interval(a[None]), interval(b[None])
    assert low < other_low < high, "the intervals overlap"
    assert statistics.told_apart(a, b)
    assert statistics.ratio(a, b)[0] == pytest.approx(1.05, abs=0.02)


def test_differences_below_the_noise_floor_are_not_told_apart():
    a, b = timed(1, noise=0.01)[0], timed(2, noise=0.01, factor=1.05)[0]
    assert statistics.told_apart(a, b) and statistics.told_apart(a, b, 1.02) and not statistics.told_apart(a, b, 1.08)
    assert not statistics.told_apart(b, a, 1.08)


def test_slow_passes_widen_a_comparison():
    before = np.ones(FRAMES)
    calm, moved = statistics.ratio(before, even(1, 5)), statistics.ratio(before, even(1, 5, drift=0.3))
    assert moved[2] - moved[1] > 2.0 * (calm[2] - calm[1])
    assert statistics.ratio(before, even(1, 5)[:1]) == statistics.ratio(before, even(1, 5)[0])


def test_times_below_the_clock_are_left_out_and_too_few_tell_nothing():
    assert np.isnan(statistics.ratio(np.zeros(5), np.ones(5))).all()
    assert statistics.ratio(np.array([0.0, 1.0, 1.0]), np.array([9.0, 2.0, 2.0]))[0] == 2.0
    assert not statistics.told_apart(np.array([1.0]), np.array([2.0]))


@pytest.mark.parametrize(
    ("ends", "floor"),
    [((1.01, 0.99, 1.03), 1.03), ((0.9, 0.8, 0.95), 1.25), ((1.0, 1.0, 1.0), 1.0), ((1.1, np.nan, np.nan), 1.1)],
)
def test_noise_floor_is_the_largest_factor(ends, floor):
    noise = pd.DataFrame([dict(zip(("ratio", "low", "high"), ends, strict=True)) | {"column": "frame_ms"}])
    assert statistics.noise_floor(noise) == pytest.approx(floor)
    assert statistics.noise_floor(noise, "gpu_ms") is None and statistics.noise_floor(None) is None


# ---- in run directories ---------------------------------------------------------------------------

CONFIG = {
    "sources": ["fractal:size=65,seed=3"],
    "frames": 5,
    "size": [96, 64],
    "accuracy_frames": 2,
    "repeat": 2,
    "images": "none",
    "pixel_errors": [1.0, 4.0],
    "methods": [{"name": "full"}, {"name": "chunked", "options": {"leaf": 16, "chunk_triangles": 128}}],
}


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    return lod.sweep(CONFIG, out=tmp_path_factory.mktemp("statistics") / "run", progress=False)


def test_summaries_hold_intervals_of_the_median_times(swept):
    for column in tables.TIME_COLUMNS:
        low, high = (swept.summary[f"{column}_median_{end}"] for end in ("low", "high"))
        assert (low <= swept.summary[f"{column}_median"]).all() and (swept.summary[f"{column}_median"] <= high).all()
    assert tables.SUMMARY_COLUMNS[-10:-4] == tuple(
        f"{c}_median_{end}" for c in tables.TIME_COLUMNS for end in ("low", "high")
    ), "columns only grow, at the end"


def test_sweeps_time_one_run_twice(swept):
    noise = tables.read_table(swept.directory / "noise.csv")
    assert tuple(noise.columns) == tables.NOISE_COLUMNS
    assert noise["column"].tolist() == list(tables.TIME_COLUMNS)
    assert set(noise["run"]) == {"chunked-px1"} and set(noise["passes"]) == {2} and set(noise["jobs"]) == {1}
    assert (noise["low"] <= noise["ratio"]).all() and (noise["ratio"] <= noise["high"]).all()
    assert (noise["low"] > 0).all()
    assert swept.noise.equals(noise)
    assert statistics.noise_floor(noise) >= 1.0


def test_null_comparison_is_made_once_and_again_where_it_is_missing(swept, tmp_path):
    config = {**CONFIG, "accuracy_frames": 0, "frames": 2}
    lod.sweep(config, out=tmp_path / "run", progress=False)
    file = tmp_path / "run" / "noise.csv"
    before = file.read_bytes()
    lod.sweep(config, out=tmp_path / "run", progress=False)
    assert file.read_bytes() == before, "nothing was flown, nothing is timed again"
    file.unlink()
    assert lod.sweep(config, out=tmp_path / "run", progress=False).noise is not None
    summary = tmp_path / "run" / "summary.csv"
    summary.write_bytes(b"".join(summary.read_bytes().splitlines(keepends=True)[:-1]))
    file.write_text(before.decode().replace("chunked-px1", "gone"))
    assert set(lod.sweep(config, out=tmp_path / "run", progress=False).noise["run"]) == {"chunked-px1"}


def test_runs_in_worker_processes_say_so(tmp_path):
    config = {**CONFIG, "accuracy_frames": 0, "frames": 2}
    assert set(lod.sweep(config, out=tmp_path / "run", jobs=2, progress=False).noise["jobs"]) == {2}


def test_only_full_is_compared_with_itself(tmp_path):
    config = {**CONFIG, "methods": [{"name": "full"}], "frames": 2, "accuracy_frames": 0}
    assert set(lod.sweep(config, out=tmp_path / "run", progress=False).noise["run"]) == {"full"}


# ---- in charts ------------------------------------------------------------------------------------

# Milliseconds of each run: `b` is as slow as full at 1 px and as `a` at 4 px; `a` is as slow at 2 px as at 1.
RUNS = {
    ("full", None): 20.0,
    ("a", 1.0): 10.0, ("a", 2.0): 9.95, ("a", 4.0): 5.0,
    ("b", 1.0): 19.9, ("b", 2.0): 14.0, ("b", 4.0): 5.02,
}  # fmt: skip


@pytest.fixture(scope="module")
def known(swept):
    """A sweep of three methods whose times are known, on the rows of a real one."""
    template = swept.frames[swept.frames["run"] == "chunked-px1"].iloc[0].to_dict()
    rows, summaries = [], []
    for seed, ((method, px), ms) in enumerate(RUNS.items()):
        times = timed(seed, passes=3, noise=0.03, factor=ms / float(np.median(SHAPE)))
        run = [
            {
                **template, "run": f"{method}-{px}", "method": method, "options": "{}", "budget_pixel_error": px,
                "frame": f, "frame_ms": value, "accuracy": True,
                "measured_px_max": 0.0 if px is None else px * (0.8 if method == "a" else 0.6),
            }
            for f, value in enumerate(np.median(times, axis=0))
        ]  # fmt: skip
        rows += run
        three = np.repeat(times[:, :, None], 3, axis=2)
        summaries.append(tables.summarize(run, store_bytes=1, build_seconds=1.0, times=three))
    noise = pd.DataFrame([{"run": "a-1.0", "column": "frame_ms", "ratio": 1.0, "low": 0.99, "high": 1.02, "jobs": 1}])
    frames, summary = tables.table(rows, tables.FRAME_COLUMNS), tables.table(summaries, tables.SUMMARY_COLUMNS)
    return lod.Sweep(None, frames, summary, noise)


def drawn(chart):
    """The axes of a chart."""
    from matplotlib.figure import Figure

    figure = Figure(layout="constrained")
    chart._draw(figure, "light")
    return figure.axes


def lines(ax, colour):
    return [line for line in ax.lines if line.get_color() == colour and line.get_marker() == "None"]


def test_charts_dash_neighbours_that_the_noise_does_not_tell_apart(known):
    time_panel, triangles = drawn(charts.pareto(known))
    first, second = COLOURS["light"][:2]
    assert [line.is_dashed() for line in lines(time_panel, first)] == [True, False]
    assert [line.is_dashed() for line in lines(time_panel, second)] == [False, False]
    assert not any(line.is_dashed() for line in lines(triangles, first)), "counts are exact"


def test_charts_hollow_points_that_are_not_told_apart_from_full(known):
    time_panel, triangles = drawn(charts.pareto(known))
    page = INK["light"]["page"]

    def hollow(ax):
        marks = [line for line in ax.lines if line.get_marker() not in ("None", "*")]
        return [line.get_markerfacecolor() == page for line in marks]

    assert hollow(time_panel) == [False, False, False, True, False, False]
    assert not any(hollow(triangles))


def test_charts_tie_methods_that_are_not_told_apart_at_one_budget(known):
    ties = lines(drawn(charts.pareto(known))[0], INK["light"]["text"])
    assert len(ties) == 1
    assert ties[0].get_xdata() == pytest.approx([5.0, 5.02], rel=0.02)


def test_charts_show_intervals_and_the_noise_floor(known):
    time_panel, triangles = drawn(charts.pareto(known))
    assert time_panel.get_xlabel().endswith("noise 2 %") and "noise" not in triangles.get_xlabel()
    row = known.summary.iloc[1]
    spans = [path.vertices[:, 0] for bars in time_panel.collections for path in bars.get_paths()]
    wanted = [row["frame_ms_median_low"], row["frame_ms_median_high"]]
    assert any(span == pytest.approx(wanted) for span in spans)
    quiet = lod.Sweep(None, known.frames, known.summary)
    assert "noise" not in drawn(charts.pareto(quiet))[0].get_xlabel()


def test_a_noisy_machine_tells_nothing_apart(known):
    noisy = lod.Sweep(None, known.frames, known.summary, known.noise.assign(high=9.0))
    panel = drawn(charts.pareto(noisy))[0]
    assert all(line.is_dashed() for line in lines(panel, COLOURS["light"][0]))
    assert len(lines(panel, INK["light"]["text"])) == 3


def test_runs_of_other_lengths_are_judged_by_their_intervals(known):
    frames = known.frames[~((known.frames["run"] == "a-4.0") & (known.frames["frame"] > 60))]
    clock = charts._Clock(frames, known.summary, 1.02)
    assert clock.apart("a-1.0", "a-4.0") and not clock.apart("a-4.0", "b-4.0")


@pytest.mark.parametrize(
    ("factor", "text"),
    [(1.0, "0 %"), (1.0045, "0.45 %"), (1.031, "3.1 %"), (1.0998, "10 %"), (1.62, "62 %"), (2.98, "198 %")],
)
def test_factors_as_percentages(factor, text):
    assert figures.percent(factor) == text
