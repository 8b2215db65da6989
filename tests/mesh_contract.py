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
from lodlab import _core, deform
from lodlab.instrument.metrics import measure, pixel_slack
from lodlab.stability import meshes
from lodlab.stores.methods import lacking
from tests.contract import Measured, MethodContract, drawn, over


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

    # Poses, where the method deforms

    @pytest.mark.parametrize("name", deform.NAMES)
    def test_a_pose_is_drawn_whole_and_as_it_says(self, made: Measured, name: str) -> None:
        if not self.info["deforms"]:
            with pytest.raises(lod.errors.Unsupported, match="deforms nothing|control"):
                made.store.control_positions  # noqa: B018
            return
        session, view, budget = made.session(), over(made.source), _core.Budget(pixel_error=2.0)
        rest = made.store.control_positions
        plain = session.select(view, budget)
        still = session.select(view, budget, rest)
        assert session.digest(still) == session.digest(plain) and still.promises_bound == plain.promises_bound
        cut, cost = session.time_frame(view, budget, control_positions=getattr(deform, name)(0.5, rest))
        row = measure(made.instrument, session, cut, view, made.instrument.reference(view, cut))
        self.check_whole(row)
        assert cut.triangles == cost["triangles"] == row["drawn_triangles"]
        assert row["capture_mismatch_pixels"] == 0
        assert not cut.promises_bound or row["measured_px_max"] <= row["predicted_px"] + pixel_slack(view)
        assert np.array_equal(session.capture(plain, view).triangles, session.capture(still, view).triangles)

    def test_killed_build_resumes_or_says_incomplete(self, tmp_path: Path) -> None:
        """Killed once: each child takes seconds to start."""
        super().test_killed_build_resumes_or_says_incomplete(tmp_path, 0.05)
