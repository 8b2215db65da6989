# SPDX-License-Identifier: MIT
"""Meshes that are deformed while they are flown round: what deforms them, how paths and run directories carry it, and
what cuts of a pose are measured against."""

from __future__ import annotations

import numpy as np
import pytest

import lodlab as lod
from lodlab import deform
from lodlab.cli.program import run
from lodlab.errors import InvalidInput, Unsupported
from lodlab.paths.deform import Deformation
from lodlab.paths.path import label_of, make_path, over_source, parts_of, path_text, poses_hash
from lodlab.runs.directory import RunDirectory
from lodlab.runs.identity import keep_parts, path_in, take_path

SIZE = (160, 120)
POINTS = np.random.default_rng(3).uniform((-4.0, -1.0, -2.0), (4.0, 1.0, 2.0), (300, 3))


@pytest.fixture(scope="module")
def ball():
    return lod.datasets.load("icosphere:level=3")


# ---- what deforms ---------------------------------------------------------------------------------


@pytest.mark.parametrize("name", deform.NAMES)
def test_built_in_ones_start_at_rest_are_smooth_and_scale_with_the_points(name):
    at = Deformation.of(name).at
    assert np.array_equal(at(0.0, POINTS), POINTS)
    for scale, offset in ((1.0, 0.0), (1000.0, 5e4)):
        there = at(0.7, scale * POINTS + offset)
        assert there == pytest.approx(scale * at(0.7, POINTS) + offset, rel=1e-9, abs=1e-9 * scale)
    steps = [np.linalg.norm(at((f + 1) / 100, POINTS) - at(f / 100, POINTS), axis=1).max() for f in range(100)]
    assert 0.0 < max(steps) < 0.15


def test_bending_and_twisting_keep_what_they_must():
    line = np.stack([np.linspace(-4.0, 4.0, 2001), np.zeros(2001), np.zeros(2001)], axis=1)
    box = np.concatenate([line, [[0.0, -1.0, -2.0], [0.0, 1.0, 2.0]]])
    bent = deform.bend(1.0, box)[:2001]
    assert np.linalg.norm(np.diff(bent, axis=0), axis=1).sum() == pytest.approx(8.0, rel=1e-6)
    ends = bent[1] - bent[0], bent[-1] - bent[-2]
    assert ends[0] @ ends[1] == pytest.approx(0.0, abs=1e-5)  # a quarter of a circle
    twisted = deform.twist(1.0, POINTS)
    assert np.array_equal(twisted[:, 0], POINTS[:, 0])
    middle = 0.5 * (POINTS.min(axis=0) + POINTS.max(axis=0))
    assert np.hypot(*(twisted - middle)[:, 1:].T) == pytest.approx(np.hypot(*(POINTS - middle)[:, 1:].T))


def test_arrays_are_poses_at_equal_steps_and_straight_between():
    poses = np.stack([POINTS, POINTS + 1.0, POINTS + 5.0])
    at = Deformation.of(poses).at
    for t, wanted in ((0.0, 0.0), (0.25, 0.5), (0.5, 1.0), (0.75, 3.0), (1.0, 5.0)):
        assert at(t, POINTS) == pytest.approx(POINTS + wanted)
    assert np.array_equal(Deformation.of(POINTS).at(0.3, POINTS), POINTS)


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ("bent", "none of bend, twist, wave"),
        ("no_such.npy", "cannot read no_such.npy"),
        (np.zeros((3, 4)), r"is \(3, 4\), not \(F, V, 3\)"),
        (np.zeros((0, 4, 3)), r"not \(F, V, 3\)"),
        (np.where(np.arange(12).reshape(4, 3) == 7, np.nan, 0.0), "not finite at pose 0, control point 2"),
        ([["a"] * 3], "no array of numbers"),
        (object(), "no array of numbers"),
    ],
)
def test_what_cannot_deform_is_refused(value, said):
    with pytest.raises(InvalidInput, match=said):
        Deformation.of(value)


@pytest.mark.parametrize(
    ("function", "said"),
    [
        (lambda t, rest: rest[:-1], r"t = 0.5 it is \(299, 3\), not \(300, 3\)"),
        (lambda t, rest: np.where(np.arange(300)[:, None] == 8, np.inf, rest), "control point 8 is not finite"),
        (lambda t, rest: None, r"it is \(\), not"),
        (lambda t, rest: "x", "no array"),
    ],
)
def test_what_a_function_says_is_checked(function, said):
    with pytest.raises(InvalidInput, match=said):
        Deformation.of(function).at(0.5, POINTS)


# ---- paths ----------------------------------------------------------------------------------------


def test_the_text_of_a_path_may_say_what_deforms():
    assert parts_of("orbit") == ("orbit", "")
    assert parts_of("orbit+bend") == ("orbit", "bend")
    assert parts_of("a+b/keys.toml+poses/a+b.npy") == ("a+b/keys.toml", "poses/a+b.npy")
    assert parts_of("my+keys.toml") == ("my+keys.toml", "")
    assert label_of("paths/keys.toml+paths/poses.npy") == ("keys", "poses")
    assert over_source("orbit+bend") and not over_source("keys.toml+bend")
    assert path_text("orbit+wave") == "orbit+wave"


def test_a_path_carries_what_deforms(ball):
    path = make_path("orbit+bend", ball, 5, None)
    assert (path.name, path.deform.name) == ("orbit+bend", "bend")
    assert np.array_equal(path.control_positions(0.5, POINTS), deform.bend(0.5, POINTS))
    assert path.dense(2).deform is path.deform
    plain = path.with_deform(None)
    assert plain.name == "orbit" and plain.deform is None and plain.control_positions(0.5, POINTS) is None
    assert path.with_deform("twist").name == "orbit+twist"
    views = list(path.views(SIZE))
    hashes = {poses_hash(views, made.deform) for made in (plain, path, path.with_deform("wave"))}
    assert len(hashes) == 3


def test_a_function_has_no_hash_until_it_is_sampled():
    made = Deformation.of(lambda t, rest: rest + t)
    with pytest.raises(InvalidInput, match="a function has no hash"):
        made.hash()
    sampled = made.sampled(POINTS, 4)
    assert sampled.poses.shape == (4, 300, 3) and len(sampled.hash()) == 32
    assert sampled.at(1.0, POINTS) == pytest.approx(POINTS + 1.0)
    assert Deformation.of("bend").sampled(POINTS, 4).poses is None


def test_a_run_directory_keeps_what_deforms(ball, tmp_path):
    file = tmp_path / "elsewhere" / "sway.npy"
    file.parent.mkdir()
    np.save(file, np.stack([POINTS, POINTS + 1.0]))
    with RunDirectory(tmp_path / "run") as directory:
        text = keep_parts(directory, f"orbit+{file}", None)
        assert text == "orbit+paths/sway.npy"
        assert keep_parts(directory, "orbit+bend", None) == "orbit+bend"
        memory = lod.CameraPath.orbit(ball, 3).with_deform(np.stack([POINTS, POINTS + 2.0]))
        assert take_path(directory, memory, [ball], SIZE, None) == "orbit+paths/poses.npy"
        with pytest.raises(InvalidInput, match="a function has no hash"):
            take_path(directory, memory.with_deform(lambda t, rest: rest), [ball], SIZE, None)
    again = make_path(path_in(tmp_path / "run", text), ball, 3, None)
    assert again.name == "orbit+sway"
    assert again.control_positions(1.0, POINTS) == pytest.approx(POINTS + 1.0)


# ---- a mesh that moves -----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def blob():
    return lod.datasets.load("blob:size=24")


@pytest.fixture(scope="module")
def store(blob, tmp_path_factory):
    return lod.build(
        blob, "subdivision", tmp_path_factory.mktemp("pose") / "a.lod", degree=9, target=200, progress=False
    )


BUDGET = {"pixel_error": 2.0}


@pytest.mark.parametrize("name", deform.NAMES)
def test_what_is_drawn_follows_the_pose_without_cracks(blob, store, name):
    path = lod.CameraPath.orbit(blob, 4).with_deform(name)
    made = lod.fly(store, path, BUDGET, size=SIZE, accuracy_frames=4, progress=False)
    rows = made.frames
    assert (rows["crack_edges"] == 0).all() and (rows["capture_mismatch_pixels"] == 0).all()
    assert not rows["promises_bound"][1:].any()
    assert rows["promises_bound"][0]  # at rest
    assert (rows["measured_px_max"] <= 2.0 * BUDGET["pixel_error"]).all()  # nothing is promised, and much is kept
    assert rows["pop_px_max"].isna().all()  # another pose is no pop
    assert made.name == f"{name}-subdivision-px2" and set(rows["path"]) == {f"orbit+{name}"}
    assert rows["psnr_db"].min() > 25.0


def test_at_rest_a_pose_changes_nothing(blob, store):
    view = lod.CameraPath.orbit(blob, 3).view(0, SIZE)
    plain, posed = store.select(view, BUDGET), store.select(view, BUDGET, store.control_positions)
    assert posed.promises_bound and posed.predicted_px == plain.predicted_px and posed.digest == plain.digest
    assert np.array_equal(store.capture(plain, view).triangles, store.capture(posed, view).triangles)
    assert np.array_equal(posed.control_positions, store.control_positions)


def test_a_rigid_motion_moves_what_is_drawn(blob, store):
    """The eye moves along: the same triangles there, as exactly as floats have them."""
    rest = store.control_positions
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    view = lod.CameraPath.orbit(blob, 3).view(0, SIZE)
    moved = lod.View(tuple(turn @ view.eye), tuple(turn @ view.target), fov=view.fov, size=SIZE, near=view.near)
    plain = store.select(view, BUDGET)
    posed = store.select(moved, BUDGET, rest @ turn.T)
    assert posed.triangles == pytest.approx(plain.triangles, rel=0.01)
    row = lod.fly(store, lod.CameraPath.orbit(blob, 1), BUDGET, size=SIZE, deform=rest @ turn.T, progress=False).frames
    still = lod.fly(store, lod.CameraPath.orbit(blob, 1), BUDGET, size=SIZE, progress=False).frames
    assert row["measured_max"][0] < 2.0 * still["measured_max"][0]


def test_a_cut_remembers_its_pose(blob, store):
    view = lod.CameraPath.orbit(blob, 3).view(1, SIZE)
    bent = deform.bend(1.0, store.control_positions)
    plain, posed = store.select(view, BUDGET), store.select(view, BUDGET, bent)
    assert posed.digest != plain.digest
    there = store.capture(posed, view).triangles
    assert not np.array_equal(there, store.capture(plain, view).triangles)
    assert np.array_equal(there, store.capture(posed, view).triangles)
    assert np.abs(there).max() < 2.0 * blob.extent


@pytest.mark.parametrize("pipeline", ["compute", "geometry"])
def test_the_twin_says_what_a_pose_draws(blob, store, pipeline):
    session = store.session(pipeline=pipeline)
    rest, view = store.control_positions, lod.CameraPath.orbit(blob, 3).view(1, SIZE)
    for pose in (deform.twist(1.0, rest), rest, deform.wave(0.8, rest), None):
        for budget in (lod.Budget(pixel_error=1.0), lod.Budget(triangles=3000)):
            cut, cost = session.core.time_frame(view, budget, control_positions=pose)
            assert cut.triangles == cost["triangles"] > 0
            assert cut.budget_met or budget.triangles is None


def test_the_instrument_measures_against_the_deformed_source(blob, store):
    """As `measure` does what was captured against a mesh of its own."""
    view = lod.CameraPath.orbit(blob, 2).view(1, SIZE)
    bent = deform.bend(1.0, store.control_positions)
    cut = store.select(view, BUDGET, bent)
    source = store.deformed(bent)
    assert np.array_equal(source.faces, blob.faces)
    assert np.abs(store.deformed(store.control_positions).positions - blob.positions).max() < 1e-12
    wanted = lod.measure(store.capture(cut, view), source, view)
    made = lod.fly(
        store, lod.CameraPath.orbit(blob, 2), BUDGET, size=SIZE, deform="bend", accuracy_frames=2, progress=False
    )
    for column in ("measured_max", "measured_rms", "measured_px_max", "measured_px_p99", "crack_edges", "psnr_db"):
        assert made.frames[column][1] == pytest.approx(wanted[column], rel=1e-4)
    assert lod.measure(store.capture(cut, view), blob)["measured_max"] > 5.0 * wanted["measured_max"]


@pytest.mark.parametrize("first", ["inverted_triangles", "crack_edges", "measured_max"])
def test_any_figure_of_a_pose_may_be_the_first(blob, store, first):
    """What is not promised is taken as it is measured, before many threads ask for it."""
    from lodlab import _core

    instrument, view = _core.Instrument(blob.core), lod.CameraPath.orbit(blob, 2).view(1, SIZE)
    cut = store.select(view, {"pixel_error": 0.2}, deform.twist(1.0, store.control_positions))
    measured = instrument.examine(store.default_session.core, cut.core, view)
    assert getattr(measured, first) >= 0 and measured.inverted_triangles == measured.crack_edges == 0


def test_a_mesh_of_a_pose_has_the_colours_of_its_source(blob, tmp_path):
    painted = lod.Mesh(blob.positions, blob.faces, (blob.positions > 0.0) * np.uint8(255))
    store = lod.build(painted, "subdivision", tmp_path / "a.lod", degree=9, target=200, progress=False)
    path = lod.CameraPath.orbit(painted, 2)
    plain = store.select(path.view(0, SIZE), BUDGET).to_trimesh()
    moved = store.control_positions + [100.0, 0.0, 0.0]
    view = lod.View(path.view(0).eye + [100.0, 0.0, 0.0], path.view(0).target + [100.0, 0.0, 0.0], size=SIZE)
    far = store.select(view, BUDGET, moved).to_trimesh()
    share = [np.mean(np.asarray(mesh.visual.vertex_colors)[:, :3], axis=0) for mesh in (plain, far)]
    assert share[1] == pytest.approx(share[0], abs=10.0)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda p: p[:-1], "control_positions is .* not .* float64"),
        (lambda p: p[:, :2], "control_positions is"),
        (lambda p: np.where(np.arange(len(p))[:, None] == 3, np.nan, p), "control position 3 is nan"),
        (lambda p: p * 1e35, "it is a number within 1e30"),
        (lambda p: "x", "no array of numbers"),
    ],
)
def test_no_pose_is_refused(blob, store, change, said):
    view = lod.CameraPath.orbit(blob, 3).view(0, SIZE)
    for take in (lambda pose: store.select(view, BUDGET, pose), store.deformed):
        with pytest.raises(InvalidInput, match=said):
            take(change(store.control_positions))


def test_a_pose_that_folds_faces_over_is_drawn_and_told_of_once(blob, store):
    middle = np.asarray(blob.bounds).mean(axis=0)[0]

    def fold(t, rest):
        return np.where([True, False, False], middle - np.abs(rest - middle) * t - (rest - middle) * (t - 1.0), rest)

    path = lod.CameraPath.orbit(blob, 3)
    with pytest.warns(UserWarning, match=r"the pose folds \d+ control faces over, the first is \d+") as told:
        made = lod.fly(store, path, BUDGET, size=SIZE, deform=fold, accuracy_frames=3, progress=False)
    assert len([w for w in told if "folds" in str(w.message)]) == 1
    assert not made.frames["promises_bound"][2] and (made.frames["crack_edges"] == 0).all()


def test_a_reference_of_another_pose_is_refused(blob, store):
    from lodlab.instrument.yardstick import Yardstick

    yardstick = Yardstick(blob, progress=False)
    view = lod.CameraPath.orbit(blob, 3).view(1, SIZE)
    rest = store.control_positions
    cuts = [store.select(view, BUDGET, pose) for pose in (None, deform.bend(1.0, rest), deform.twist(1.0, rest))]
    references = [yardstick.reference(view, cut.core) for cut in cuts]
    instrument, session = yardstick.instrument(), store.default_session.core
    for i, cut in enumerate(cuts):
        for j, reference in enumerate(references):
            if i == j:
                measured = instrument.examine(session, cut.core, view, reference)
                assert measured.psnr_db > 25.0
            else:
                with pytest.raises(InvalidInput, match="the reference is of another pose"):
                    instrument.examine(session, cut.core, view, reference)


def test_a_run_directory_has_runs_at_rest_and_deformed(blob, store, tmp_path):
    path = lod.CameraPath.orbit(blob, 3)
    options = {"size": SIZE, "accuracy_frames": 2, "out": tmp_path / "run", "progress": False}
    sway = store.control_positions + np.linspace(0.0, 0.2, 3)[:, None, None]
    for deformation in (None, "twist"):
        lod.fly(store, path, BUDGET, deform=deformation, **options)
    made, again = (lod.fly(store, path, BUDGET, deform=sway, **options) for _ in range(2))
    assert again.name == made.name and again.frames["triangles"].tolist() == made.frames["triangles"].tolist()
    runs = lod.Sweep.load(tmp_path / "run")
    assert set(runs.summary["path"]) == {"orbit", "orbit+twist", "orbit+paths/poses.npy"}
    assert len(set(runs.summary["run"])) == len(set(runs.summary["poses_hash"])) == 3
    read = lod.runs.run.load(tmp_path / "run", next(n for n in runs.summary["run"] if "poses" in n))
    assert read.image(2, "normal").image.shape == (SIZE[1], SIZE[0], 4)  # flown again from what the directory keeps


# ---- methods that deform nothing --------------------------------------------------------------------


def test_a_method_without_control_points_says_so(ball, tmp_path):
    store = lod.build(ball, "full", tmp_path / "full.lod", progress=False)
    with pytest.raises(Unsupported, match="method full has no control points"):
        _ = store.control_positions
    path = lod.CameraPath.orbit(ball, 2)
    with pytest.raises(Unsupported, match="method full has no control points"):
        store.select(path.view(0, SIZE), {"pixel_error": 1.0}, control_positions=POINTS)
    assert store.select(path.view(0, SIZE), {"pixel_error": 1.0}).control_positions is None
    with pytest.raises(Unsupported, match=r"orbit\+bend deforms the mesh: method full"):
        lod.fly(store, path, deform="bend", progress=False)
    with pytest.raises(Unsupported, match="method discrete has no control points"):
        lod.sweep(
            {"sources": ["icosphere:level=3"], "paths": ["orbit+wave"], "methods": ["discrete"],
             "pixel_errors": [1.0]}, progress=False,
        )  # fmt: skip
    with pytest.raises(Unsupported, match="fit: path orbit.twist deforms"):
        lod.fit(ball, "discrete", tmp_path / "fit.lod", pixel_error=1.0, path="orbit+twist", progress=False)


def test_the_command_line_deforms(store, tmp_path, capsys):
    file, path = tmp_path / "sway.npy", str(store.path)
    np.save(file, store.control_positions[None] + np.linspace(0.0, 0.3, 2)[:, None, None])
    common = ["--frames", "2", "--size", "64x48", "--pixel-error", "4", "--accuracy-frames", "1", "--images", "none"]
    for name, told in (("wave", "wave-subdivision-px4"), (str(file), "sway-subdivision-px4")):
        assert run(["fly", path, "--out", str(tmp_path / told), "--deform", name, *common]) == 0
        assert told in capsys.readouterr().out
    picture = tmp_path / "a.png"
    assert run(["render", path, str(picture), "--path", "orbit+bend", "--at", "1", "--size", "64x48"]) == 0
    assert picture.exists()
    assert run(["fly", path, "--out", str(tmp_path / "no"), "--deform", "bent", *common]) == 2
    assert "none of bend, twist, wave" in capsys.readouterr().err
