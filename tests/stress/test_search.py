# SPDX-License-Identifier: MIT
"""The random search: what it draws, that it sees what is wrong, and that a crash costs one trial. It is itself run by
the short form of the suite (test_stability)."""

from __future__ import annotations

import contextlib
import dataclasses
import io
import json
import os
import time
import types
from pathlib import Path

import numpy as np
import pytest

import lodlab as lod
from lodlab import stability
from lodlab.errors import InvalidInput
from lodlab.stability import meshes, replay, rules, search, trials, workers
from lodlab.stability.trials import PAGING, Ground, Trial, draw_trial

METHODS = [m["name"] for m in lod.methods()]
VIEW = {
    "kind": "over", "at": [0.0, 0.0], "to": [0.5, 0.5], "way": [-0.5, 0.4, 0.3], "away": 1.0, "fov": 60.0,
    "size": [96, 64], "near": None, "up": None,
}  # fmt: skip
HILLS = {
    "rows": 70, "cols": 60, "shape": "hills", "seed": 1, "height": 1.0, "base": 0.0, "voids": None,
    "spacing": [30.0, 40.0], "origin": [0.0, 0.0],
}  # fmt: skip


BALL = {
    "mesh": "ball", "detail": 12, "seed": 1, "parts": 1, "damage": None, "stretch": [1.0, 1.0, 1.0], "size": 1.0,
    "shift": [0.0, 0.0, 0.0],
}  # fmt: skip


def frames(*budgets: dict) -> list[dict]:
    return [{"view": VIEW, "budget": budget} for budget in budgets]


PLAIN = Trial("chunked", "frames", HILLS, frames=frames({"pixel_error": 2.0}, {"triangles": ["least", 1]}))
DEEP = dataclasses.replace(PLAIN, build={"leaf": 8, "chunk_triangles": 64})


def laws(trial: Trial, folder: Path) -> set[str]:
    return {law for law, _ in search.play(trial, folder).broken}


# ---- what is drawn --------------------------------------------------------------------------------


@pytest.mark.parametrize("method", METHODS)
def test_a_trial_is_drawn_again_from_its_line(method: str) -> None:
    assert draw_trial(method, 3, 17) == draw_trial(method, 3, 17)
    assert draw_trial(method, 3, 17) != draw_trial(method, 3, 18)
    assert draw_trial(method, 3, 17).name == f"python -m lodlab.stability.replay {method} 3 17"


@pytest.mark.parametrize("method", METHODS)
def test_both_ends_of_every_option_are_drawn(method: str) -> None:
    drawn: dict[str, set] = {}
    for i in range(600):
        trial = draw_trial(method, 0, i)
        for name, value in (trial.build | trial.draw).items():
            drawn.setdefault(name, set()).add(value)
    for option in lod.methods()[METHODS.index(method)]["options"]:
        if option["name"] in PAGING:
            continue
        ends = option.get("choices") or option.get("range") or ([True, False] if option["type"] == "bool" else [])
        assert set(ends) <= drawn[option["name"]], option["name"]


def test_every_kind_of_trial_view_and_source_is_drawn() -> None:
    kinds, views, sources = set(), set(), set()
    for i in range(300):
        trial = draw_trial("multigrain", 0, i)
        kinds.add(trial.kind)
        views |= {frame["view"]["kind"] for frame in trial.frames}
        sources.add("flat" if "spacing" in trial.source else "globe" if trial.source["degrees"] is None else "window")
    assert kinds == set(trials.KINDS) and views == set(trials.VIEWS)
    assert sources == {"flat", "globe", "window"}


def test_meshes_of_every_shape_and_damage_are_drawn() -> None:
    random = np.random.default_rng(1)
    drawn = [meshes.random_mesh(random) for _ in range(300)]
    assert {d["mesh"] for d in drawn} == set(meshes.SHAPES) and {d["damage"] for d in drawn} == {None, *meshes.DAMAGE}
    for recipe in drawn:
        made, again = meshes.make_mesh(recipe), meshes.make_mesh(recipe)
        assert made.hash() == again.hash() and 0 < len(made.faces) < 50_000
    assert not {"mesh" in draw_trial("chunked", 0, i).source for i in range(50)} - {False}
    assert {"mesh" in draw_trial("full", 0, i).source for i in range(20)} == {False, True}


def test_a_damaged_mesh_is_as_its_name_says() -> None:
    def census(damage: str | None) -> dict:
        return meshes.make_mesh(BALL | {"damage": damage}).census

    assert census(None)["oriented"] and census(None)["boundary_edges"] == 0
    assert not census("turned")["oriented"] and census("duplicates")["duplicate_triangles"] > 0
    assert census("no area")["degenerate_triangles"] > 0 and census("unused")["unused_vertices"] == 5
    assert census("fins")["nonmanifold_edges"] > 0 and census("welded")["nonmanifold_vertices"] > 0
    for damage in ("holes", "half", "soup"):
        assert census(damage)["boundary_edges"] > 0


def test_views_lie_where_their_name_says() -> None:
    source = trials.make_source(HILLS)
    ground = Ground(source)

    def eye(kind: str) -> object:
        return trials.make_view(ground, VIEW | {"kind": kind}).eye

    assert eye("under")[2] < source.heights.min()
    assert abs(eye("grazing") - ground.sample(0.0, 0.0)).max() < 0.1 * ground.relief + ground.cell
    assert tuple(eye("sample")) == tuple(ground.sample(0.0, 0.0))
    assert abs(eye("far")).max() > 3.0 * ground.span


# ---- what is seen ---------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", trials.KINDS)
def test_nothing_is_broken_on_hills(tmp_path: Path, kind: str) -> None:
    draw = {"stream": True, "gpu_cache_mb": 24, "cpu_cache_mb": 24} if kind == "stream" else {}
    found = search.play(dataclasses.replace(PLAIN, kind=kind, draw=draw), tmp_path)
    assert found.broken == [] and found.refused == []
    wanted = {"bounds", "holes", "cracks", "flaws", "capture"}
    wanted |= {"cuts": {"source"}, "stream": {"caches", "settles"}}.get(kind, {"error", "openly", "least"})
    assert wanted <= set(found.checks)


def test_a_claim_that_does_not_hold_is_seen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lod.Cut, "predicted_px", property(lambda cut: 0.001 * cut.core.predicted_px))
    assert "error" in laws(DEEP, tmp_path)


def test_a_budget_that_is_not_kept_is_seen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    real = search._Player.fly

    def generous(player: object, flying: object, view: object, values: dict) -> lod.Cut:
        return real(player, flying, view, {"pixel_error": 1e-9})

    monkeypatch.setattr(search._Player, "fly", generous)
    assert {"hard", "openly"} <= laws(PLAIN, tmp_path)


def test_a_least_that_is_not_the_least_is_seen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    real = search._Player.spent
    monkeypatch.setattr(search._Player, "spent", lambda *args: 10 * real(*args))
    assert "least" in laws(PLAIN, tmp_path)


def test_nothing_in_view_needs_nothing(tmp_path: Path) -> None:
    """A budget of one node is then kept by one that need not be there."""
    beside = VIEW | {"kind": "sample", "to": [0.2, 0.7], "way": [0.58, 1.22, 2.12], "near": 1.0}
    budget = {"triangles": ["share", 0.2], "nodes": ["share", 0.6]}
    source = HILLS | {"rows": 2, "cols": 9, "shape": "flat", "spacing": [1.0, 1.0]}
    frame = {"view": beside, "budget": budget}
    assert laws(Trial("chunked", "frames", source, {"leaf": 4}, frames=[frame]), tmp_path) == set()


def test_a_budget_may_wait_for_what_is_said_to_be_missing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Only while it is missing: inside the ground the children that are out of sight cost less than the root."""
    inside = VIEW | {"kind": "through", "to": [0.37, 0.16], "way": [0.418, 0.605, -0.478], "fov": 1.0}
    source = HILLS | {"rows": 128, "cols": 2, "spacing": [1.0, 1.0]}
    frame = {"view": inside, "budget": {"triangles": ["share", 0.25]}}
    waits = Trial("chunked", "stream", source, draw={"stream": True}, frames=[frame])
    assert laws(waits, tmp_path) == set()
    monkeypatch.setattr(lod.Cut, "missing_nodes", 0)
    assert "hard" in laws(waits, tmp_path)


def test_a_camera_is_still_until_all_levels_had_time_to_come(tmp_path: Path) -> None:
    """The cheapest cut lies five levels down, and nothing of it is drawn before all of it is there."""
    grazing = VIEW | {"kind": "grazing", "at": [0.44, 0.84], "way": [-1.95, -0.12, 0.58], "fov": 118.0}
    source = HILLS | {"rows": 8, "cols": 128, "shape": "noise", "spacing": [356.0, 21000.0]}
    frame = {"view": grazing, "budget": {"triangles": ["least", 1]}}
    build = {"leaf": 4, "chunk_triangles": 8192}
    assert laws(Trial("chunked", "stream", source, build, {"stream": True}, [frame]), tmp_path) == set()


def test_what_an_option_gives_up_is_seen_or_by_nature(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cracked = dataclasses.replace(DEEP, kind="cuts", draw={"cracks": "none"}, frames=4 * frames({}))
    monkeypatch.setattr(search, "_natures", list)
    assert laws(cracked, tmp_path / "a") == {"cracks"}
    row = rules.Rule("chunked", {"cracks": "none"}, search.SCENE, "shows them on purpose", 0.0, "cracks")
    monkeypatch.setattr(search, "_natures", lambda: [row])
    found = search.play(cracked, tmp_path / "b")
    assert found.broken == [] and found.by_nature["cracks"] > 0


def test_a_silhouette_between_samples_is_no_crack(tmp_path: Path) -> None:
    """Of a blade 24 m wide and 2.6 km long, whose triangles are cut otherwise; of a slit narrower than a pixel."""
    for method, index in (("multigrain", 495), ("chunked", 3501)):
        assert laws(draw_trial(method, 1005, index), tmp_path / method) == set()


def test_slits_between_peaks_narrower_than_pixels_are_no_crack(tmp_path: Path) -> None:
    """Needles a hundred times as high as wide, white noise, and an eye in the plane of a border."""
    for index in (6769, 19642, 25117):
        assert laws(draw_trial("chunked", 2027, index), tmp_path / str(index)) == set()


def test_a_crack_that_no_filler_hides_is_seen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cracked = dataclasses.replace(DEEP, kind="cuts", draw={"cracks": "none"}, frames=4 * frames({}))
    monkeypatch.setattr(search, "_natures", list)
    monkeypatch.setattr(lod.Session, "capture", lambda *args: types.SimpleNamespace(kind=np.ones(1)))
    assert laws(cracked, tmp_path) == {"cracks"}


def test_an_error_that_is_not_typed_is_seen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*args: object) -> None:
        raise ZeroDivisionError("division by zero")

    monkeypatch.setattr(search._Player, "fly", fails)
    assert laws(PLAIN, tmp_path) == {"typed"}


def test_a_refusal_counts_where_nothing_may_be_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuses(*args: object) -> None:
        raise InvalidInput("select: this view is not to my taste, sorry")

    odd = search.play(dataclasses.replace(PLAIN, build={"leaf": 5}), tmp_path)
    assert odd.broken == [] and "leaf" in odd.refused[0]
    monkeypatch.setattr(search._Player, "fly", refuses)
    assert laws(PLAIN, tmp_path) == {"accepted"}


@pytest.mark.parametrize(("lacks", "broken"), [("a rim of 3 edges", set()), ("", {"accepted"})])
def test_a_mesh_may_be_refused_that_lacks_what_is_needed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, lacks: str, broken: set[str]
) -> None:
    def refuses(*args: object, **values: object) -> None:
        raise InvalidInput("build: method full needs a closed mesh: this one has 3 edges of one triangle")

    monkeypatch.setattr(search, "lacking", lambda source, method: lacks)
    monkeypatch.setattr(search, "store_for", refuses)
    assert laws(Trial("full", "frames", BALL, frames=frames({"pixel_error": 2.0})), tmp_path) == broken


def test_a_find_is_made_smaller(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lod.Cut, "predicted_px", property(lambda cut: -1.0))
    large = dataclasses.replace(PLAIN, draw={"morph": "false"}, source=HILLS | {"voids": "holed", "base": 5.0})
    small = replay.shrink(large, "finite", seconds=20.0)
    assert small.draw == {} and len(small.frames) == 1
    assert small.source["voids"] is None and small.source["shape"] == "flat"
    assert (small.source["rows"], small.source["cols"]) == (2, 2)


def test_a_find_on_a_mesh_is_made_smaller(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lod.Cut, "predicted_px", property(lambda cut: -1.0))
    source = BALL | {"mesh": "torus", "damage": "holes", "parts": 3, "shift": [10.0, -7.0, 3.0]}
    large = Trial("full", "frames", source, frames=frames({"pixel_error": 2.0}))
    assert "finite" in laws(large, tmp_path)
    assert replay.shrink(large, "finite", seconds=20.0).source == BALL | {"detail": 1}


def test_the_snippet_of_a_find_plays_it() -> None:
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        exec(replay.snippet(draw_trial("chunked", 0, 0)), {})
    assert said.getvalue().startswith("[")


# ---- processes ------------------------------------------------------------------------------------


def stumbling(trial: Trial, folder: Path) -> search.Found:
    """Dies in trial 1, hangs in trial 2, finds nothing in the others."""
    number = int(trial.name.split()[-1])
    if number == 1:
        os.abort()
    if number == 2:
        time.sleep(600)
    return search.Found()


def test_a_crash_and_a_hang_cost_one_trial_each() -> None:
    found = dict(workers.search("full", trials=5, jobs=2, act=stumbling, patience=3.0))
    assert sorted(found) == [0, 1, 2, 3, 4]
    broken = {index: f.broken for index, f in found.items() if f.broken}
    assert set(broken) == {1, 2}
    assert broken[1] == [("crash", "the process ended with signal 6")]
    assert broken[2][0][0] == "crash" and "no answer" in broken[2][0][1]


def test_trials_do_not_depend_on_the_number_of_workers() -> None:
    one, two = ({i: f.checks for i, f in workers.search("chunked", trials=6, jobs=jobs)} for jobs in (1, 2))
    assert one == two and sum(one[0].values()) > 0


def test_a_search_by_seconds_plays_and_sums_up(tmp_path: Path) -> None:
    found = stability.run(tmp_path, methods=["full"], scenes=["s20"], seconds=0.5, seed=5, progress=False)
    count = int(found.searches["full"].split(" trials")[0])
    assert count >= 1 and "checks: " in found.searches["full"]
    record = json.loads((tmp_path / "search-full.json").read_text())
    assert record["trials"] == sum(record["kinds"].values()) == count and record["seed"] == 5
    rows = found.table[found.table["scene"] == "s20"]
    assert set(rows["method"]) == {"full"} and rows["figure"].str.startswith("crash, of ").any()


@pytest.mark.parametrize("seconds", [0.0, -1.0, float("inf"), float("nan")])
def test_seconds_that_are_none_are_refused(tmp_path: Path, seconds: float) -> None:
    with pytest.raises(InvalidInput, match="seconds"):
        stability.run(tmp_path, scenes=["s20"], seconds=seconds, progress=False)
