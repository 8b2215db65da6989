# SPDX-License-Identifier: MIT
"""The stability suite: the known failures of level-of-detail methods as scenes that every method is put through.

result = lodlab.stability.run("runs/stability", short=True)
result.table      # a row per scene, method, source and figure, as in stability.csv
result.failed     # the rows that FAIL
"""

from .scenes import SCENES
from .suite import COLUMNS, Stability, read, run

__all__ = ["COLUMNS", "SCENES", "Stability", "read", "run"]
