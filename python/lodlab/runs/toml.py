# SPDX-License-Identifier: MIT
"""Configurations and key frames as TOML."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..errors import InvalidInput
from .tables import cell


def toml_text(config: Mapping[str, Any]) -> str:
    """A configuration as TOML: scalars and lists, tables, arrays of tables. None is left out."""
    lines: list[str] = []
    _toml_table(lines, config, "")
    return "\n".join(lines) + "\n"


def _toml_table(lines: list[str], values: Mapping[str, Any], prefix: str) -> None:
    def is_tables(value: Any) -> bool:
        return isinstance(value, list) and bool(value) and all(isinstance(v, Mapping) for v in value)

    for key, value in values.items():
        if value is not None and not isinstance(value, Mapping) and not is_tables(value):
            lines.append(f"{key} = {_toml_value(value)}")
    for key, value in values.items():
        if isinstance(value, Mapping):
            lines += ["", f"[{prefix}{key}]"]
            _toml_table(lines, value, f"{prefix}{key}.")
        elif is_tables(value):
            for item in value:
                lines += ["", f"[[{prefix}{key}]]"]
                _toml_table(lines, item, f"{prefix}{key}.")


def _toml_value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (int, float)):
        return cell(value)
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_toml_value(v) for v in value) + "]"
    raise TypeError(f"no TOML form for {type(value).__name__}")


def read_config(file: Path | str) -> dict[str, Any]:
    """A TOML file as a dict; InvalidInput names file, line and column of a mistake."""
    file = Path(file)
    if not file.is_file():
        raise InvalidInput(f"configuration: no file {file}")
    try:
        return tomllib.loads(file.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InvalidInput(f"configuration: {file} is not valid TOML: {error}") from None
