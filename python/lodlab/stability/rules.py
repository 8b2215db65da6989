# SPDX-License-Identifier: MIT
"""What a method fails by nature: rows of `tests/stress/by_nature.toml`, each with a reason and a limit of its own.

Nobody hides a failure: a row names the paper's section or the proof, its figure counts as `by_nature` up to the
row's limit, and as FAIL beyond it. Some scenes no method may fail with its default options; rows for those are
refused when the file is read.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InvalidInput
from ..runs.toml import read_config
from ..stores.methods import method_table

NEVER_BY_DEFAULT = ("s01", "s02", "s07", "s11", "s12", "s13", "s14", "s15", "s16", "s20")
KEYS = ("method", "options", "scene", "reason", "limit")
PASS, BY_NATURE, NOT_APPLICABLE, FAIL = "pass", "by_nature", "not_applicable", "FAIL"
_RANK = {NOT_APPLICABLE: 0, PASS: 1, BY_NATURE: 2, FAIL: 3}


@dataclass(frozen=True)
class Rule:
    """One row. `options`: those that it is for, at these values; `figure`: of the scene's, None for all of them."""

    method: str
    options: Mapping[str, Any]
    scene: str
    reason: str
    limit: float
    figure: str | None = None

    def covers(self, method: str, options: Mapping[str, Any], scene: str, figure: str) -> bool:
        """Whether it is about this figure of a run under these options (all of them, defaults written out)."""
        return (
            (self.method, self.scene) == (method, scene)
            and self.figure in (None, figure)
            and all(options[name] == value for name, value in self.options.items())
        )


def file() -> Path:
    """Where the rows stand: the source tree's tests/stress/by_nature.toml, or the copy that was installed."""
    here = Path(__file__).resolve().parent
    tree = here.parents[2] / "tests" / "stress" / "by_nature.toml"
    return tree if tree.exists() else here.parent / "by_nature.toml"


def read(path: Path | None = None) -> list[Rule]:
    """The rows of the file. InvalidInput names the first that is wrong, or that no method is allowed."""
    path = path or file()
    table = read_config(path)
    return [_rule(f"{path}: row {i}", row) for i, row in enumerate(table.get("row", []), start=1)]


def _rule(where: str, row: Mapping[str, Any]) -> Rule:
    unknown = sorted(row.keys() - {*KEYS, "figure"})
    missing = [key for key in KEYS if key not in row]
    if unknown or missing:
        what = f"lacks {', '.join(missing)}" if missing else f"has {', '.join(unknown)}"
        raise InvalidInput(f"{where} {what}; a row has {', '.join(KEYS)} and perhaps figure")
    limit, options = row["limit"], row["options"]
    if not isinstance(limit, (int, float)) or isinstance(limit, bool) or not isinstance(options, Mapping):
        raise InvalidInput(f"{where}: limit is a number and options a table, not {limit!r} and {options!r}")
    if not str(row["reason"]).strip():
        raise InvalidInput(f"{where}: the reason is empty; it names the paper's section or a proof")
    defaults = {o["name"]: o["default"] for o in method_table(row["method"])["options"]}
    strange = sorted(options.keys() - defaults.keys())
    if strange:
        raise InvalidInput(f"{where}: {row['method']} has no option {', '.join(strange)}; known: {', '.join(defaults)}")
    if row["scene"] in NEVER_BY_DEFAULT and all(defaults[name] == value for name, value in options.items()):
        raise InvalidInput(f"{where}: scene {row['scene']} may fail by nature under no method's default options")
    return Rule(row["method"], dict(options), row["scene"], row["reason"], float(limit), row.get("figure"))


def variants(method: str) -> list[dict[str, Any]]:
    """Every choice of the method's draw options but the defaults, one option at a time. Paging is no choice."""
    out = []
    for option in method_table(method)["options"]:
        if option["stage"] != "draw" or option["name"] == "stream":
            continue
        choices = [True, False] if option["type"] == "bool" else option.get("choices", [])
        out += [{option["name"]: value} for value in choices if value != option["default"]]
    return out


def badness(row: dict[str, Any]) -> float:
    """How bad a row is beside the others of its scene and method: verdict first, then value over limit."""
    value, limit = float(row["value"]), float(row["limit"])
    over = value / limit if limit > 0 else value
    return 10.0 * _RANK[row["verdict"]] + (0.0 if math.isnan(over) else float(np.clip(0.2 * np.arctan(over), -1, 1)))
