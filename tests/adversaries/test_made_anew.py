# SPDX-License-Identifier: MIT
"""What scripts/new_method.py makes, compiled into this core as it was made (CMake): it passes the contract (here on
three of its fields)."""

from __future__ import annotations

import importlib.util
import os
from pathlib import Path

from .short_contract import ShortContract

MADE = Path(os.environ["LODLAB_ADVERSARIES"]).parents[1] / "new_method" / "tests" / "methods" / "test_made_anew.py"
_spec = importlib.util.spec_from_file_location("tests.methods.test_made_anew", MADE)
_made = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(_made)


class TestMadeAnew(ShortContract, _made.TestMadeAnew):
    pass


test_a_cut_of_two_resolutions_is_refused = _made.test_a_cut_of_two_resolutions_is_refused
test_resolutions_finer_than_finest_error_are_left_out = _made.test_resolutions_finer_than_finest_error_are_left_out
