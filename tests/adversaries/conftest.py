# SPDX-License-Identifier: MIT
"""These tests need the core with the adversaries in it: tests/test_adversaries.py starts a process that has it."""

from __future__ import annotations

import os

collect_ignore_glob = [] if "LODLAB_ADVERSARIES" in os.environ else ["test_*.py"]
