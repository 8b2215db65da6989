# SPDX-License-Identifier: MIT
"""Runs and sweeps: a store flown along a path under budgets, as tables in memory and on disk."""

from .run import Run, load

__all__ = ["Run", "load"]
