# SPDX-License-Identifier: MIT
"""scripts/new_method.py: what it writes, and what it refuses. That it compiles and keeps the contract:
tests/adversaries/test_made_anew.py."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
REGISTRY = Path("cpp/method/registry.cpp")


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    (tmp_path / REGISTRY).parent.mkdir(parents=True)
    shutil.copy(ROOT / REGISTRY, tmp_path / REGISTRY)
    return tmp_path


def make(name: str, tree: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, ROOT / "scripts" / "new_method.py", name, "--tree", tree]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_three_folders_and_a_line_are_made(tree: Path) -> None:
    done = make("quick_tree", tree)
    assert done.returncode == 0, done.stderr
    files = {str(path.relative_to(tree)) for path in tree.rglob("*") if path.is_file()}
    room = [f"cpp/methods/quick_tree/{f}.cpp" for f in ("build", "select", "draw", "method")]
    room += ["cpp/methods/quick_tree/METHOD.md", "cpp/methods/quick_tree/quick_tree.h"]
    assert files == {*room, "shaders/quick_tree/quick_tree.vert", "tests/methods/test_quick_tree.py", str(REGISTRY)}
    assert not [f for f in files if "@name@" in (tree / f).read_text().lower()]
    assert "class TestQuickTree(MethodContract)" in (tree / "tests/methods/test_quick_tree.py").read_text()
    before, after = (ROOT / REGISTRY).read_text(), (tree / REGISTRY).read_text()
    assert "const Method& quick_tree_method();\n" in after and ", &quick_tree_method()}" in after
    assert after.replace("const Method& quick_tree_method();\n", "").replace(", &quick_tree_method()", "") == before


@pytest.mark.parametrize(
    ("name", "why"),
    [("Quick", "is no name"), ("2d", "is no name"), ("a__b", "is no name"), ("../a", "is no name"), ("full", "taken")],
)
def test_a_name_that_is_none_or_taken_writes_nothing(tree: Path, name: str, why: str) -> None:
    done = make(name, tree)
    assert done.returncode == 2 and why in done.stderr and "Traceback" not in done.stderr
    assert [path for path in tree.rglob("*") if path.is_file()] == [tree / REGISTRY]
    assert (tree / REGISTRY).read_text() == (ROOT / REGISTRY).read_text()


def test_a_method_is_not_made_twice(tree: Path) -> None:
    assert make("quick_tree", tree).returncode == 0
    kept = (tree / REGISTRY).read_text()
    assert make("quick_tree", tree).returncode == 2
    assert (tree / REGISTRY).read_text() == kept
