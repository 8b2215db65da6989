# SPDX-License-Identifier: MIT
"""A pytest plugin: loads the core that LODLAB_ADVERSARIES names in place of `lodlab._core`.

It is the same core with the adversaries in its registry (CMake target `adversaries`). One process holds one core,
so these tests run in a process of their own, and this plugin is loaded (-p) before anything imports lodlab.
"""

from __future__ import annotations

import importlib.util
import os
import sys

if "lodlab" in sys.modules:
    raise ImportError("tests.adversaries.load_core: lodlab is imported already, with its own core")
_spec = importlib.util.spec_from_file_location("lodlab._core", os.environ["LODLAB_ADVERSARIES"])
_core = importlib.util.module_from_spec(_spec)
sys.modules[_spec.name] = _core
_spec.loader.exec_module(_core)
