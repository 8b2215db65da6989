# SPDX-License-Identifier: MIT
"""What is looked at: height fields, in memory and read by windows, and meshes; their files, data sets and texts."""

from .base import FieldSource, Source
from .datasets import as_source, load
from .heightfield import HeightField
from .mesh import Mesh
from .spec import SourceSpec, data_folder, find_file

__all__ = [
    "FieldSource",
    "HeightField",
    "Mesh",
    "Source",
    "SourceSpec",
    "as_source",
    "data_folder",
    "find_file",
    "load",
]
