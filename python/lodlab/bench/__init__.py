# SPDX-License-Identifier: MIT
"""Benchmarks: each figure beside a reference that was measured in the same process (see `suite`)."""

from .suite import bars_file, check, names, run, table, to_json

__all__ = ["bars_file", "check", "names", "run", "table", "to_json"]
