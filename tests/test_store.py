# SPDX-License-Identifier: MIT
"""Stores from Python: build, interrupt, kill, resume, open, and what damaged files say."""

from __future__ import annotations

import os
import resource
import signal
import sqlite3
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import lodlab
from lodlab import _core
from lodlab.errors import GLError, InvalidInput, StoreError, Unsupported

# Enough work that a build can be stopped half-way: about a second with two idle cores.
LARGE = "fractal:size=1025,seed=3"
OPTIONS = {"leaf": 16}


@pytest.fixture(scope="module")
def field() -> lodlab.HeightField:
    rows, cols = np.mgrid[0:65, 0:81]
    heights = (20 * np.sin(rows / 7) * np.cos(cols / 9) + rows % 5).astype(np.float32)
    return lodlab.HeightField(heights, spacing=10.0)


@pytest.fixture(scope="module")
def large() -> lodlab.HeightField:
    return lodlab.datasets.load(LARGE)


def content(path: Path) -> str:
    return _core.open(path).info()["content_hash"]


def test_errors_are_the_builtin_kinds() -> None:
    assert issubclass(InvalidInput, ValueError)
    assert issubclass(StoreError, OSError)
    assert issubclass(GLError, RuntimeError)
    assert issubclass(Unsupported, RuntimeError)


def test_libraries_and_threads() -> None:
    versions = _core.libraries()
    assert {"sqlite", "xxhash", "tbb", "meshoptimizer", "glm", "pybind11", "epoxy"} <= set(versions)
    assert all(version[0].isdigit() for version in versions.values()), versions
    before = _core.thread_count()
    _core.set_thread_count(3)
    assert _core.thread_count() == 3
    _core.set_thread_count(0)
    assert _core.thread_count() == before
    with pytest.raises(InvalidInput, match="-1"):
        _core.set_thread_count(-1)


def test_methods_list_their_option_tables() -> None:
    listed = {method["name"]: method for method in _core.methods()}
    assert {"full", "chunked"} <= set(listed)
    for method in listed.values():
        assert set(method["accepts"]) <= {"heightfield", "planet", "mesh"}
        assert set(method["budgets"]) <= {"pixel_error", "triangles", "nodes"}
        names = [option["name"] for option in method["options"]]
        assert "finest_error" in names or method["name"] == "subdivision"  # which resamples as finely as its pattern
        for option in method["options"]:
            assert option["stage"] in ("build", "draw")
            assert option["type"] in ("bool", "int", "float", "choice", "meshes", "string")
            assert ("choices" in option) == (option["type"] == "choice")
            assert option["help"].endswith("."), option
            given = {option["name"]: option["default"]}
            values = _core.resolve_options(method["name"], option["stage"], given)
            assert values[option["name"]] == option["default"]


@pytest.mark.parametrize(
    ("given", "part"),
    [
        ({"laef": 3}, "unknown build option 'laef'"),
        ({"leaf": "many"}, "leaf = many"),
        ({"leaf": -1}, "leaf = -1"),
        ({"leaf": 2**70}, "leaf is beyond 64 bits"),
        ({"leaf": None}, "leaf is a NoneType"),
        ({"finest_error": float("nan")}, "finest_error = nan"),
    ],
)
def test_bad_options_are_named(given: dict, part: str) -> None:
    with pytest.raises(InvalidInput, match=part):
        _core.resolve_options("chunked", "build", given)


def test_numpy_scalars_are_options() -> None:
    values = _core.resolve_options("chunked", "build", {"leaf": np.int32(32), "finest_error": np.float32(0.5)})
    assert values["leaf"] == 32
    assert values["finest_error"] == 0.5
    with pytest.raises(InvalidInput, match="stage: 'bake' is not one of build, draw"):
        _core.resolve_options("chunked", "bake", {})
    with pytest.raises(InvalidInput, match="unknown method 'none'; known: full"):
        _core.resolve_options("none", "build", {})


def test_a_store_tells_what_it_is(field: lodlab.HeightField, tmp_path: Path) -> None:
    path = tmp_path / "Höhe 1.lod"
    store = _core.build(field.core, "chunked", path, OPTIONS, "new", None)
    info = store.info()
    assert info["format_version"] == 1
    assert info["complete"] is True
    assert info["method"] == store.method == "chunked"
    assert info["options"] == store.options
    assert info["options"]["leaf"] == 16
    assert info["source_hash"] == store.source_hash == field.hash()
    assert 0 < info["bytes"] < path.stat().st_size
    assert info["bytes_per_sample"] == pytest.approx(info["bytes"] / (65 * 81), rel=1e-12)
    assert info["bytes_per_vertex"] > 0
    assert len(info["content_hash"]) == 32
    assert store.frame["rows"] == 65 and store.frame["dx"] == 10.0
    nodes = store.nodes
    assert nodes.dtype.names == (
        "id", "parent", "level", "resolution", "triangles", "error", "box_min", "box_max",
    )  # fmt: skip
    assert nodes["box_min"].shape == (len(nodes), 3)
    assert (nodes["box_min"] <= nodes["box_max"]).all()
    for level in info["levels"]:
        of_level = nodes[nodes["level"] == level["level"]]
        assert level["nodes"] == len(of_level)
        assert level["triangles"] == of_level["triangles"].sum()
        assert level["error_max"] == of_level["error"].max()
    store.verify()
    assert list(tmp_path.iterdir()) == [path]
    again = _core.open(str(path))
    assert again.info() == info
    assert (again.nodes == nodes).all()


def test_equal_builds_have_equal_hashes(field: lodlab.HeightField, tmp_path: Path) -> None:
    def build(name: str, options: dict, threads: int = 0) -> str:
        _core.set_thread_count(threads)
        try:
            return _core.build(field.core, "chunked", tmp_path / name, options).info()["content_hash"]
        finally:
            _core.set_thread_count(0)

    hashes = {build(f"{threads}.lod", OPTIONS, threads) for threads in (1, 2, 4)}
    assert len(hashes) == 1
    assert build("other.lod", {"leaf": 32}) not in hashes


def test_modes(field: lodlab.HeightField, tmp_path: Path) -> None:
    path = tmp_path / "a.lod"
    _core.build(field.core, "full", path)
    for mode in ("new", "resume"):
        with pytest.raises(StoreError, match="exists already"):
            _core.build(field.core, "full", path, {}, mode)
    with pytest.raises(InvalidInput, match="'again' is not one of new, force, resume"):
        _core.build(field.core, "full", path, {}, "again")
    _core.build(field.core, "chunked", path, {}, "force")
    assert _core.open(path).method == "chunked"


def test_progress_is_called_here_and_may_stop_the_build(large: lodlab.HeightField, tmp_path: Path) -> None:
    path = tmp_path / "a.lod"
    calls: list[tuple[float, str, float]] = []

    def progress(stage: str, share: float) -> None:
        assert threading.current_thread() is threading.main_thread()
        calls.append((time.monotonic(), stage, share))
        if len(calls) == 3:
            raise ArithmeticError("enough")

    start = time.monotonic()
    with pytest.raises(ArithmeticError, match="enough"):
        _core.build(large.core, "chunked", path, OPTIONS, "new", progress)
    assert all(stage and 0.0 <= share <= 1.0 for _, stage, share in calls)
    assert calls[2][0] - start > 0.09  # at most about 20 a second, on however busy a machine
    assert not path.exists()


def test_control_c_stops_a_build_soon_and_it_resumes(large: lodlab.HeightField, tmp_path: Path) -> None:
    path = tmp_path / "a.lod"
    # From another thread, so that it arrives while the core builds and not inside our own callback.
    keys = threading.Timer(0.01, lambda: os.kill(os.getpid(), signal.SIGINT))
    shares: list[float] = []

    def progress(stage: str, share: float) -> None:
        if not shares:
            keys.start()
        shares.append(share)

    with pytest.raises(KeyboardInterrupt):
        _core.build(large.core, "chunked", path, OPTIONS, "new", progress)
    assert len(shares) < 5  # stopped within a few ticks, not at the end
    assert not path.exists()
    _core.build(large.core, "chunked", path, OPTIONS, "resume", None)
    whole = tmp_path / "whole.lod"
    _core.build(large.core, "chunked", whole, OPTIONS, "new", None)
    assert content(path) == content(whole)


KILLED = """
import sys, lodlab
from lodlab import _core
field = lodlab.datasets.load(sys.argv[1])
print("ready", flush=True)
_core.build(field.core, "chunked", sys.argv[2], {"leaf": 16}, "resume", None)
"""


def test_killed_five_times_a_build_resumes_or_says_incomplete(large: lodlab.HeightField, tmp_path: Path) -> None:
    path = tmp_path / "killed.lod"
    refusals = []
    start = time.monotonic()
    whole = _core.build(large.core, "chunked", tmp_path / "whole.lod", OPTIONS)
    took = time.monotonic() - start
    rng = np.random.default_rng(5)
    for _ in range(5):
        command = [sys.executable, "-c", KILLED, LARGE, str(path)]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as child:
            assert child.stdout is not None
            assert child.stdout.readline() == "ready\n"
            time.sleep(rng.uniform(0.1, 0.7) * took)
            child.kill()
        if path.exists():  # it was done before the signal
            assert content(path) == whole.info()["content_hash"]
            path.unlink()
            continue
        with pytest.raises(StoreError) as refused:
            _core.open(path)
        refusals.append(str(refused.value))
    assert refusals
    assert all("incomplete" in text or "does not exist" in text for text in refusals), refusals
    _core.build(large.core, "chunked", path, OPTIONS, "resume", None)
    assert content(path) == whole.info()["content_hash"]
    assert sorted(file.name for file in tmp_path.iterdir()) == ["killed.lod", "whole.lod"]


def test_a_second_builder_is_refused(large: lodlab.HeightField, tmp_path: Path) -> None:
    path = tmp_path / "a.lod"
    refused: list[str] = []

    def second(stage: str, share: float) -> None:
        if refused:
            return
        with pytest.raises(StoreError) as error:
            _core.build(large.core, "chunked", path, OPTIONS, "force", None)
        refused.append(str(error.value))
        with pytest.raises(StoreError, match="being built"):
            _core.open(path)

    _core.build(large.core, "chunked", path, OPTIONS, "new", second)
    assert f"being built by this process (pid {os.getpid()})" in refused[0]
    _core.open(path).verify()


def damage_truncated(whole: bytes) -> bytes:
    return whole[: len(whole) // 2]


def damage_newer(whole: bytes) -> bytes:
    return whole[:60] + (7).to_bytes(4, "big") + whole[64:]


def damage_flipped(whole: bytes) -> bytes:
    with sqlite3.connect(":memory:") as database:
        database.deserialize(whole)
        (largest,) = database.execute("SELECT bytes FROM page ORDER BY size DESC").fetchone()
    at = whole.index(largest[1000:1100])
    return whole[:at] + bytes([whole[at] ^ 16]) + whole[at + 1 :]


@pytest.mark.parametrize(
    ("damage", "part"),
    [
        (lambda whole: b"", "empty"),
        (lambda whole: b"\x89PNG\r\n" + bytes(5000), "not a lodlab store"),
        (damage_truncated, "truncated"),
        (damage_newer, "format version 7"),
        (damage_flipped, r"damaged: page \d+ of kind \d+ fails its checksum"),
    ],
)
def test_damage_is_named(
    field: lodlab.HeightField, tmp_path: Path, damage: Callable[[bytes], bytes], part: str
) -> None:
    path = tmp_path / "a.lod"
    _core.build(field.core, "full", path)
    path.write_bytes(damage(path.read_bytes()))
    with pytest.raises(StoreError, match=part) as error:
        _core.open(path).verify()
    assert str(path) in str(error.value)


def test_missing_files_and_directories(field: lodlab.HeightField, tmp_path: Path) -> None:
    with pytest.raises(StoreError, match="does not exist"):
        _core.open(tmp_path / "none.lod")
    with pytest.raises(StoreError, match="is a directory"):
        _core.open(tmp_path)
    with pytest.raises(StoreError, match="does not exist"):
        _core.build(field.core, "full", tmp_path / "no" / "a.lod")
    with pytest.raises(StoreError, match="is a directory"):
        _core.build(field.core, "full", tmp_path, {}, "force")


def test_disk_full(large: lodlab.HeightField, tmp_path: Path) -> None:
    path = tmp_path / "a.lod"
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1 << 20, hard))  # Python ignores SIGXFSZ: writes fail instead
    try:
        with pytest.raises(StoreError, match="a.lod"):
            _core.build(large.core, "chunked", path, OPTIONS)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert not path.exists()
    _core.build(large.core, "chunked", path, OPTIONS, "resume", None).verify()


def test_unwritable_directory(field: lodlab.HeightField, tmp_path: Path) -> None:
    folder = tmp_path / "locked"
    folder.mkdir(mode=0o555)
    user = os.geteuid()
    if user == 0:  # root may write anywhere; another user may not
        tmp_path.parent.chmod(0o755)
        tmp_path.chmod(0o755)
        tmp_path.parent.parent.chmod(0o755)
        os.seteuid(65534)
    try:
        with pytest.raises(StoreError, match="Permission denied"):
            _core.build(field.core, "full", folder / "a.lod")
    finally:
        os.seteuid(user)
    assert not list(folder.iterdir())


def test_threads_read_one_store(field: lodlab.HeightField, tmp_path: Path) -> None:
    store = _core.build(field.core, "chunked", tmp_path / "a.lod", OPTIONS)
    failures: list[BaseException] = []

    def read() -> None:
        try:
            for _ in range(10):
                store.verify()
        except BaseException as error:
            failures.append(error)

    threads = [threading.Thread(target=read) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not failures


def test_planets_are_refused_by_methods_that_do_not_accept_them(tmp_path: Path) -> None:
    planet = lodlab.datasets.load("earth:planet=true")
    accepts = {method["name"]: method["accepts"] for method in _core.methods()}
    assert "planet" not in accepts["chunked"]
    with pytest.raises(Unsupported, match="chunked does not accept a planet; it accepts heightfield"):
        _core.build(planet.core, "chunked", tmp_path / "a.lod")
    assert not list(tmp_path.iterdir())


def test_cuts_by_hand_take_whole_numbers_alone(field: lodlab.HeightField, tmp_path: Path) -> None:
    store = lodlab.build(field, "chunked", tmp_path / "a.lod", progress=False)
    for ids in ([0.5], [np.nan], ["a"], None, [[0]], [2**64 - 1]):
        with pytest.raises(InvalidInput, match="^cut: node ids"):
            store.cut(ids)
    with pytest.raises(InvalidInput, match="^cut: resolutions"):
        store.cut([0], [2**40])
    with pytest.raises(InvalidInput, match="no lodlab.Budget"):
        store.select(lodlab.View((0, 0, 900), (300, -300, 0)), None)


FORKED = """
import gc, os, sys
import numpy as np
import lodlab
from lodlab.errors import GLError

heights = np.add.outer(np.arange(200.0), np.arange(200.0)) % 37
store = lodlab.build(lodlab.HeightField(heights), "chunked", sys.argv[1], progress=False, leaf=8)
view = lodlab.View((0, 0, 900), (3000, -3000, 0), size=(64, 48))
session = store.session(stream=True)
cut = session.select(view, lodlab.Budget(pixel_error=1))
if sys.argv[2] == "drawn":
    session.draw(cut, view)
child = os.fork()
if child == 0:
    for call in (lambda: session.select(view, lodlab.Budget(pixel_error=1)), session.settle):
        try:
            call()
        except GLError as error:
            assert "after fork" in str(error)
        else:
            os._exit(3)
    del cut, session, store
    gc.collect()
    os._exit(0)
sys.exit(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""


@pytest.mark.parametrize("state", ["drawn", "selected"])
def test_a_forked_child_may_drop_a_session_but_not_use_it(tmp_path: Path, state: str) -> None:
    # The loader thread stays with the parent: joining it in the child would wait for ever or abort.
    command = [sys.executable, "-c", FORKED, str(tmp_path / "a.lod"), state]
    done = subprocess.run(command, capture_output=True, text=True, timeout=30)
    assert done.returncode == 0, done.stderr
