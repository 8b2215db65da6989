# SPDX-License-Identifier: MIT
"""The honest member of the family passes the contract over meshes: a method of several nodes and resolutions."""

from __future__ import annotations

from tests.mesh_contract import MeshContract


class TestHonest(MeshContract):
    method = "honest"
    test_finest_cut_is_the_source = test_finest_cut_looks_like_the_source = None  # of fields sides are resampled
    test_killed_build_resumes_or_says_incomplete = None  # as of fields
