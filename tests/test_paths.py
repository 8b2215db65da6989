# SPDX-License-Identifier: MIT
"""Camera paths: deterministic, above the ground, on any source; key frames and poses from files."""

from __future__ import annotations

import json
import math
import re
import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import lodlab
from lodlab import datasets
from lodlab.errors import InvalidInput
from lodlab.paths.ground import Ground
from lodlab.paths.path import CameraPath
from lodlab.paths.terrain import BUILT_IN, EYE_HEIGHT
from lodlab.sources.heightfield import HeightField


def _spike() -> np.ndarray:
    z = np.zeros((40, 60))
    z[20, 31] = 5000.0
    return z


def _holes() -> np.ndarray:
    z = np.hypot(*np.mgrid[-30:31, -40:41]) * 20
    z[10:40, :30] = np.nan
    z[0, 0] = np.nan
    return z


FIELDS = {
    "2x2": lambda: HeightField(np.array([[1.0, 2.0], [3.0, 9.0]])),
    "2x50": lambda: HeightField(np.random.default_rng(1).random((2, 50)) * 100),
    "flat": lambda: HeightField(np.full((17, 33), -250.0), spacing=0.5),
    "spike": lambda: HeightField(_spike(), spacing=(10, 20), origin=(5e5, -4e6)),
    "holes": lambda: HeightField(_holes()),
    "jacksboro": lambda: datasets.load("jacksboro"),
    "globe": lambda: HeightField(np.random.default_rng(2).random((19, 36)) * 9000 - 4000, planet=True),
    "small planet": lambda: HeightField(np.random.default_rng(3).random((30, 70)) * 20, planet=True, radius=100.0),
    "patch": lambda: HeightField(
        np.random.default_rng(4).random((30, 40)) * 3000, planet=True, degrees=(170.0, -60.0, 0.5, 0.5)
    ),
    "polar patch": lambda: HeightField(np.ones((20, 90)), planet=True, degrees=(0.0, 90.0, 2.0, 1.0)),
}


@pytest.fixture(scope="module", params=FIELDS)
def field(request) -> HeightField:
    return FIELDS[request.param]()


@pytest.mark.parametrize("name", BUILT_IN)
def test_built_in_paths_stay_above_the_ground(field, name):
    ground = Ground(field)
    path = CameraPath.named(name, field, frames=97)
    assert len(path) == 97 and path.name == name
    for frame in range(len(path)):
        pose = path.at(path.time(frame))
        clearance = ground.clearance(pose.eye)
        assert clearance > 0.5
        distance = float(np.linalg.norm(pose.target - pose.eye))
        assert pose.near == pytest.approx(max(0.1, 0.1 * min(clearance, distance)), rel=1e-6)
        assert np.isfinite([*pose.eye, *pose.target, *pose.up]).all()
        assert distance > pose.near
        view = path.view(frame, size=(640, 360), fov=70)
        assert (view.size, view.fov, view.near) == ((640, 360), 70, pose.near)


@pytest.mark.parametrize("name", BUILT_IN)
def test_a_frame_depends_on_its_share_of_the_path_alone(field, name):
    path = CameraPath.named(name, field, frames=5)
    again = CameraPath.named(name, field, frames=17)
    for frame in range(5):
        a, b = path.view(frame), again.view(4 * frame)
        assert np.array_equal(a.matrix, b.matrix) and tuple(a.eye) == tuple(b.eye)
        c = path.dense(4).view(4 * frame)
        assert np.array_equal(a.matrix, c.matrix)


def test_walk_is_at_eye_height_and_moves(field):
    ground = Ground(field)
    path = CameraPath.walk(field, frames=41)
    poses = [path.at(path.time(f)) for f in range(41)]
    for pose in poses:
        slack = 1e-6 * max(1.0, float(np.abs(pose.eye).max()) * 1e-2)  # of doubles at that distance
        assert ground.clearance(pose.eye) == pytest.approx(EYE_HEIGHT, abs=max(1e-6, slack * 1e-3))
        forward = pose.target - pose.eye
        slope = float(forward @ ground.up(pose.eye)) / float(np.linalg.norm(forward))
        assert abs(math.degrees(math.asin(slope))) < 25.01
    steps = [np.linalg.norm(b.eye - a.eye) for a, b in zip(poses, poses[1:], strict=False)]
    assert min(steps) > 0


def test_flyover_comes_down_and_does_not_jump():
    field = datasets.load("jacksboro")
    ground = Ground(field)
    path = CameraPath.flyover(field, frames=240)
    eyes = [path.at(path.time(f)).eye for f in range(240)]
    clearances = [ground.clearance(eye) for eye in eyes]
    assert clearances[0] > 10 * clearances[-1]
    assert clearances[0] > 0.3 * ground.extent
    steps = np.linalg.norm(np.diff(eyes, axis=0), axis=1)
    assert steps.max() < 0.03 * ground.extent
    assert (steps[1:] / steps[:-1]).max() < 1.5  # no jerk
    goal = ground.highest_relief()
    assert np.linalg.norm(eyes[-1][:2] - ground.place(goal, 0, 0, 0)[:2]) < 0.1 * ground.extent


def test_a_planet_is_flown_from_space_to_low_orbit_and_orbited_with_local_up():
    field = datasets.load("earth:planet=true")
    ground = Ground(field)
    path = CameraPath.flyover(field, frames=30)
    assert ground.altitude(path.at(0.0).eye) > field.radius
    assert ground.altitude(path.at(1.0).eye) < 0.05 * field.radius
    orbit = CameraPath.orbit(field, frames=30)
    for t in np.linspace(0, 1, 9):
        pose = orbit.at(float(t))
        assert pose.up == pytest.approx(pose.eye / np.linalg.norm(pose.eye))
        assert ground.altitude(pose.eye) == pytest.approx(0.3 * field.radius + ground.high)


def test_zoom_ends_near_the_surface_and_starts_with_the_whole():
    field = datasets.load("jacksboro")
    ground = Ground(field)
    path = CameraPath.zoom(field, frames=50)
    corners = [ground.place((r, c), 0, 0, ground.low) for r in (0, 343) for c in (0, 402)]
    matrix = path.view(0).matrix
    for corner in corners:
        clip = matrix @ [*corner, 1.0]
        assert np.abs(clip[:2] / clip[3]).max() <= 1.0
    assert ground.clearance(path.at(1.0).eye) < 6 * ground.spacing


def test_zoom_starts_with_the_whole_planet():
    field = datasets.load("earth:planet=true")
    path = CameraPath.zoom(field, frames=50)
    directions = np.random.default_rng(5).normal(size=(500, 3))
    points = directions / np.linalg.norm(directions, axis=1)[:, None] * (field.radius + 8000.0)
    clip = np.c_[points, np.ones(500)] @ path.view(0).matrix.T
    assert np.abs(clip[:, :2] / clip[:, 3:]).max() <= 1.0


def test_still_is_still():
    path = CameraPath.still(HeightField(_spike()), frames=4)
    assert len({path.view(f).matrix.tobytes() for f in range(4)}) == 1


@settings(max_examples=80, deadline=None)
@given(st.integers(2, 12), st.integers(2, 12), st.integers(0, 999), st.data())
def test_the_surface_is_that_of_the_drawn_triangles(rows, cols, seed, data):
    z = np.random.default_rng(seed).random((rows, cols))
    ground = Ground(HeightField(z, spacing=1.0))
    r, c = data.draw(st.integers(0, rows - 2)), data.draw(st.integers(0, cols - 2))
    weights = np.random.default_rng(seed).dirichlet([1, 1, 1])
    corners = [(r, c), (r, c + 1), (r + 1, c + 1)] if (r + c) % 2 == 0 else [(r, c), (r, c + 1), (r + 1, c)]
    if data.draw(st.booleans()):
        corners[1] = (r + 1, c) if (r + c) % 2 == 0 else corners[1]
        corners[0] = corners[0] if (r + c) % 2 == 0 else (r + 1, c + 1)
    row, col = (float(weights @ [k[i] for k in corners]) for i in (0, 1))
    expected = float(weights @ [np.float32(z[k]) for k in corners])
    assert ground.surface(row, col) == pytest.approx(expected, abs=1e-9)
    assert ground.height_below(ground.place((row, col), 0, 0, 50.0)) == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("name", ["globe", "patch", "2x50"])
def test_places_and_cells_are_inverse(name):
    ground = Ground(FIELDS[name]())
    for row in np.linspace(0.1, ground.rows - 1.1, 7):
        for col in np.linspace(0.1, ground.cols - 1.1, 9):
            point = ground.place((float(row), float(col)), 0.0, 0.0, 123.0)
            assert ground.cell_of(point) == pytest.approx((row, col), abs=1e-6)
            assert ground.altitude(point) == pytest.approx(123.0, abs=1e-6)


def test_outside_a_patch_the_nearest_edge_counts():
    ground = Ground(FIELDS["patch"]())  # longitudes 170 to 189.5
    for longitude, col in ((169.0, 0.0), (160.0, 0.0), (191.0, 39.0), (-168.0, 39.0), (180.0, 20.0), (-175.0, 30.0)):
        a, b = math.radians(longitude), math.radians(-65.0)
        point = 7e6 * np.array([math.cos(a) * math.cos(b), math.sin(a) * math.cos(b), math.sin(b)])
        assert ground.cell_of(point)[1] == pytest.approx(col)


# ---- bad values -------------------------------------------------------------------------------------


@pytest.mark.parametrize("frames", [0, -1, 1.5, "many", None, 10**7])
def test_frames_out_of_range(frames):
    with pytest.raises(InvalidInput, match="camera path: frames"):
        CameraPath.flyover(HeightField(_spike()), frames=frames)


def test_one_frame_is_the_start():
    field = HeightField(_spike())
    one = CameraPath.flyover(field, frames=1)
    assert len(one) == 1
    assert np.array_equal(one.view(0).matrix, CameraPath.flyover(field, frames=9).view(0).matrix)


def test_frames_and_times_outside_the_path():
    path = CameraPath.orbit(HeightField(_spike()), frames=3)
    for frame in (-1, 3, 0.5):
        with pytest.raises(InvalidInput, match="frame"):
            path.view(frame)
    for t in (-0.1, 1.1, math.nan, "0"):
        with pytest.raises(InvalidInput, match="t "):
            path.at(t)
    with pytest.raises(InvalidInput):
        path.view(0, size=(0, 720))
    with pytest.raises(InvalidInput):
        path.view(0, fov=171)
    with pytest.raises(InvalidInput, match="fov"):
        CameraPath.orbit(HeightField(_spike()), fov=0.5)


def test_unknown_paths_and_sources():
    with pytest.raises(InvalidInput, match="neither one of flyover, orbit, walk, zoom, still, flyby"):
        CameraPath.named("loop", HeightField(_spike()))
    with pytest.raises(InvalidInput, match="needs the source"):
        CameraPath.named("orbit", None)
    with pytest.raises(InvalidInput, match="ndarray is no height field"):
        CameraPath.walk(_spike())


# ---- key frames -------------------------------------------------------------------------------------

KEYS = [
    {"t": 0.0, "eye": [0, 0, 10], "target": [0, 10, 0], "fov": 60},
    {"t": 0.25, "eye": [10, 0, 20], "target": [0, 10, 5], "fov": 40},
    {"t": 1.0, "eye": [30, 10, 10], "target": [0, 20, 0], "up": [0, 1, 1], "fov": 80.0},
]


def test_keys_are_met_and_joined_smoothly():
    path = CameraPath.from_keys(KEYS, frames=5)
    assert path.at(0.25).eye == pytest.approx([10, 0, 20])
    assert path.view(1).fov == pytest.approx(40) and path.view(4).fov == pytest.approx(80)
    assert path.view(4, fov=33).fov == 33
    assert path.at(1.0).up == pytest.approx([0, 1, 1])
    h = 1e-6
    left = (path.at(0.25).eye - path.at(0.25 - h).eye) / h
    right = (path.at(0.25 + h).eye - path.at(0.25).eye) / h
    assert left == pytest.approx(right, abs=1e-2)
    assert right == pytest.approx([30, 10, 0], abs=1e-2)  # Catmull-Rom: the slope between the neighbours


def test_a_key_a_frame_brings_back_every_bit():
    eyes = np.random.default_rng(1).normal(scale=1e5, size=(49, 3))
    times = np.arange(49) / 48
    keys = [{"t": t, "eye": eye.tolist(), "target": [0, 0, 0]} for t, eye in zip(times, eyes, strict=True)]
    path = CameraPath.from_keys(keys, frames=49)
    assert np.array_equal([path.at(path.time(f)).eye for f in range(49)], eyes)


def test_keys_on_a_line_at_even_speed_give_a_line():
    keys = [{"t": t, "eye": (t, 2 * t, 3 * t), "target": (t, 2 * t, 3 * t - 1)} for t in (0.0, 0.1, 0.5, 0.9, 1.0)]
    path = CameraPath.from_keys(keys, frames=21)
    for f in range(21):
        t = path.time(f)
        assert path.at(t).eye == pytest.approx([t, 2 * t, 3 * t], abs=1e-12)
    assert path.view(3).fov == 60


def test_one_key_stands_still_and_times_are_stretched_to_the_path():
    assert CameraPath.from_keys(KEYS[:1], frames=3).at(0.7).eye.tolist() == [0, 0, 10]
    late = [dict(k, t=100 + 8 * k["t"]) for k in KEYS]
    assert CameraPath.from_keys(late).at(0.25).eye == pytest.approx([10, 0, 20])


def test_toml_and_json_files_agree(tmp_path):
    toml = "".join("[[key]]\n" + "".join(f"{name} = {value}\n" for name, value in key.items()) for key in KEYS)
    (tmp_path / "way.toml").write_text(toml)
    (tmp_path / "way.json").write_text(json.dumps({"key": KEYS}))
    a, b = CameraPath.load(tmp_path / "way.toml", frames=7), CameraPath.named(str(tmp_path / "way.json"), None, 7)
    assert a.name == b.name == "way" and len(a) == len(b) == 7
    for f in range(7):
        assert np.array_equal(a.view(f).matrix, b.view(f).matrix)


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ([], "no keys"),
        ([{"t": 0, "eye": [0, 0, 0]}], "key 1 has no target"),
        ([{"t": 0, "eye": [0, 0], "target": [0, 0, 1]}], "eye = \\[0, 0\\] is not three numbers"),
        ([{"t": 0, "eye": [0, 0, math.inf], "target": [0, 0, 1]}], "not finite"),
        ([{"t": 0, "eye": [0, 0, "a"], "target": [0, 0, 1]}], "not a number"),
        ([{"t": 0, "eye": [0, 0, 1], "target": [0, 0, 1]}], "same point"),
        ([dict(KEYS[0], up=[0, 0, 0])], "up is zero"),
        ([dict(KEYS[0], fov=171)], "fov = 171 is not within 1 to 170"),
        ([dict(KEYS[0], near=0)], "near = 0 is not positive"),
        ([dict(KEYS[0], speed=3)], "unknown 'speed'; known are t, eye"),
        ([KEYS[1], KEYS[0]], "t = 0 does not come after 0.25"),
        ([KEYS[0], {k: v for k, v in KEYS[1].items() if k != "fov"}], "key 2 has no fov"),
        (["key"], "is no table"),
        ("keys", "no keys"),
    ],
)
def test_keys_that_are_wrong(keys, words):
    with pytest.raises(InvalidInput, match=words):
        CameraPath.from_keys(keys)


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("a.toml", "[[key]\n", "not well-formed"),
        ("a.json", "{", "not well-formed"),
        ("a.json", "[1]", "holds no table"),
        ("a.json", "{}", "either 'key' or 'poses'"),
        ("a.json", '{"keys": []}', "unknown 'keys'"),
        ("a.json", '{"poses": [[1, 2], [3]]}', "not \\(N, 4, 4\\)"),
        ("a.toml", "key = []", "no keys"),
    ],
)
def test_files_that_are_wrong(tmp_path, name, text, words):
    (tmp_path / name).write_text(text)
    with pytest.raises(InvalidInput, match=words):
        CameraPath.load(tmp_path / name)
    with pytest.raises(InvalidInput, match="cannot read"):
        CameraPath.load(tmp_path / "missing.toml")


# ---- arrays of poses --------------------------------------------------------------------------------


def _look(eye, forward, up) -> np.ndarray:
    forward, up = np.asarray(forward, float), np.asarray(up, float)
    m = np.eye(4)
    m[:3, 2] = -forward / np.linalg.norm(forward)
    right = np.cross(forward, up)
    m[:3, 0] = right / np.linalg.norm(right)
    m[:3, 1] = np.cross(m[:3, 2], m[:3, 0])
    m[:3, 3] = eye
    return m


def test_poses_are_frames(tmp_path):
    poses = np.stack([_look((0, 0, 5 + i), (1, 0.1 * i, -0.5), (0, 0, 1)) for i in range(4)])
    path = CameraPath.from_array(poses)
    assert len(path) == 4
    for f in range(4):
        view = path.view(f)
        forward = np.asarray(view.target) - np.asarray(view.eye)
        assert tuple(view.eye) == (0, 0, 5 + f)
        assert forward / np.linalg.norm(forward) == pytest.approx(-poses[f, :3, 2])
        ahead = view.matrix @ [*(poses[f, :3, 3] - 7 * poses[f, :3, 2]), 1]
        assert ahead[:2] == pytest.approx([0, 0], abs=1e-9) and ahead[3] == pytest.approx(7)
    middle = path.at(0.5)
    assert middle.eye == pytest.approx([0, 0, 6.5])
    (tmp_path / "p.json").write_text(json.dumps({"poses": poses.tolist(), "fov": 50}))
    loaded = CameraPath.load(tmp_path / "p.json")
    assert len(loaded) == 4 and loaded.view(0).fov == 50
    assert np.array_equal(CameraPath.load(tmp_path / "p.json", fov=60).view(2).matrix, path.view(2).matrix)


def test_far_from_the_origin_a_pose_keeps_its_direction():
    pose = _look((6.4e6, -6.4e6, 1.0), (0.3, 0.4, -0.1), (0, 0, 1))
    view = CameraPath.from_array(pose[None]).view(0)
    forward = np.asarray(view.target) - np.asarray(view.eye)
    assert forward / np.linalg.norm(forward) == pytest.approx(-pose[:3, 2], abs=1e-9)


@pytest.mark.parametrize(
    ("poses", "words"),
    [
        (np.zeros((0, 4, 4)), "shape"),
        (np.eye(4), "shape"),
        (np.zeros((2, 4, 4)), "last row"),
        (np.eye(4)[None] * [[[1], [1], [-1], [1]]], "no rotation"),
        (np.full((1, 4, 4), np.nan), "not finite"),
        (np.full((1, 4, 4), "x"), "dtype"),
        (np.eye(4)[None] * 1j, "dtype complex"),
    ],
)
def test_poses_that_are_wrong(poses, words):
    with pytest.raises(InvalidInput, match=words):
        CameraPath.from_array(poses)
    with pytest.raises(InvalidInput, match="near"):
        CameraPath.from_array(np.eye(4)[None], near=-1)


def test_the_package_offers_paths():
    assert lodlab.CameraPath is CameraPath


def _needle(height: float) -> HeightField:
    """Smooth hills with one sample of `height`, and a pit of as much beside it."""
    y, x = np.mgrid[0:130, 0:130] / 33.0
    z = 1000 + 300 * np.sin(x * 1.7) * np.cos(y * 1.1) + 90 * np.sin(3.1 * x + 2.3 * y)
    if height:
        z[100:102, 90:93] = height
        z[30, 40] = -height
    return HeightField(z, spacing=30)


@pytest.mark.parametrize("name", BUILT_IN)
def test_one_outlier_does_not_capture_a_built_in_path(name):
    clean, pierced = (CameraPath.named(name, _needle(height), frames=9) for height in (0, 9999))
    for t in np.linspace(0, 1, 9):
        a, b = clean.at(float(t)), pierced.at(float(t))
        assert np.allclose(a.eye, b.eye, atol=15) and np.allclose(a.target, b.target, atol=15)


def test_a_summit_that_is_no_needle_is_aimed_at_however_rare():
    z = np.zeros((200, 200))
    z[60:81, 60:81] = 5000 - 400 * np.maximum(*np.abs(np.mgrid[-10:11, -10:11]))  # 1 % of a flat sea
    assert Ground(HeightField(z)).highest_relief() == pytest.approx((70, 70), abs=11)


def test_an_orbit_passes_above_an_outlier():
    z = np.zeros((100, 100))
    z[50, 99] = 1e6
    ground = Ground(HeightField(z, spacing=30))
    path = CameraPath.orbit(HeightField(z, spacing=30), frames=400)
    assert min(ground.clearance(path.at(path.time(f)).eye) for f in range(400)) > 0


def _looking(eye: tuple[float, float, float]) -> CameraPath:
    down = {"target": (eye[0], eye[1], 0.0), "up": (0, 1, 0)}
    return CameraPath.from_keys(
        [{"t": 0, "eye": eye, **down}, {"t": 1, "eye": (eye[0] + 9, *eye[1:]), **down}], frames=3
    )


@pytest.mark.parametrize(
    ("eye", "accuracy", "words"),
    [
        ((900.0, 9000.0, 5000.0), 2, "does not see the source in any of 2 measured frames; .* y 0 down to -1920 m"),
        ((900.0, 9000.0, 5000.0), 0, "does not see the source in any frame"),
        ((900.0, -900.0, 4e4), 2, "surface covers 0.* of the measured pictures"),
        ((900.0, -900.0, 4e3), 2, None),
        ((900.0, -900.0, 4e3), 0, None),
    ],
)
def test_a_path_that_sees_too_little_is_warned_of(tmp_path, eye, accuracy, words):
    field = datasets.load("fractal:size=65")
    store = lodlab.build(field, "chunked", tmp_path / "a.lod", progress=False)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        lodlab.fly(store, _looking(eye), {"pixel_error": 1.0}, size=(64, 48), accuracy_frames=accuracy, progress=False)
    said = [str(w.message) for w in caught if issubclass(w.category, UserWarning)]
    assert len(said) == (words is not None)
    assert words is None or re.search(words, said[0])


def test_compare_says_once_what_its_path_does_not_see():
    path = _looking((900.0, 9000.0, 5000.0))
    given = {"frames": 3, "size": (64, 48), "accuracy_frames": 2, "progress": False, "pixel_errors": [1.0, 4.0]}
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        lodlab.compare("fractal:size=65", methods=["chunked"], path=path, **given)
    assert sum("does not see the source" in str(w.message) for w in caught) == 1
