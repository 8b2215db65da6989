# SPDX-License-Identifier: MIT
"""What people see of results: charts, the page of a run directory, how results show themselves in notebooks."""

from . import notebook  # noqa: F401 - says how runs and sweeps show themselves
from .page import write

__all__ = ["write"]
