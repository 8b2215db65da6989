# SPDX-License-Identifier: MIT
"""The instrument: its metrics, and what shows that it and the bounds of stores can be trusted."""

from __future__ import annotations

from .audit import Audit, audit
from .calibrate import calibrate
from .metrics import METRICS, Metric, measure

__all__ = ["METRICS", "Audit", "Metric", "audit", "calibrate", "measure"]
