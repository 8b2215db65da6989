# SPDX-License-Identifier: MIT
"""What people see of results: charts, and the page of a run directory."""

from .page import write

__all__ = ["write"]
