# SPDX-License-Identifier: MIT
"""The stability suite: its short form finds no failure, and every part of it can fail."""

from __future__ import annotations

import math
import types
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import lodlab as lod
from lodlab import stability
from lodlab.errors import InvalidInput, Unsupported
from lodlab.stability import extremes, fields, motion, rules, structure, suite
from lodlab.stability.stage import FLAWS, Bench, Figure, NotApplicable, Scene, Stage, Worst
from lodlab.stability.tree import Tree

METHODS = [m["name"] for m in lod.methods()]
ON_MESHES = ("s16", "s18")


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> stability.Stability:
    return stability.run(tmp_path_factory.mktemp("stability"), short=True, progress=False)


def test_nothing_fails(short: stability.Stability) -> None:
    found = short.failed[["scene", "method", "source", "figure", "value", "limit"]]
    assert found.empty, found.to_string()


@pytest.mark.parametrize("scene", [scene.name for scene in stability.SCENES])
def test_every_scene_has_a_row_for_every_method(short: stability.Stability, scene: str) -> None:
    rows = short.table[short.table["scene"] == scene]
    assert set(rows["method"]) == set(METHODS)
    measured = rows[rows["verdict"] != "not_applicable"]
    assert np.isfinite(measured["value"]).all() and np.isfinite(measured["limit"]).all()
    idle = {"full"} if scene in ON_MESHES else {"chunked"}
    assert set(measured["method"]) >= idle, "no budget scene and no scene of neighbours is idle"


def test_run_leaves_table_page_and_pictures(short: stability.Stability) -> None:
    assert (short.directory / "stability.csv").read_text().splitlines()[0] == ",".join(stability.COLUMNS)
    assert set(short.table["verdict"]) <= {"pass", "by_nature", "not_applicable", "FAIL"}
    page = short.page.read_text()
    for scene in stability.SCENES:
        assert f'id="{scene.name}"' in page
        method = "full" if scene.name in ON_MESHES else "chunked"
        assert (short.directory / "images" / f"{scene.name}-{method}.png").is_file()
    assert "http://" not in page and "https://" not in page, "the page opens without a network"
    assert page.count("<img") == len(list((short.directory / "images").iterdir()))
    pd.testing.assert_frame_equal(stability.read(short.directory), short.table)


# ---- verdicts -------------------------------------------------------------------------------------


def scene_of(play: Callable[[Stage], Iterator[Figure]], name: str = "s05", variants: bool = False) -> tuple[Scene, ...]:
    return (Scene(name, "made for a test", play, ("flat",), ("flat",), variants),)


def five(stage: Stage) -> Iterator[Figure]:
    yield Figure("fives", 5.0, "px", 1.0)


def run_one(tmp_path: Path, **values: object) -> stability.Stability:
    return stability.run(tmp_path, methods=["chunked"], short=True, progress=False, **values)


def test_a_figure_beyond_its_limit_is_a_failure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(suite, "SCENES", scene_of(five))
    found = run_one(tmp_path)
    assert list(found.failed["figure"]) == ["fives"]
    assert found.failed["limit"].item() == 1.0


@pytest.mark.parametrize(("limit", "verdict"), [(10.0, "by_nature"), (5.0, "by_nature"), (4.9, "FAIL")])
def test_by_nature_holds_up_to_its_limit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, limit: float, verdict: str
) -> None:
    monkeypatch.setattr(suite, "SCENES", scene_of(five))
    monkeypatch.setattr(rules, "read", lambda: [rules.Rule("chunked", {}, "s05", "a proof", limit)])
    found = run_one(tmp_path)
    assert list(found.table["verdict"]) == [verdict]
    assert found.table["limit"].item() == limit


@pytest.mark.parametrize(
    "rule",
    [
        rules.Rule("full", {}, "s05", "another method", 10.0),
        rules.Rule("chunked", {}, "s04", "another scene", 10.0),
        rules.Rule("chunked", {}, "s05", "another figure", 10.0, "sixes"),
        rules.Rule("chunked", {"morph": "false"}, "s05", "other options", 10.0),
    ],
)
def test_by_nature_is_for_what_it_names_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, rule: rules.Rule
) -> None:
    monkeypatch.setattr(suite, "SCENES", scene_of(five))
    monkeypatch.setattr(rules, "read", lambda: [rule])
    assert list(run_one(tmp_path).table["verdict"]) == ["FAIL"]


def test_an_undefined_figure_is_a_failure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def undefined(stage: Stage) -> Iterator[Figure]:
        yield Figure("undefined", math.nan, "px", 1.0)

    monkeypatch.setattr(suite, "SCENES", scene_of(undefined))
    assert len(run_one(tmp_path).failed) == 1


def test_a_scene_that_breaks_is_a_failure_that_names_the_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(stage: Stage) -> Iterator[Figure]:
        yield Figure("before", 0.0, "px", 1.0)
        raise RuntimeError("the method fell over")

    monkeypatch.setattr(suite, "SCENES", scene_of(broken))
    found = run_one(tmp_path)
    assert list(found.table["verdict"]) == ["pass", "FAIL"]
    assert found.failed["figure"].item() == "RuntimeError: the method fell over"


def test_what_a_choice_of_options_refuses_is_not_applicable(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def picky(stage: Stage) -> Iterator[Figure]:
        if stage.resolved_options["cracks"] == "none":
            raise Unsupported("not with these options")
        yield Figure("fine", 0.0, "px", 1.0)

    monkeypatch.setattr(suite, "SCENES", scene_of(picky, variants=True))
    table = stability.run(tmp_path, methods=["chunked"], progress=False).table
    refused = table["figure"] == "Unsupported: not with these options"
    assert set(table["verdict"][refused]) == {"not_applicable"} and set(table["verdict"][~refused]) == {"pass"}


def test_what_default_options_refuse_is_a_failure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(stage: Stage) -> Iterator[Figure]:
        raise Unsupported("not at all")
        yield

    monkeypatch.setattr(suite, "SCENES", scene_of(refused))
    assert list(run_one(tmp_path).failed["figure"]) == ["Unsupported: not at all"]


def test_not_applicable_says_why(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def idle(stage: Stage) -> Iterator[Figure]:
        raise NotApplicable("there is nothing to see")
        yield

    monkeypatch.setattr(suite, "SCENES", scene_of(idle))
    found = run_one(tmp_path)
    assert list(found.table["verdict"]) == ["not_applicable"]
    assert found.table["figure"].item() == "there is nothing to see"


def test_a_method_that_accepts_no_source_has_a_row(tmp_path: Path) -> None:
    scene = Scene("s05", "on a planet", five, ("planet:2-degrees",), ("planet:2-degrees",))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(suite, "SCENES", (scene,))
        found = run_one(tmp_path)
    assert list(found.table["verdict"]) == ["not_applicable"]
    assert "accepts heightfield" in found.table["figure"].item()


def test_other_scenes_are_not_played_on_a_mesh_that_lacks_what_is_needed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def built(stage: Stage) -> Iterator[Figure]:
        yield Figure("levels", float(stage.tree.depth), "levels", 9.0)

    monkeypatch.setattr(Stage, "lacking", "a rim of 3 edges")
    monkeypatch.setattr(suite, "SCENES", (Scene("s05", "", built, ("mesh:one triangle",), ("mesh:one triangle",)),))
    table = stability.run(tmp_path, methods=["full"], short=True, progress=False).table
    assert table[["verdict", "figure"]].to_numpy().tolist() == [["not_applicable", "a rim of 3 edges"]]


def test_interrupted_run_stops_and_keeps_its_rows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def stopped(stage: Stage) -> Iterator[Figure]:
        raise KeyboardInterrupt
        yield

    monkeypatch.setattr(suite, "SCENES", scene_of(five, "s04") + scene_of(stopped))
    with pytest.raises(KeyboardInterrupt):
        run_one(tmp_path)
    assert list(stability.read(tmp_path)["figure"]) == ["fives"]


@pytest.mark.parametrize(
    ("values", "known"),
    [
        ({"methods": ["chunky"]}, "full"),
        ({"scenes": ["s99"]}, "s15"),
        ({"methods": []}, "full"),
        ({"scenes": []}, "s01"),
    ],
)
def test_unknown_names_list_the_known(tmp_path: Path, values: dict, known: str) -> None:
    with pytest.raises(InvalidInput, match=f"known: .*{known}"):
        stability.run(tmp_path / "new", short=True, progress=False, **values)
    assert not (tmp_path / "new").exists()


def test_a_file_in_the_way_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InvalidInput, match="is a file"):
        stability.run(tmp_path / "file", scenes=["s15"], short=True, progress=False)


# ---- by_nature.toml -------------------------------------------------------------------------------


def read_rows(tmp_path: Path, text: str) -> list[rules.Rule]:
    (tmp_path / "by_nature.toml").write_text(text)
    return rules.read(tmp_path / "by_nature.toml")


def row_of(scene: str = "s08", options: str = '{cracks = "none"}', method: str = "chunked", more: str = "") -> str:
    return (
        f'[[row]]\nmethod = "{method}"\noptions = {options}\nscene = "{scene}"\nreason = "a proof"\nlimit = 9\n{more}'
    )


def test_rows_are_read(tmp_path: Path) -> None:
    (rule,) = read_rows(tmp_path, row_of())
    assert rule == rules.Rule("chunked", {"cracks": "none"}, "s08", "a proof", 9.0)


@pytest.mark.parametrize("scene", ["s01", "s02", "s07", *(f"s{i}" for i in range(11, 17))])
@pytest.mark.parametrize("options", ["{}", '{cracks = "skirt"}', "{stream = false}"])
def test_no_default_fails_these_scenes_by_nature(tmp_path: Path, scene: str, options: str) -> None:
    with pytest.raises(InvalidInput, match=f"scene {scene} .* default options"):
        read_rows(tmp_path, row_of(scene, options))


def test_other_options_and_other_scenes_may(tmp_path: Path) -> None:
    assert len(read_rows(tmp_path, row_of("s01", '{morph = "formula4"}') + row_of("s04", "{}"))) == 2


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (row_of(method="chunky"), "chunky.*not known"),
        (row_of(options="{crack = 1}"), "no option crack"),
        (row_of(more="limits = 3"), "has limits"),
        (row_of().replace('reason = "a proof"', 'reason = " "'), "reason is empty"),
        (row_of().replace("limit = 9", 'limit = "9"'), "limit is a number"),
        (row_of().replace("limit = 9", ""), "lacks limit"),
        ("[[row]", "not valid TOML"),
    ],
)
def test_wrong_rows_are_refused(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(InvalidInput, match=message):
        read_rows(tmp_path, text)


def test_the_file_of_the_project_is_read() -> None:
    assert rules.file().is_file()
    rules.read()


# ---- scenes see what they are made for ------------------------------------------------------------


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Stage:
    return Stage(Bench("jacksboro", tmp_path_factory.mktemp("scenes")), "chunked", {}, True)


def worst(figures: Iterator[Figure]) -> float:
    return max(figure.value - figure.limit for figure in figures)


def test_still_camera_sees_a_cut_that_never_settles(stage: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    real, count = Stage.frame, iter(range(10**6))
    loose = lod.Budget(pixel_error=50.0)
    monkeypatch.setattr(Stage, "frame", lambda s, e, v, b: real(s, e, v, loose if next(count) % 2 else b))
    assert worst(motion.still_camera(stage)) == 97.0


def test_thresholds_see_a_cut_that_thrashes(stage: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    real, count = Stage.frame, iter(range(10**6))
    loose = lod.Budget(pixel_error=200.0)
    monkeypatch.setattr(Stage, "frame", lambda s, e, v, b: real(s, e, v, loose if next(count) % 2 else b))
    assert worst(motion.budget_thresholds(stage)) > 0


def test_history_sees_a_cut_that_remembers(stage: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    real, last = Stage.frame, {}

    def hysteretic(self: Stage, session: object, view: object, budget: object) -> object:
        kept = last.get(id(session))
        last[id(session)] = kept or real(self, session, view, budget)
        return last[id(session)]

    monkeypatch.setattr(Stage, "frame", hysteretic)
    assert worst(motion.history(stage)) == 20


def test_jitter_sees_a_flip_that_pops(stage: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    real, count = Stage.frame, iter(range(10**6))
    loose = lod.Budget(pixel_error=200.0)
    monkeypatch.setattr(Stage, "frame", lambda s, e, v, b: real(s, e, v, loose if next(count) % 2 else b))
    assert worst(motion.jitter(stage)) > 0


def test_nesting_sees_a_tighter_budget_that_draws_coarser(stage: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    real = Stage.pixel_error
    monkeypatch.setattr(Stage, "pixel_error", lambda s, value: real(s, 1.0 / value))
    assert worst(structure.errors_nest(stage)) > 0


@pytest.mark.parametrize("play", [structure.neighbours, structure.corners])
def test_neighbours_see_a_crack(stage: Stage, play: Callable[[Stage], Iterator[Figure]]) -> None:
    cracked = Stage(stage.bench, "chunked", {"cracks": "none"}, True)
    assert worst(play(cracked)) > 0


def test_neighbours_are_seen_from_where_cracks_show(stage: Stage) -> None:
    cracked = Stage(stage.bench, "chunked", {"cracks": "none"}, True)
    session, tree = cracked.session(), cracked.tree
    _, _, point, way = next(tree.edges())
    cut = tree.cut(session, [(point + 1e-3 * tree.leaf_side() * way, tree.depth)])
    for side in (way, -way):
        view = structure._near(cracked, point, side)
        assert cracked.examine(session, cut, view).crack_pixels > 0


def test_bounds_see_a_claim_of_a_quarter_of_the_truth(stage: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    assert worst(structure.bounds_hold(stage)) <= 0
    monkeypatch.setattr(lod.Cut, "predicted_px", property(lambda cut: 0.25 * cut.core.predicted_px))
    assert worst(structure.bounds_hold(stage)) > 0


def test_voids_see_a_curtain_and_a_hole_too_large() -> None:
    wanted = np.zeros((40, 40), bool)
    wanted[10:30, 10:30] = True
    assert structure._stray(wanted, wanted, 1) == 0
    curtain, hole = wanted.copy(), wanted.copy()
    curtain[0:9, 15] = True
    hole[15:20, 15:20] = False
    assert structure._stray(curtain, wanted, 1) > 0
    assert structure._stray(hole, wanted, 1) == 25
    assert structure._stray(np.roll(wanted, 1, axis=0), wanted, 1) == 0, "a pixel is within reach"


def test_sizes_without_samples_are_refused_and_nothing_else(tmp_path: Path) -> None:
    for name in fields.MADE:
        if name in fields.REFUSED:
            with pytest.raises(InvalidInput):
                fields.load(name)
        else:
            fields.load(name)


def test_a_mesh_may_be_refused_that_lacks_what_is_needed_and_with_counts_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def told(lacks: str, reason: str) -> float:
        def refuses(*_args: object, **_values: object) -> None:
            raise InvalidInput(reason)

        monkeypatch.setattr(Stage, "lacking", lacks)
        monkeypatch.setattr("lodlab.stability.stage.store_for", refuses)
        return worst(structure.any_mesh(Stage(Bench("mesh:open", tmp_path), "full", {}, True)))

    counted = "build: the method needs a closed mesh: this one has 48 edges of one triangle"
    assert told(counted, counted) == 0
    assert told(counted, "build: the method needs a closed mesh") == 1
    with pytest.raises(InvalidInput, match="48 edges"):  # a failure of the suite
        told("", counted)
    monkeypatch.undo()
    monkeypatch.setattr(Stage, "lacking", counted)
    assert worst(structure.any_mesh(Stage(Bench("mesh:one triangle", tmp_path), "full", {}, True))) == 1, "built"


def test_meshes_see_an_error_beyond_its_bound_and_a_crack(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    on_mesh = Stage(Bench("mesh:genus 1", tmp_path), "full", {}, True)
    assert worst(structure.any_mesh(on_mesh)) <= 0
    for column, value in (("excess", 1.0), ("flaws", 3.0)):
        with monkeypatch.context() as patch:
            patch.setattr(Stage, column, lambda *_args, v=value: v)
            assert worst(structure.any_mesh(on_mesh)) == value


def test_folds_see_what_lies_on_the_wrong_sheet(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where bounds do not tell, and, by its distance alone, where they do."""
    on_shells = Stage(Bench("mesh:nested shells", tmp_path), "full", {}, True)
    assert worst(structure.folded(on_shells)) <= 0
    real = Stage.examine

    def off(*arguments: object, **values: object) -> object:
        """The measurement, had a spot of the outer shell been drawn on the inner one."""
        found = real(*arguments, **values)
        told = {c: getattr(found, c) for c in ("hole_samples", "crack_edges", "drawn_triangles", *FLAWS)}
        pixels = found.measured_px_max + 2.0
        return types.SimpleNamespace(
            measured_px_max=pixels, measured_max=0.03, node_errors=lambda: ([0], np.array([0.03])), **told
        )

    monkeypatch.setattr(Stage, "examine", off)
    distance = "distance of the finest cut"
    beyond = {"measured beyond predicted and slack", "error beyond bound and slack", distance}
    assert {figure.name for figure in structure.folded(on_shells) if figure.value > figure.limit} == beyond
    monkeypatch.setattr(lod.Cut, "predicted_px", 1000.0)
    monkeypatch.setattr(Stage, "excess", lambda *_arguments: 0.0)
    assert [figure.name for figure in structure.folded(on_shells) if figure.value > figure.limit] == [distance]


def test_large_coordinates_see_vertices_that_tremble(stage: Stage) -> None:
    class Trembling:
        """A session whose vertices move by metres where the eye moves by a millimetre."""

        def __init__(self) -> None:
            self.session = stage.session()

        def capture(self, cut: object, view: object) -> object:
            found = self.session.capture(cut, view)
            return type("Captured", (), {"triangles": found.triangles + 200.0 * np.sin(1e3 * view.eye)})

    session, view = Trembling(), stage.views(3)[1]
    cut = session.session.select(view, lod.Budget(pixel_error=1.0))
    assert extremes._beyond_exact(stage, session, cut, view) > 0.5
    assert extremes._beyond_exact(stage, session.session, cut, view) < 0.5


def test_views_see_a_flaw_and_a_claim_that_does_not_hold(stage: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    views = extremes.views_nobody_tried(stage)
    session, view = stage.session(), views["fov 60"]
    cut = session.select(view, lod.Budget(pixel_error=0.5))
    assert extremes._answered(stage, session, cut, view)
    with monkeypatch.context() as patch:
        patch.setattr(lod.Cut, "predicted_px", property(lambda cut: 0.0))
        assert not extremes._answered(stage, session, cut, view)
    with monkeypatch.context() as patch:
        patch.setattr(lod.Cut, "triangles", property(lambda cut: cut.core.triangles - 1))
        assert not extremes._answered(stage, session, cut, view)
    monkeypatch.setattr(Stage, "flaws", lambda *args: 1.0)
    assert worst(extremes.extreme_views(stage)) == len(views)


def test_budgets_see_one_that_is_not_kept(stage: Stage) -> None:
    session, view = stage.session(), stage.over(height=0.1)
    cut = session.select(view, lod.Budget(pixel_error=0.01))
    assert extremes._kept_or_missed_openly(stage, session, cut, {"pixel_error": 0.01})
    assert not extremes._kept_or_missed_openly(stage, session, cut, {"triangles": cut.triangles - 1})
    assert not extremes._kept_or_missed_openly(stage, session, cut, {"nodes": cut.visible_nodes - 1})


def test_nothing_measured_is_no_figure() -> None:
    with pytest.raises(RuntimeError, match="nothing was measured"):
        Worst().figure("nothing", "px", 1.0)
    nan = Worst()
    nan.see(math.nan)
    nan.see(1.0)
    assert math.isnan(nan.figure("undefined", "px", 1.0).value)


def test_cuts_by_hand_are_as_asked(stage: Stage) -> None:
    tree = stage.tree
    leaf = tree.leaves[np.argmax(tree.level[tree.leaves])]
    spot = 0.5 * (tree.low + tree.high)[leaf, :2]
    rows = tree.refine([(spot, tree.depth)])
    assert leaf in rows
    stage.session().cut(tree.ids[rows], None)
    close = tree.balance(rows, 1)
    stage.session().cut(tree.ids[close], None)
    assert len(close) >= len(rows)
    for point, level in tree.corners():
        held = [n for n in np.flatnonzero(tree.level == level) if tree.holds(n, point)]
        assert len(held) >= 3


def test_tree_keeps_the_finest_and_the_coarsest_resolution() -> None:
    kind = [(n, "i8") for n in ("id", "parent")] + [(n, "i4") for n in ("level", "resolution")]
    kind += [("triangles", "i8"), ("error", "f8"), ("box_min", "f8", 3), ("box_max", "f8", 3)]
    nodes = np.zeros(3, dtype=kind)
    nodes["id"], nodes["parent"], nodes["resolution"] = [4, 4, 7], [-1, -1, 4], [0, 1, 0]
    nodes["level"], nodes["error"] = [0, 0, 1], [3.0, 8.0, 1.0]
    tree = Tree(nodes)
    assert tree.ids.tolist() == [4, 7] and tree.parent.tolist() == [-1, 0]
    assert tree.fine.tolist() == [0, 0] and tree.coarse.tolist() == [1, 0]
    assert tree.fine_error.tolist() == [3.0, 1.0] and tree.coarse_error.tolist() == [8.0, 1.0]
