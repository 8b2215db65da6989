# SPDX-License-Identifier: MIT
"""What scripts/new_method.py makes, compiled into this core as it was made (CMake): it passes the contract (here on
three of its fields)."""

from __future__ import annotations

import importlib.util
import os
import sys
from pathlib import Path
from typing import ClassVar

import pytest

if "lodlab" not in sys.modules:  # a child that is spawned to be killed: it needs this core, too
    from tests.adversaries import load_core  # noqa: F401
from tests import contract

MADE = Path(os.environ["LODLAB_ADVERSARIES"]).parents[1] / "new_method" / "tests" / "methods" / "test_made_anew.py"
_spec = importlib.util.spec_from_file_location("tests.methods.test_made_anew", MADE)
_made = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(_made)


def build_for_ever(*arguments: object) -> None:
    contract.build_for_ever(*arguments)


class TestMadeAnew(_made.TestMadeAnew):
    forever: ClassVar = staticmethod(build_for_ever)

    @pytest.fixture(scope="class", params=["odd", "smallest", "voids"])
    @classmethod
    def made(cls, request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> contract.Measured:
        return contract.Measured(cls.method, request.param, tmp_path_factory.mktemp(request.param))

    def test_killed_build_resumes_or_says_incomplete(self, tmp_path: Path) -> None:
        """Killed once: each child takes seconds to start."""
        super().test_killed_build_resumes_or_says_incomplete(tmp_path, 0.05)


test_a_cut_of_two_resolutions_is_refused = _made.test_a_cut_of_two_resolutions_is_refused
test_resolutions_finer_than_finest_error_are_left_out = _made.test_resolutions_finer_than_finest_error_are_left_out
