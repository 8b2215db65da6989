# SPDX-License-Identifier: MIT
"""How runs and sweeps show themselves in notebooks: a run with its timeline, a sweep with its table."""

from __future__ import annotations

import base64
import html

from ..figures import html_of
from ..runs.run import Run
from ..runs.sweep import Sweep
from .charts import timeline
from .page import summary_table


@html_of.register
def _(run: Run) -> str:
    chart = base64.b64encode(timeline(run)._repr_png_()).decode()
    return (
        f"<div>{html.escape(repr(run)[1:-1])}"
        f'<br><img alt="frames of {html.escape(run.name)}" style="max-width:100%" width="740" '
        f'src="data:image/png;base64,{chart}"></div>'
    )


@html_of.register
def _(sweep: Sweep) -> str:
    return f"<div>{html.escape(repr(sweep)[1:-1])}{summary_table(sweep.summary)}</div>"
