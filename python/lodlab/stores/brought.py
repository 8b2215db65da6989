# SPDX-License-Identifier: MIT
"""Meshes that a user brings by a build option (`levels` of `discrete`): SOURCE texts with `;` or `,` between them, or
a list of texts, meshes, trimesh objects and (positions, faces). Stores keep their names as text; a mesh that only lies
in memory has its hash there."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..disk import absolute_parts, parts_of
from ..errors import InvalidInput
from ..sources.datasets import as_source
from ..sources.mesh import Mesh, levels_of_file
from ..sources.spec import find_file
from .methods import method_table


def _mesh_options(method: str) -> dict[str, str]:
    """The options of a method that name meshes, with their defaults, which name none."""
    return {o["name"]: o["default"] for o in method_table(method)["options"] if o["type"] == "meshes"}


def _items(value: Any) -> list[Any]:
    if isinstance(value, (str, os.PathLike)):
        return parts_of(os.fspath(value))
    if isinstance(value, (list, tuple)) and not (len(value) == 2 and all(isinstance(v, np.ndarray) for v in value)):
        return list(value)
    return [value]


def _meshes(option: str, item: Any) -> list[Mesh]:
    """What one item stands for: a mesh, or the levels of a glTF file."""
    if isinstance(item, (str, os.PathLike)):
        text = os.fspath(item)
        file = find_file(text)
        if file is not None and (levels := levels_of_file(file)):
            return levels
        item = text
    if isinstance(item, tuple):
        return [Mesh(*item)]
    source = as_source(item)
    if not isinstance(source, Mesh):
        raise InvalidInput(f"option {option}: {source.name} is a {source.kind}; it takes meshes")
    return [source]


def _text(item: Any) -> str:
    if isinstance(item, (str, os.PathLike)):
        return absolute_parts(os.fspath(item))
    mesh = item if isinstance(item, Mesh) else Mesh(*item) if isinstance(item, tuple) else as_source(item)
    return mesh.spec or f"mesh:{mesh.hash()}"


def as_text(method: str, options: Mapping[str, Any]) -> dict[str, Any]:
    """Build options with texts in place of the meshes that they name."""
    out = dict(options)
    for name, default in _mesh_options(method).items():
        if name in out and out[name] != default:
            out[name] = ";".join(_text(item) for item in _items(out[name]))
    return out


def meshes_of(method: str, options: Mapping[str, Any]) -> dict[str, list[Any]]:
    """The native meshes that build options name, loaded, by option."""
    out = {}
    for name, default in _mesh_options(method).items():
        if name in options and options[name] != default:
            found = [mesh for item in _items(options[name]) for mesh in _meshes(name, item)]
            if not found:
                raise InvalidInput(f"option {name}: no mesh is named")
            out[name] = [mesh.core for mesh in found]
    return out
