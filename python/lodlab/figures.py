# SPDX-License-Identifier: MIT
"""Figures as people read them in tables and sentences."""

from __future__ import annotations

import html
import math
from functools import singledispatch
from typing import Any

import numpy as np


@singledispatch
def html_of(result: Any) -> str:
    """How a result shows itself in a notebook. Tables know no chart: the room `report` says it, kind by kind."""
    return f"<div>{html.escape(repr(result)[1:-1])}</div>"


def number(value: Any) -> str:
    """A figure for people: three digits, thousands apart, ∞, – for undefined."""
    if isinstance(value, (bool, np.bool_)):
        return "yes" if value else "no"
    value = value if isinstance(value, int) else float(value)
    if math.isnan(value):
        return "–"
    if math.isinf(value):
        return "∞"
    if value == 0:
        return "0"
    if isinstance(value, int) or abs(value) >= 1000:
        return f"{value:,.0f}".replace(",", "\u202f")
    if abs(value) < 0.001:
        return f"{value:.1e}"
    digits = max(0, 2 - math.floor(math.log10(abs(value))))
    return f"{value:.{min(digits, 4)}f}"


def percent(factor: float) -> str:
    """By how much a factor differs from 1: 1.031 is `3.1 %`, 2.5 is `150 %`."""
    share = 100.0 * abs(factor - 1.0)
    return f"{share:.0f} %" if share >= 9.95 else f"{share:.2g} %"
