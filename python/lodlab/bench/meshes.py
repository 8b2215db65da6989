# SPDX-License-Identifier: MIT
"""Benchmarks of meshes, scans of the folder of further data; where a file is not there, its cases are skipped."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from .. import _core
from ..instrument.metrics import BASELINE
from ..stores.methods import still
from .lab import Building, Lab, Record, build_case, draw_cases, select_case
from .measuring import accuracy_cases, measure_case

FILES = {"armadillo": "armadillo.off", "dragon": "dragon_vrip.ply.gz"}
DRAWN = (("full", "armadillo"), ("full", "dragon"), ("discrete", "dragon"))
MEASURED = (("full", "armadillo"), ("discrete", "armadillo"))
BUILT = (("full", "dragon"), ("discrete", "dragon"))
SELECTED = (("discrete", "dragon"),)
PROMISED = (("discrete", "armadillo"),)


def draw(lab: Lab) -> Iterable[Record]:
    """Triangles per second of a 1 px cut of a mesh, beside one static buffer that holds the very same triangles."""
    for method, name in DRAWN:
        spec, case = FILES[name], f"{method}/{name}"
        if not lab.lacks(spec, f"draw {case}"):
            view, budget = lab.views(spec, 9)[4], _core.Budget(pixel_error=1.0)
            yield from draw_cases(lab, case, spec, lab.store(spec, method), still(method, {}), view, budget)


def measure(lab: Lab) -> Iterable[Record]:
    """Milliseconds of one accuracy frame of a mesh without picture metrics, beside drawing `full`."""
    for method, name in MEASURED:
        spec, case = FILES[name], f"{method}/{name}"
        if not lab.lacks(spec, f"measure {case}"):
            yield measure_case(lab, case, spec, method, still(method, {}))


def build(lab: Lab) -> Iterable[Record]:
    """Faces per second from arrays in memory to a closed, complete store, beside `full`, which keeps them."""
    for method, name in BUILT:
        spec, case = FILES[name], f"{method}/{name}"
        if lab.lacks(spec, f"build {case}"):
            continue
        mesh = lab.source(spec)
        lab.say(f"build {case}")

        def source(mesh: Any = mesh) -> Any:
            return _core.Mesh(mesh.positions, mesh.faces)

        plain = None if method == BASELINE else Building(lab, source, BASELINE, {})
        yield build_case(case, len(mesh.faces), "faces", Building(lab, source, method, {}), "full", plain)


def select(lab: Lab) -> Iterable[Record]:
    """Microseconds of one select at 1 px along the orbit of a mesh, beside a plain scan over all nodes."""
    for method, name in SELECTED:
        spec, case = FILES[name], f"{method}/{name}"
        if not lab.lacks(spec, f"select {case}"):
            store, options = lab.store(spec, method), still(method, {})
            lab.say(f"select {case}")
            yield select_case(
                case, store.session(options), store, lab.views(spec, 120), _core.Budget(pixel_error=1.0),
                "test of every node without a hierarchy", 1.0, options, _drawn_nodes,
            )  # fmt: skip


def _drawn_nodes(times: np.ndarray, nodes: np.ndarray) -> dict[str, Any]:
    return {"nodes_drawn": float(np.median(nodes)), "p95_us": float(np.percentile(times, 95))}


def accuracy(lab: Lab) -> Iterable[Record]:
    """Measured error against the promised one on a mesh: a report, its ratio says how tight the promise is."""
    for method, name in PROMISED:
        spec, case = FILES[name], f"{method}/{name}"
        if not lab.lacks(spec, f"accuracy {case}"):
            yield from accuracy_cases(lab, case, spec, method, still(method, {}))
