# SPDX-License-Identifier: MIT
"""Builds the core with the adversaries in its registry, and runs tests/adversaries with it, in a process of its own."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def test_every_adversary_is_caught_and_no_detector_is_idle():
    build = Path(os.environ.get("LODLAB_BUILD", ROOT / "build" / "editable"))
    assert (build / "CMakeCache.txt").is_file(), f"{build} is no build folder: make setup, or name one in LODLAB_BUILD"
    made = subprocess.run(["cmake", "--build", build, "--target", "adversaries"], capture_output=True, text=True)
    assert made.returncode == 0, made.stdout + made.stderr
    (core,) = (build / "adversaries").glob("_core.*.so")
    environment = {k: v for k, v in os.environ.items() if k != "LODLAB_SHADER_DIR"}  # its shaders lie beside it
    command = [sys.executable, "-m", "pytest", "-p", "tests.adversaries.load_core", "-p", "no:cacheprovider", "-q"]
    run = subprocess.run(
        [*command, "tests/adversaries"],
        cwd=ROOT,
        env={**environment, "LODLAB_ADVERSARIES": os.fspath(core)},
        capture_output=True,
        text=True,
    )
    assert run.returncode == 0, run.stdout + run.stderr
    assert " skipped" not in run.stdout and " passed" in run.stdout, run.stdout
