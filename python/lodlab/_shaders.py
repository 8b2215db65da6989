# SPDX-License-Identifier: MIT
"""Tells the core where its shader files are: beside the module, or in the tree when it was built there."""

from __future__ import annotations

from pathlib import Path

from . import _core

_PLACES = (Path(_core.__file__).parent / "shaders", Path(__file__).resolve().parents[2] / "shaders")
FOLDER = next((place for place in _PLACES if place.is_dir()), _PLACES[0])
_core.set_shader_dir(str(FOLDER))
