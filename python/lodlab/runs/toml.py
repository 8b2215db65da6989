# SPDX-License-Identifier: MIT
"""Configurations and key frames as TOML."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import tomli_w

from ..errors import InvalidInput


def toml_text(config: Mapping[str, Any]) -> str:
    """A configuration as TOML: scalars and lists, tables, arrays of tables. None is left out."""
    return tomli_w.dumps(_given(config))


def _given(value: Any) -> Any:
    """A value without the keys that are None, at any depth."""
    if isinstance(value, Mapping):
        return {key: _given(item) for key, item in value.items() if item is not None}
    return [_given(item) for item in value] if isinstance(value, (list, tuple)) else value


def read_config(file: Path | str) -> dict[str, Any]:
    """A TOML file as a dict; InvalidInput names file, line and column of a mistake."""
    file = Path(file)
    if not file.is_file():
        raise InvalidInput(f"configuration: no file {file}")
    try:
        return tomllib.loads(file.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InvalidInput(f"configuration: {file} is not valid TOML: {error}") from None
