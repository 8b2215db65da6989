# SPDX-License-Identifier: MIT
"""The contract for methods of the core with the adversaries: on three of its fields, and killed once."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import ClassVar

import pytest

if "lodlab" not in sys.modules:  # a child that is spawned to be killed: it needs this core, too
    from tests.adversaries import load_core  # noqa: F401
import lodlab as lod
from tests import contract


def build_for_ever(*arguments: object) -> None:
    contract.build_for_ever(*arguments)


class ShortContract(contract.MethodContract):
    forever: ClassVar = staticmethod(build_for_ever)

    @pytest.fixture(scope="class", params=["odd", "smallest", "voids"])
    @classmethod
    def made(cls, request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> contract.Measured:
        field = lod.HeightField(contract.FIELDS[request.param](), spacing=(30.0, 40.0))
        return contract.Measured(cls.method, field, tmp_path_factory.mktemp(request.param))

    def test_killed_build_resumes_or_says_incomplete(self, tmp_path: Path) -> None:
        """Killed once: each child takes seconds to start."""
        super().test_killed_build_resumes_or_says_incomplete(tmp_path, 0.05)
