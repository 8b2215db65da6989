# SPDX-License-Identifier: MIT
"""Benchmark of sources larger than memory: the peak of a process that reads and builds one by windows."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterable

from .. import _core
from .lab import SEED, Lab, Record, record

SIZE = 16385

_CHILD = """
import json, sys, time
import lodlab

def resident(key):
    with open("/proc/self/status") as status:
        return next(int(line.split()[1]) * 1024 for line in status if line.startswith(key))

bare = resident("VmRSS")
source = lodlab.datasets.load(sys.argv[1])
start = time.perf_counter()
source.hash()
read = time.perf_counter()
store = lodlab.build(source, "multigrain", sys.argv[2], progress=False)
end = time.perf_counter()
rows, cols = source.shape
print(json.dumps({
    "bare": bare, "peak": resident("VmHWM"), "samples": rows * cols, "windowed": source.windowed,
    "read_seconds": read - start, "build_seconds": end - read, "bytes": store.bytes,
}))
"""


def memory(lab: Lab) -> Iterable[Record]:
    """Peak memory of a process, interpreter and all, that builds a source by windows, beside the source's samples.

    One run: it takes a minute, and its peak hardly varies.
    """
    lab.say(f"memory multigrain/fractal-{SIZE}")
    out = lab.folder / "windowed.lod"
    command = [sys.executable, "-c", _CHILD, f"fractal:size={SIZE},seed={SEED}", str(out)]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"memory: the building process ended with status {done.returncode}: {done.stderr}")
    out.unlink()
    seen = json.loads(done.stdout.splitlines()[-1])
    if not seen["windowed"]:
        raise RuntimeError(f"memory: {seen['samples']} samples were not read by windows; unset LODLAB_WINDOW_SAMPLES")
    yield record(
        "memory",
        f"multigrain/fractal-{SIZE}",
        seen["peak"] / 1e6,
        "MB",
        reference="the source's samples",
        reference_value=4e-6 * seen["samples"],
        ratio=4.0 * seen["samples"] / seen["peak"],
        details={
            "interpreter_bytes": seen["bare"],
            "read_seconds": seen["read_seconds"],
            "build_seconds": seen["build_seconds"],
            "store_bytes": seen["bytes"],
            "threads": _core.thread_count(),
        },
    )
