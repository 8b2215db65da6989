# SPDX-License-Identifier: MIT
"""Where results come from: version, commit, machine and time, as `provenance.json` has them."""

from __future__ import annotations

import json
import os
import platform
import subprocess
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Any

from ..errors import StoreError


def read_provenance(folder: Path) -> dict[str, Any]:
    """`provenance.json` of a run directory; empty where there is none."""
    file = folder / "provenance.json"
    try:
        return json.loads(file.read_bytes()) if file.exists() else {}
    except ValueError as error:
        raise StoreError(f"read results: {file} is damaged ({error}); without it results can still be read") from None


def version() -> str:
    """lodlab's version as installed; `0+source` when it runs from a tree that was never installed."""
    try:
        return metadata.version("lodlab")
    except metadata.PackageNotFoundError:
        return "0+source"


def commit() -> str:
    """The commit of the tree that this package lies in, with `+` when it was changed; else `unknown`."""
    here = Path(__file__).resolve()
    git = ["git", "-C", str(here.parent)]
    try:
        if subprocess.run([*git, "ls-files", "--error-unmatch", str(here)], capture_output=True, timeout=10).returncode:
            return "unknown"
        head = subprocess.run([*git, "rev-parse", "HEAD"], capture_output=True, text=True, timeout=10).stdout.strip()
        changed = subprocess.run([*git, "status", "--porcelain", "-uno"], capture_output=True, text=True, timeout=10)
    except (OSError, subprocess.SubprocessError):
        return "unknown"
    return head + ("+" if changed.stdout.strip() else "") if head else "unknown"


def machine() -> dict[str, Any]:
    """Processor, cores, memory, system and Python of this machine."""
    cpu = platform.processor() or platform.machine()
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                cpu = line.split(":", 1)[1].strip()
                break
        memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (OSError, ValueError):
        memory = 0
    return {
        "cpu": cpu,
        "cores": os.cpu_count(),
        "memory_bytes": memory,
        "system": platform.platform(),
        "python": platform.python_version(),
    }


def now() -> str:
    """The time in UTC, ISO 8601, to the second."""
    return datetime.now(UTC).isoformat(timespec="seconds")
