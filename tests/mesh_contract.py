# SPDX-License-Identifier: MIT
"""The contract of methods over meshes: closed, open, of genus 1, of two components, slivers, one triangle, a
tetrahedron; and random ones, damaged or not."""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
from hypothesis import reject

import lodlab as lod
from lodlab.stability import meshes
from lodlab.stores.methods import lacking
from tests.contract import Measured, MethodContract, drawn


def killed_mesh() -> lod.Mesh:
    return lod.datasets.load("blob:size=150")


def build_mesh_for_ever(method: str, path: str, ready) -> None:  # noqa: ANN001 - a multiprocessing event
    """As contract.build_for_ever."""
    mesh = killed_mesh()
    ready.set()
    while True:
        lod.build(mesh, method, path, progress=False, mode="force")


class MeshContract(MethodContract):
    """Inherit, and set `method`."""

    whole: ClassVar[tuple[str, ...]] = ("crack_edges", "inverted_triangles")
    decided: ClassVar[float] = 0.0  # of slivers nothing is left beside their silhouettes
    forever: ClassVar = staticmethod(build_mesh_for_ever)
    _any: ClassVar[dict] = {}
    test_no_cut_leaves_out_a_border_sample_of_a_patch_of_a_planet = None

    @pytest.fixture(scope="class", params=meshes.SOUND)
    @classmethod
    def made(cls, request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Measured:
        mesh = meshes.load(f"mesh:{request.param}")
        if fault := lacking(mesh, cls.method):
            pytest.skip(fault)
        return Measured(cls.method, mesh, tmp_path_factory.mktemp("mesh"), **cls.build_options)

    @staticmethod
    def smallest_source() -> lod.Mesh:
        return meshes.load("mesh:one triangle")

    @staticmethod
    def any_source() -> lod.Mesh:
        return meshes.load("mesh:two components")

    @staticmethod
    def killed_source() -> lod.Mesh:
        return killed_mesh()

    def random_source(self, random: np.random.Generator) -> dict[str, object]:
        recipe = meshes.random_mesh(random)
        if recipe["damage"] == "duplicates":  # whose second sheets have rims anywhere
            reject()
        return reject() if lacking(drawn(meshes.make_mesh, recipe), self.method) else recipe

    def test_killed_build_resumes_or_says_incomplete(self, tmp_path: Path) -> None:
        """Killed once: each child takes seconds to start."""
        super().test_killed_build_resumes_or_says_incomplete(tmp_path, 0.05)
