# SPDX-License-Identifier: MIT
"""The installed package: what a user and a type checker find in it."""

from __future__ import annotations

import ast
import importlib.metadata
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import lodlab
from lodlab import _core

ROOT = Path(__file__).resolve().parents[1]
SITE = Path(_core.__file__).parent


def stub_files() -> list[Path]:
    """The generated stubs, beside the module that they describe."""
    return [*SITE.glob("_core.pyi"), *SITE.glob("_core/**/*.pyi")]


def test_start_up_loads_no_package_before_it_is_used():
    heavy = ("pandas", "matplotlib", "scipy", "rasterio", "PIL", "trimesh")
    code = f"import sys, lodlab.cli; print([name for name in {heavy} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_version_is_that_of_pyproject():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert importlib.metadata.version("lodlab") == project["version"]
    assert lodlab.__version__ == project["version"]


def test_stubs_parse_and_name_every_public_class():
    stubs = stub_files()
    assert stubs, f"no type stubs beside {_core.__file__}"
    named = {
        node.name for stub in stubs for node in ast.walk(ast.parse(stub.read_text())) if isinstance(node, ast.ClassDef)
    }
    classes = {name for name, value in vars(_core).items() if isinstance(value, type) and not name.startswith("_")}
    assert {"HeightField", "View", "Budget", "Store", "Session", "Cut"} <= classes
    assert classes <= named


def test_package_is_marked_as_typed():
    assert (Path(lodlab.__file__).parent / "py.typed").exists()


def test_every_shader_is_installed_as_in_the_tree():
    tree = {p.relative_to(ROOT / "shaders"): p.read_bytes() for p in (ROOT / "shaders").rglob("*") if p.is_file()}
    installed = {p.relative_to(SITE / "shaders"): p.read_bytes() for p in (SITE / "shaders").rglob("*") if p.is_file()}
    assert tree
    assert installed == tree


@pytest.mark.parametrize("command", [["-m", "lodlab"], [str(Path(sys.executable).with_name("lodlab"))]])
def test_program_answers(command):
    words = [sys.executable, *command] if command[0] == "-m" else command
    done = subprocess.run([*words, "--help"], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    for name in ("doctor", "build", "compare", "bench"):
        assert name in done.stdout


def test_repository_text_holds_no_trailing_machine_paths():
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True)
    if listed.returncode:
        pytest.skip("not a git clone: nothing to list")
    text_kinds = {".py", ".cpp", ".h", ".md", ".toml", ".ipynb", ".sh", ".glsl", ".vert", ".frag", ".txt", ".csv"}
    needle = "/" + "work" + "/"
    for name in listed.stdout.splitlines():
        path = ROOT / name
        if path.suffix in text_kinds and path.exists():
            assert needle not in path.read_text(encoding="utf-8"), f"{name} names a path of one machine"


def test_rooms_reach_for_each_other_not_for_the_package():
    """import-linter takes `from .. import _core` for an import of the package, and so looks at none of these."""
    package = ROOT / "python" / "lodlab"
    rooms = {"_core", *(path.stem for path in package.iterdir())}
    for file in package.rglob("*.py"):
        depth = len(file.relative_to(package).parts)
        if file.parent == package / "cli" or file == package / "__init__.py":
            continue
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.Import):
                assert "lodlab" not in {alias.name.partition(".")[0] for alias in node.names}, file
            elif isinstance(node, ast.ImportFrom):
                assert node.level or node.module.partition(".")[0] != "lodlab", file
                if node.level == depth and node.module is None:
                    assert {alias.name for alias in node.names} <= rooms, file


def test_dir_shows_the_public_names_only():
    assert set(dir(lodlab)) - {"__doc__", "__version__"} == set(lodlab.__all__)
    assert all(hasattr(lodlab, name) for name in lodlab.__all__)


def test_a_notebook_without_widgets_gets_a_bar_as_text_and_no_warning():
    code = """
import builtins, sys, types, warnings
shell = types.SimpleNamespace(config={"IPKernelApp": {}})
sys.modules["IPython"] = types.SimpleNamespace(get_ipython=lambda: shell)
sys.modules["ipykernel.zmqshell"] = types.ModuleType("ipykernel.zmqshell")
sys.modules["ipywidgets"] = None
builtins.get_ipython = lambda: shell
import lodlab
from lodlab.progress import tqdm
print(tqdm.__module__)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.stderr, done.returncode) == ("", 0)
