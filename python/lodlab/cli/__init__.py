# SPDX-License-Identifier: MIT
"""The command line `lodlab`: a thin layer over the Python face."""

from .program import main, run

__all__ = ["main", "run"]
