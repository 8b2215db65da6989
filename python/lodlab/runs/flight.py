# SPDX-License-Identifier: MIT
"""What is flown: the budget of a method, a run's name, and everything that decides its rows."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from .. import _core
from ..errors import InvalidInput, Unsupported, check_one_of
from ..instrument.yardstick import MEASURES
from ..stores.methods import method_table
from ..stores.session import as_budget

IMAGES = ("all", "worst", "none")
_BUDGETS = ("pixel_error", "triangles", "nodes")


def budget_of(values: Mapping[str, Any] | Any | None) -> dict[str, Any]:
    """A budget as a dict of the values that are set, in the order pixel_error, triangles, nodes."""
    if isinstance(values, Mapping) and set(values) <= set(_BUDGETS):
        return {k: values[k] for k in _BUDGETS if values.get(k) is not None}  # numbers as they were given
    budget = as_budget({} if values is None else values)
    return {k: v for k in _BUDGETS if (v := getattr(budget, k)) is not None}


def check_budget(method: str, values: Mapping[str, Any]) -> Any:
    """The core's Budget. InvalidInput: none set, or not positive; Unsupported: not one of the method's.

    A method that lists no budgets ignores them.
    """
    listed = method_table(method)["budgets"]
    if not listed:
        _core.Budget(**values)  # a value out of range is a mistake all the same
        return _core.Budget(pixel_error=1.0)
    if not values:
        raise InvalidInput(f"budget of {method}: none set; give at least one of {', '.join(listed)}")
    budget = _core.Budget(**values)
    for name in values:
        if name not in listed:
            raise Unsupported(f"budget of {method}: it has no budget {name}; it takes {', '.join(listed)}")
    return budget


def budget_text(values: Mapping[str, Any]) -> str:
    """A budget as in run names: `px1`, `t100000`, `n400`, joined by `-`."""
    short = {"pixel_error": "px", "triangles": "t", "nodes": "n"}
    return "-".join(f"{short[k]}{v:g}" if k == "pixel_error" else f"{short[k]}{v}" for k, v in values.items())


def run_name(*parts: str) -> str:
    """A name that is readable and safe as a folder's."""
    return re.sub(r"[^A-Za-z0-9.=+,_-]+", "_", "-".join(p for p in parts if p)).strip("._") or "run"


@dataclass
class Flight:
    """One run to be made: everything that decides its rows."""

    name: str
    source: str
    path: str
    budget: dict[str, Any]
    options: dict[str, Any]  # draw options, defaults written out
    frames: int = 120
    size: tuple[int, int] = (1280, 720)
    fov: float | None = None  # degrees; None: the path's own, or 60
    accuracy_frames: int = 12
    repeat: int = 1
    images: str = "none"
    metrics: str = "all"

    def check(self) -> None:
        """InvalidInput for what no run can be made of."""
        for name, value, low in (
            ("frames", self.frames, 1),
            ("accuracy_frames", self.accuracy_frames, 0),
            ("repeat", self.repeat, 1),
        ):
            if not hasattr(value, "__index__") or value < low:
                raise InvalidInput(f"fly: {name} is {value!r}; it is a whole number, at least {low}")
        check_one_of("fly: images", self.images, IMAGES)
        check_one_of("fly: metrics", self.metrics, MEASURES)
