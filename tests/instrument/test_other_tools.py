# SPDX-License-Identifier: MIT
"""Distances of meshes beside those of an independent tool: pymeshlab samples both surfaces, so that its largest
distance is a lower bound of ours, and its root mean square agrees as closely as its samples are many."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import lodlab as lod

ROUNDING = 1e-6  # of the extent: it computes in floats
ABOVE = 1e-3  # what the true maximum may be above ours
REACHED = 0.9  # of the maximum, by 200,000 samples and all vertices: they missed up to 0.07
SPREAD = 0.01  # of the root mean square, off by up to 0.003; its samples are the same in every run


def patch(cells: int) -> lod.Mesh:
    """An open wavy square."""
    y, x = np.mgrid[0 : cells + 1, 0 : cells + 1]
    points = np.stack([x, y, 0.1 * cells * np.sin(9 * x / cells) * np.cos(7 * y / cells)], axis=-1) / cells
    a = (y * (cells + 1) + x)[:-1, :-1].reshape(-1, 1)
    return lod.Mesh(points.reshape(-1, 3), np.concatenate([a + [0, 1, cells + 2], a + [0, cells + 2, cells + 1]]))


def two_spheres() -> lod.Mesh:
    one = lod.datasets.load("icosphere:level=4")
    points = np.concatenate([one.positions, 0.3 * one.positions + [2.0, 0.0, 0.0]])
    return lod.Mesh(points, np.concatenate([one.faces, one.faces + one.samples]))


@pytest.fixture(scope="module")
def pairs(shared_data: Callable[[str], Path]) -> dict[str, tuple[lod.Mesh, lod.Mesh | int]]:
    """(source, drawn), or (source, triangles that the tool reduces it to)."""
    load = lod.datasets.load
    bunny = load(shared_data("mesh/bunny_stanford_holes.ply"))
    return {
        "armadillo": (load(shared_data("mesh/armadillo.off")), 4000),
        "bunny with holes": (bunny.repaired("unused"), 4000),  # it samples all vertices
        "globe": (load("earth-globe:size=48"), load("earth-globe:size=16")),
        "torus": (load("torus:rings=128,sides=64"), load("torus:rings=24,sides=12")),
        "a component dropped": (two_spheres(), load("icosphere:level=4")),
        "open patch": (patch(80), patch(9)),
    }


def test_maxima_and_rms_beside_pymeshlab(pairs: dict, tmp_path: Path) -> None:
    arrays = {}
    for name, (source, drawn) in pairs.items():
        arrays |= {f"{name}_source_positions": source.positions, f"{name}_source_faces": source.faces}
        if isinstance(drawn, int):
            arrays[f"{name}_simplify_to"] = drawn
        else:
            arrays |= {f"{name}_drawn_positions": drawn.positions, f"{name}_drawn_faces": drawn.faces}
    np.savez(tmp_path / "in.npz", **arrays)
    program = Path(__file__).with_name("sampled_hausdorff.py")
    done = subprocess.run(
        [sys.executable, program, tmp_path / "in.npz", tmp_path / "out.npz"],
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    with np.load(tmp_path / "out.npz") as found:
        for name, (source, _) in pairs.items():
            drawn = found[f"{name}_drawn_positions"], found[f"{name}_drawn_faces"]
            ours = lod.measure(drawn, source)
            rounding = ROUNDING * source.extent
            for way, (largest, rms) in enumerate(zip(found[f"{name}_max"], found[f"{name}_rms"], strict=True)):
                direction = ("source_to_drawn", "drawn_to_source")[way]
                our_max, our_rms = ours[f"measured_max_{direction}"], ours[f"measured_rms_{direction}"]
                told = (
                    f"{name}, {direction}: max {our_max:.6g} beside {largest:.6g}, rms {our_rms:.6g} beside {rms:.6g}"
                )
                assert REACHED * our_max - rounding <= largest <= (1 + ABOVE) * our_max + rounding, told
                assert our_rms == pytest.approx(rms, rel=SPREAD, abs=rounding), told
