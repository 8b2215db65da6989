#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Makes a new method: its three folders and its line in the registry. It builds, and passes the contract.

    scripts/new_method.py NAME

What is made is a uniform grid (`scripts/new_method/*.in`): every node at the one resolution that the budget asks for.
It keeps every law, so that whatever breaks one afterwards is what was changed last. NAME: lower case, as in C++.
"""

from __future__ import annotations

import argparse
import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
TEMPLATES = Path(__file__).resolve().parent / "new_method"
PLACES = {
    "METHOD.md.in": "cpp/methods/@name@/METHOD.md",
    "grid.h.in": "cpp/methods/@name@/@name@.h",
    "build.cpp.in": "cpp/methods/@name@/build.cpp",
    "select.cpp.in": "cpp/methods/@name@/select.cpp",
    "draw.cpp.in": "cpp/methods/@name@/draw.cpp",
    "method.cpp.in": "cpp/methods/@name@/method.cpp",
    "grid.vert.in": "shaders/@name@/@name@.vert",
    "test.py.in": "tests/methods/test_@name@.py",
}
REGISTRY = "cpp/method/registry.cpp"


def make(name: str, tree: Path) -> list[Path]:
    """Writes the files into a source tree; their paths. ValueError when the name is none, or taken."""
    if not re.fullmatch(r"[a-z][a-z0-9]*(_[a-z0-9]+)*", name):
        raise ValueError(f"{name!r} is no name: lower case letters, digits and single underscores")
    files = {source: tree / place.replace("@name@", name) for source, place in PLACES.items()}
    registry = (tree / REGISTRY).read_text()
    taken = [path for path in files.values() if path.exists()]
    if taken or f" {name}_method()" in registry or (tree / "shaders" / name).exists():
        raise ValueError(f"{name} is taken: {taken[0] if taken else tree / REGISTRY}")
    title = "".join(part.capitalize() for part in name.split("_"))
    for source, path in files.items():
        path.parent.mkdir(parents=True, exist_ok=True)
        text = (TEMPLATES / source).read_text()
        path.write_text(text.replace("@name@", name).replace("@Name@", title))
    (tree / REGISTRY).write_text(register(name, registry))
    return [*files.values(), tree / REGISTRY]


def register(name: str, text: str) -> str:
    """The registry with one method more, last. ValueError when it is not as this script knows it."""
    declared = list(re.finditer(r"^const Method& \w+_method\(\);\n", text, re.M))
    listed = re.search(r"return \{([^}]*)\};", text)
    if not declared or not listed:
        raise ValueError(f"{REGISTRY} does not look as expected: add {name}_method() by hand")
    text = text[: listed.end(1)] + f", &{name}_method()" + text[listed.end(1) :]
    return text[: declared[-1].end()] + f"const Method& {name}_method();\n" + text[declared[-1].end() :]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("name", metavar="NAME")
    parser.add_argument("--tree", type=Path, default=ROOT, help="the source tree (default: this one)")
    given = parser.parse_args()
    try:
        made = make(given.name, given.tree)
    except (ValueError, OSError) as error:
        print(f"new_method: {error}", file=sys.stderr)
        return 2
    for path in made:
        print(path)
    print(f"next: make setup, then .venv/bin/python -m pytest tests/methods/test_{given.name}.py")
    return 0


if __name__ == "__main__":
    sys.exit(main())
