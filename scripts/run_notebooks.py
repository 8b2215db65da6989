# SPDX-License-Identifier: MIT
"""Executes notebooks without touching them and writes what came out.

    LODLAB_SCALE=full .venv/bin/python scripts/run_notebooks.py notebooks/*.ipynb

For each notebook NAME: ``runs/notebooks/NAME.html`` (executed) below the working directory; the notebook itself
writes ``runs/notebooks/NAME.csv`` beside it. At full scale the CSV is also copied to ``docs/results``.
"""

from __future__ import annotations

import os
import shutil
import sys
import time
from pathlib import Path

import nbformat
from nbclient import NotebookClient
from nbconvert import HTMLExporter

ROOT = Path(__file__).resolve().parents[1]


def run(notebook: Path, folder: Path, *, timeout: float = 1800.0) -> Path:
    """Executes a notebook with ``folder`` as its working directory.

    Args:
        notebook: The .ipynb file; it is read, never written.
        folder: The working directory of the kernel; results land in its ``runs/notebooks``.
        timeout: Seconds that one cell may take.

    Returns:
        The path of the HTML page.

    Raises:
        nbclient.exceptions.CellExecutionError: A cell raised; the message holds its traceback.
        FileNotFoundError: The notebook did not write its CSV.
    """
    node = nbformat.read(notebook, as_version=4)
    client = NotebookClient(node, timeout=timeout, kernel_name="python3", resources={"metadata": {"path": str(folder)}})
    client.execute()
    out = folder / "runs" / "notebooks"
    table = out / f"{notebook.stem}.csv"
    if not table.exists():
        raise FileNotFoundError(f"{notebook.name} ran but did not write {table}")
    page = out / f"{notebook.stem}.html"
    body, _ = HTMLExporter().from_notebook_node(node, resources={"metadata": {"name": notebook.stem}})
    page.write_text(body, encoding="utf-8")
    return page


def main(names: list[str]) -> int:
    """Runs the named notebooks from the repository's root; returns the exit status."""
    if not names:
        print("usage: run_notebooks.py NOTEBOOK.ipynb...", file=sys.stderr)
        return 2
    for name in names:
        start = time.perf_counter()
        page = run(Path(name), ROOT)
        print(f"{page.relative_to(ROOT)} ({time.perf_counter() - start:.0f} s)")
        if os.environ.get("LODLAB_SCALE", "small") == "full":
            results = ROOT / "docs" / "results"
            results.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(page.with_suffix(".csv"), results / f"{page.stem}.csv")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
