# SPDX-License-Identifier: MIT
"""pymeshlab on pairs of meshes: `python sampled_hausdorff.py IN.npz OUT.npz`. A program of its own, as pymeshlab brings
libraries that do not live in one process with ours.

IN: `NAME_source_positions`, `_source_faces`, and `_drawn_positions`, `_drawn_faces` or `_simplify_to` (triangles that
the source is reduced to). OUT: the drawn arrays again, and `NAME_max`, `NAME_rms`, each (2,): from samples of the
source to the drawn mesh, and back.
"""

from __future__ import annotations

import sys

import numpy as np
import pymeshlab

SAMPLES = 200_000


def mesh(positions: np.ndarray, faces: np.ndarray) -> pymeshlab.Mesh:
    return pymeshlab.Mesh(positions, faces.astype(np.int32))


def simplified(positions: np.ndarray, faces: np.ndarray, wanted: int) -> tuple[np.ndarray, np.ndarray]:
    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(mesh(positions, faces))
    meshes.meshing_decimation_quadric_edge_collapse(targetfacenum=wanted, preserveboundary=True)
    out = meshes.current_mesh()
    return out.vertex_matrix(), out.face_matrix()


def sampled(one: pymeshlab.Mesh, other: pymeshlab.Mesh) -> tuple[float, float]:
    """The largest distance from vertices and samples of one to the other, and the root mean square from samples spread
    evenly over its area."""
    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(one)
    meshes.add_mesh(other)
    ask = {"sampledmesh": 0, "targetmesh": 1, "maxdist": pymeshlab.PureValue(1e9), "samplenum": SAMPLES}
    over_faces = meshes.get_hausdorff_distance(samplevert=False, sampleface=True, **ask)
    at_vertices = meshes.get_hausdorff_distance(samplevert=True, sampleface=False, **ask)
    return max(over_faces["max"], at_vertices["max"]), over_faces["RMS"]


def main(given: str, result: str) -> None:
    out = {}
    with np.load(given) as pairs:
        for key in (k for k in pairs.files if k.endswith("_source_faces")):
            name = key.removesuffix("_source_faces")
            source = pairs[f"{name}_source_positions"], pairs[key]
            if f"{name}_simplify_to" in pairs.files:
                drawn = simplified(*source, int(pairs[f"{name}_simplify_to"]))
            else:
                drawn = pairs[f"{name}_drawn_positions"], pairs[f"{name}_drawn_faces"]
            out[f"{name}_drawn_positions"], out[f"{name}_drawn_faces"] = drawn
            ways = sampled(mesh(*source), mesh(*drawn)), sampled(mesh(*drawn), mesh(*source))
            out[f"{name}_max"], out[f"{name}_rms"] = np.transpose(ways)
    np.savez(result, **out)


if __name__ == "__main__":
    main(*sys.argv[1:])
