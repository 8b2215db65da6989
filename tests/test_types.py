# SPDX-License-Identifier: MIT
"""What a user passes by mistake: it works where the meaning is plain, else one typed error says the cure."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

import lodlab as lod
from lodlab import cli

ROOT = Path(__file__).resolve().parents[1]
SHELL = ("cli.py", "arguments.py", "verdicts.py")  # speak to people at a command line only
ERRORS = ("InvalidInput", "StoreError", "Unsupported", "GLError")


def test_messages_of_python_and_of_the_core_name_no_arguments_of_the_command_line():
    for file in (f for f in (ROOT / "python/lodlab").rglob("*.py") if f.name not in SHELL):
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
    with pytest.raises(lod.errors.InvalidInput, match="at least one of pixel_error, triangles, nodes"):
        lod.fly(store, "still")
    with pytest.raises(lod.errors.InvalidInput, match="accuracy_frames is -1"):
        lod.fly(store, "still", {"pixel_error": 1}, accuracy_frames=-1)
    fly = ["fly", str(store.path), "--out", str(tmp_path / "run")]
    for words, text in (
        (["build", "fractal:size=9", "chunked", str(store.path)], "--force replaces it"),
        (fly, "at least one of --pixel-error, --triangles, --nodes"),
        ([*fly, "--pixel-error", "1", "--accuracy-frames", "-1"], "--accuracy-frames is -1"),
    ):
        assert cli.run(words) == 2
        assert text in capsys.readouterr().err
