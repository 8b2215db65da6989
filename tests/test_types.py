# SPDX-License-Identifier: MIT
"""What a user passes by mistake: it works where the meaning is plain, else one typed error says the cure."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import numpy as np
import pytest

import lodlab as lod
from lodlab import cli
from lodlab.errors import InvalidInput

ROOT = Path(__file__).resolve().parents[1]
SHELL = "python/lodlab/cli"  # speaks to people at a command line only
ERRORS = ("InvalidInput", "StoreError", "Unsupported", "GLError")

SIZE = (48, 32)


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    return lod.build("fractal:size=33", "chunked", tmp_path_factory.mktemp("types") / "k.lod", progress=False)


@pytest.fixture(scope="module")
def view(store):
    return lod.CameraPath.still(store.source).view(0, SIZE)


def test_messages_of_python_and_of_the_core_name_no_arguments_of_the_command_line():
    for file in (f for f in (ROOT / "python/lodlab").rglob("*.py") if ROOT / SHELL not in f.parents):
        for call in (n for n in ast.walk(ast.parse(file.read_text())) if isinstance(n, ast.Call)):
            if getattr(call.func, "id", "") in ERRORS:
                texts = [n.value for n in ast.walk(call) if isinstance(n, ast.Constant) and isinstance(n.value, str)]
                # a command that is quoted whole is fine
                assert not [text for text in texts if re.search(r"(^|\W)--[a-z]", text) and "lodlab " not in text], file
    for file in (ROOT / "cpp").rglob("*.cpp"):
        thrown = re.findall(rf"throw (?:{'|'.join(ERRORS)})\([^;]*;", file.read_text())
        assert not [text for text in thrown if re.search(r"[ \"(]--[a-z]", text)], file


def test_each_side_names_its_own_arguments(tmp_path, capsys):
    with pytest.raises(lod.errors.StoreError, match='mode="force" replaces it'):
        for _ in range(2):
            store = lod.build("fractal:size=9", "chunked", tmp_path / "a.lod", progress=False)
    with pytest.raises(InvalidInput, match="at least one of pixel_error, triangles, nodes"):
        lod.fly(store, "still")
    with pytest.raises(InvalidInput, match="accuracy_frames is -1"):
        lod.fly(store, "still", {"pixel_error": 1}, accuracy_frames=-1)
    fly = ["fly", str(store.path), "--out", str(tmp_path / "run")]
    for words, text in (
        (["build", "fractal:size=9", "chunked", str(store.path)], "--force replaces it"),
        (fly, "at least one of --pixel-error, --triangles, --nodes"),
        ([*fly, "--pixel-error", "1", "--accuracy-frames", "-1"], "--accuracy-frames is -1"),
    ):
        assert cli.run(words) == 2
        assert text in capsys.readouterr().err


def test_a_store_may_be_named_by_its_file(store):
    run = lod.fly(str(store.path), "still", {"pixel_error": 2}, size=SIZE, frames=1, progress=False)
    assert run.summary["method"] == "chunked"
    assert lod.instrument.audit(store.path, progress=False).broken.empty


@pytest.mark.parametrize("given", ["fractal:size=33", None, 3])
def test_what_is_no_store_is_said_with_the_cure(given):
    with pytest.raises(InvalidInput, match=r"is no lodlab.Store and no file of one; lodlab.build"):
        lod.fly(given, "still", {"pixel_error": 2})


def test_one_method_and_one_budget_need_no_list():
    made = lod.compare(
        "fractal:size=33", methods="chunked", pixel_errors=2, path="still", frames=1, size=SIZE, accuracy_frames=0,
        progress=False,
    )  # fmt: skip
    assert made.runs == ["full", "chunked-px2"]


@pytest.mark.parametrize("given", [2.0, 2, "2", [2], None])
def test_what_is_no_budget_is_said_with_the_cure(given, store, view):
    with pytest.raises(InvalidInput, match=r"is no lodlab.Budget and no dict; as lodlab.Budget\(pixel_error="):
        store.select(view, given)
    if given is not None:
        with pytest.raises(InvalidInput, match="is no lodlab.Budget"):
            lod.fly(store, "still", given)


def test_a_dict_is_a_budget(store, view):
    cut = store.select(view, {"pixel_error": 2, "triangles": 10**6})
    assert (cut.nodes == store.select(view, lod.Budget(pixel_error=2, triangles=10**6)).nodes).all()


@pytest.mark.parametrize(("given", "meant"), [("px", "pixel_error"), ("triangle", "triangles"), ("n", "nodes")])
def test_a_mistyped_budget_names_the_one_that_is_meant(given, meant, store, view):
    for budget in (lambda: lod.Budget(**{given: 1}), lambda: store.select(view, {given: 1})):
        with pytest.raises(InvalidInput, match=rf"no argument '{given}'; .* \(did you mean {meant}\?\)"):
            budget()
    with pytest.raises(InvalidInput, match=f"no argument '{given}'"):
        lod.fly(store, "still", {given: 1})


@pytest.mark.parametrize("given", [640, "640x480", (640,), (640.5, 480)])
def test_a_size_is_two_whole_numbers(given, store):
    with pytest.raises(InvalidInput, match=r"view: size \(width, height\) .* (2 numbers|a whole number)"):
        lod.fly(store, "still", {"pixel_error": 1}, size=given)
    with pytest.raises(InvalidInput, match="size is"):
        lod.compare("fractal:size=33", methods="chunked", size=given)


def test_a_mistyped_argument_of_a_view_lists_those_there_are():
    with pytest.raises(InvalidInput, match="no argument 'far'; there are eye, target, up, fov, size, near"):
        lod.View((0, 0, 0), (1, 0, 0), far=1)


@pytest.mark.parametrize("given", [3, None, ["flyover"]])
def test_what_is_no_path_is_said(given, store):
    with pytest.raises(InvalidInput, match=r"is no CameraPath, no name \(flyover, "):
        lod.fly(store, given, {"pixel_error": 1})


def test_what_is_no_cut_or_view_is_said(store, view):
    cut = store.select(view, {"pixel_error": 2})
    for call in (store.draw, store.capture):
        with pytest.raises(InvalidInput, match="cut None is no lodlab.Cut"):
            call(None)
        with pytest.raises(InvalidInput, match="view 3 is no lodlab.View"):
            call(cut, 3)
    with pytest.raises(InvalidInput, match="is no lodlab.View; path.view"):
        store.select(lod.CameraPath.still(store.source), {"pixel_error": 2})


@pytest.mark.parametrize("given", ["1", 1.5, None])
def test_counts_are_whole_numbers(given, store):
    for name in ("accuracy_frames", "repeat"):
        with pytest.raises(InvalidInput, match=f"{name} is {given!r}; it is a whole number"):
            lod.fly(store, "still", {"pixel_error": 1}, **{name: given})


def test_a_mistyped_choice_names_the_one_that_is_meant(store, tmp_path, capsys):
    cut = store.select(lod.CameraPath.still(store.source).view(0, SIZE), {"pixel_error": 2})
    with pytest.raises(InvalidInput, match=r"show is 'shaded'; .*\(close to it: shade\)"):
        store.draw(cut, show="shaded")
    with pytest.raises(InvalidInput, match=r"'flyovr': .*\(close to it: flyover\)"):
        lod.fly(store, "flyovr", {"pixel_error": 1})
    assert cli.run(["render", str(store.path), str(tmp_path / "a.png"), "--show", "errors"]) == 2
    assert "it is one of shade, normal, level, wire, error (close to it: error)" in capsys.readouterr().err


def test_a_store_where_a_source_is_asked_is_said(store, tmp_path, capsys):
    assert cli.run(["compare", str(store.path), "--out", str(tmp_path / "run")]) == 2
    assert f"it is a store, not a source; lodlab info {store.path} says which" in capsys.readouterr().err
    with pytest.raises(InvalidInput, match="Store is no height field.*; its source is store.source"):
        lod.build(store, "chunked", tmp_path / "b.lod")


def test_a_frame_is_its_picture_as_an_array(store, view):
    frame = store.draw(store.select(view, {"pixel_error": 2}))
    assert np.asarray(frame) is frame.image or np.shares_memory(np.asarray(frame), frame.image)
    assert not np.shares_memory(np.array(frame), frame.image)
    assert (np.asarray(frame, dtype=np.float32) == frame.image).all()
    assert np.asarray(frame, dtype=np.float32).dtype == np.float32
    if int(np.__version__.split(".")[0]) >= 2:
        with pytest.raises(ValueError, match="copy"):
            np.array(frame, dtype=np.float32, copy=False)


def test_a_cut_says_by_how_little_its_budget_could_have_been_kept(store, view):
    missed = store.select(view, {"triangles": 1})
    least = f"budget not met: the least is {missed.least_triangles} triangles in {missed.least_nodes} nodes"
    assert missed.least_triangles and least in repr(missed)
    assert "budget" not in repr(store.select(view, {"pixel_error": 2}))
