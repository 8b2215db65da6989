# SPDX-License-Identifier: MIT
"""Benchmarks of meshes, scans of the folder of further data; where a file is not there, its cases are skipped."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from .. import _core
from ..instrument.metrics import BASELINE
from ..stores.methods import still
from .lab import Building, Lab, Record, build_case, draw_cases
from .measuring import accuracy_cases, measure_case

FILES = {"armadillo": "armadillo.off", "dragon": "dragon_vrip.ply.gz", "igea": "igea_tristrips.ply"}
DRAWN = (("full", "armadillo"), ("full", "dragon"), ("discrete", "dragon"), ("subdivision", "dragon"))
MEASURED = (("full", "armadillo"), ("discrete", "armadillo"))
BUILT = (("full", "dragon"), ("discrete", "dragon"), ("subdivision", "dragon"))
PROMISED = (("discrete", "armadillo"), ("subdivision", "armadillo"))


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


def accuracy(lab: Lab) -> Iterable[Record]:
    """Measured error against the promised one on a mesh: a report, its ratio says how tight the promise is."""
    for method, name in PROMISED:
        spec, case = FILES[name], f"{method}/{name}"
        if not lab.lacks(spec, f"accuracy {case}"):
            yield from accuracy_cases(lab, case, spec, method, still(method, {}))
