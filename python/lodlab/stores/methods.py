# SPDX-License-Identifier: MIT
"""The methods as their tables tell them: options of a stage, what they accept."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .. import _core
from ..errors import InvalidInput, Unsupported
from ..sources.base import Source


def methods() -> list[dict[str, Any]]:
    """All methods with their option tables, as `lodlab methods --json` prints them."""
    return _core.methods()


def method_table(name: str) -> dict[str, Any]:
    """One method's entry of `methods()`; InvalidInput lists the known ones."""
    known = _core.methods()
    for entry in known:
        if entry["name"] == name:
            return entry
    raise InvalidInput(f"method {name!r} is not known; there are {', '.join(m['name'] for m in known)}")


def options_of(name: str, stage: str) -> list[str]:
    """The names of a method's options of one stage, `build` or `draw`."""
    return [o["name"] for o in method_table(name)["options"] if o["stage"] == stage]


def still(method: str, options: Mapping[str, Any]) -> dict[str, Any]:
    """Draw options with streaming turned off where the method has it: records are drawn with all data."""
    known = {option["name"]: option for option in method_table(method)["options"]}
    if "stream" not in known:
        return dict(options)
    return {**options, "stream": False, "gpu_cache_mb": known["gpu_cache_mb"]["range"][1]}


def lacking(source: Source, method: str) -> str:
    """What a method needs of a mesh and this one lacks, a sentence with counts; empty: nothing."""
    return _core.lacking(method, source.core) if source.kind == "mesh" and method_table(method)["needs"] else ""


def check_deforms(method: str, path: str) -> None:
    """Unsupported when a method cannot follow a path that deforms the mesh."""
    if not method_table(method)["deforms"]:
        able = ", ".join(m["name"] for m in _core.methods() if m["deforms"]) or "none"
        raise Unsupported(f"path {path} deforms the mesh: method {method} has no control points ({able} has)")


def check_accepts(source: Source, method: str) -> None:
    """Unsupported when a method does not accept a source; InvalidInput, with counts, for a mesh that lacks what it
    needs."""
    kind, accepted = source.kind, method_table(method)["accepts"]
    if kind not in accepted:
        raise Unsupported(f"method {method} does not accept a {kind}; it accepts {', '.join(accepted)}")
    if fault := lacking(source, method):
        raise InvalidInput(fault)
