# SPDX-License-Identifier: MIT
"""The run directory: what a run leaves on disk, so that it can be read, charted, repeated and resumed.

`config.toml` (frozen configuration), `provenance.json`, `frames.csv` (a row a frame), `summary.csv`
(a row a run), `noise.csv` (one run timed twice), `images/`, `stores/`, and what `report` makes of them.

Invariant: a run counts as done when its row stands in `summary.csv`. Its frames are appended (and
synced) before that row, so a killed sweep leaves at most frames without a summary; they are dropped when
the directory is opened for writing again, and the run is repeated. A run is known by what decides its rows, not
by its name: a grid that grows may rename what is done.
"""

from __future__ import annotations

import csv
import fcntl
import io
import json
import os
import shutil
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from ..disk import write_atomic
from ..errors import InvalidInput, StoreError
from .provenance import commit, machine, now, read_provenance, version
from .tables import FRAME_COLUMNS, NOISE_COLUMNS, OPTION, SUMMARY_COLUMNS, _damaged, cell, summary_columns
from .toml import read_config, toml_text

HEAD = "# lodlab run configuration, every default written out. Repeat: lodlab sweep config.toml --out DIRECTORY\n"


class RunDirectory:
    """One run directory, open for writing by one process at a time.

    `config`: the configuration that stands in it, None where no run is finished yet. `done`: the summary row of
    each finished run by its name, as text. Whoever opens it makes one configuration of what stands there and what
    is to be flown (`configs.grow`), and calls `begin` with it before anything is written.
    """

    def __init__(self, path: Path | str):
        """Creates the directory, or takes up one.

        Raises InvalidInput when it holds files that are not a run's; StoreError when another process is writing
        to it.
        """
        self.path = Path(path)
        if self.path.exists() and not self.path.is_dir():
            raise InvalidInput(f"run directory: {self.path} is a file, not a directory")
        self.path.mkdir(parents=True, exist_ok=True)
        self._lock = (self.path / ".lock").open("a")
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            self._lock.close()
            raise StoreError(f"run directory: another process is writing to {self.path}") from None
        try:
            self._take_up()
        except BaseException:
            self.close()
            raise

    def _take_up(self) -> None:
        self.done = self._settle()
        file = self.path / "config.toml"
        if not file.exists() and (self.path / "frames.csv").exists():
            raise InvalidInput(f"run directory: {self.path} holds frames.csv without config.toml; choose another")
        self.config = read_config(file) if self.done else None

    def begin(self, config: Mapping[str, Any], options: Iterable[str], names: Mapping[str, str]) -> None:
        """Writes the configuration, and the heads of the tables with a column for each of these options. Finished
        runs take the names that they have in it (`names`: old to new)."""
        file, text = self.path / "config.toml", HEAD + toml_text(config)
        if not file.exists() or file.read_text(encoding="utf-8") != text:
            write_atomic(file, text)
        (head, *rows) = self._read("summary.csv") or [()]
        self._columns = summary_columns([{f"{OPTION}{name}": None for name in options}], head)
        self._write("summary.csv", [self._columns, *([*row, *[""] * (len(self._columns) - len(head))] for row in rows)])
        if not self._read("frames.csv"):
            write_atomic(self.path / "frames.csv", ",".join(FRAME_COLUMNS) + "\r\n")
        self._rename({old: new for old, new in names.items() if old != new})

    def _rename(self, names: Mapping[str, str]) -> None:
        """A process that is killed between two steps leaves runs that are flown again, and no false row."""
        if not names:
            return
        images = self.path / "images"
        folders = [(f"{old}{end}", f"{new}{end}") for old, new in names.items() for end in ("", ".worst")]
        moved = [(images / f".{old}", images / new) for old, new in folders if (images / old).is_dir()]
        for temporary, _ in moved:
            (images / temporary.name[1:]).rename(temporary)
        for temporary, new in moved:
            shutil.rmtree(new, ignore_errors=True)
            temporary.rename(new)
        for name in ("frames.csv", "summary.csv"):
            rows = self._read(name)
            self._write(name, rows[:1] + [[names.get(row[0], row[0]), *row[1:]] for row in rows[1:]])
        self.done = {names.get(old, old): {**row, "run": names.get(old, old)} for old, row in self.done.items()}

    def _settle(self) -> dict[str, dict[str, str]]:
        """Drops what a killed process left half-written; the summary rows of the runs that are complete."""
        for name, columns in (("frames.csv", FRAME_COLUMNS), ("summary.csv", SUMMARY_COLUMNS)):
            rows = self._read(name)
            more = rows[0][len(columns) :] if rows and name == "summary.csv" else []
            if rows and (*columns, *(c for c in more if c.startswith(OPTION))) != tuple(rows[0]):
                raise InvalidInput(
                    f"run directory: {self.path / name} has other columns than this version writes; "
                    "choose another directory"
                )
        there = Counter(row[0] for row in self._read("frames.csv")[1:])
        head, *rows = self._read("summary.csv") or [[]]
        found = [dict(zip(head, row, strict=True)) for row in rows]
        done = {row["run"]: row for row in found if str(there[row["run"]]) == row["frames"]}
        for name in ("frames.csv", "summary.csv"):
            if (self.path / name).exists():
                rows = self._read(name)
                self._write(name, rows[:1] + [row for row in rows[1:] if row[0] in done])
        return done

    def _read(self, name: str) -> list[list[str]]:
        """Complete rows, header first; a last line that was cut off is left out."""
        file = self.path / name
        if not file.exists():
            return []
        try:
            text = file.read_bytes().decode()
        except UnicodeDecodeError as error:
            raise _damaged(file, f"it is no table ({error})") from None
        whole = text[: text.rfind("\n") + 1]
        rows = list(csv.reader(io.StringIO(whole, newline="")))
        return [row for row in rows if len(row) == len(rows[0])]

    def _write(self, name: str, rows: Sequence[Sequence[str]]) -> None:
        text = io.StringIO(newline="")
        csv.writer(text).writerows(rows)
        file = self.path / name
        if not file.exists() or file.read_bytes() != text.getvalue().encode():
            write_atomic(self.path / name, text.getvalue())

    def append(self, frames: Sequence[Mapping[str, Any]], summary: Mapping[str, Any]) -> None:
        """Adds a finished run: its frames, then its summary, each synced to disk."""
        for name, columns, rows in (("frames.csv", FRAME_COLUMNS, frames), ("summary.csv", self._columns, [summary])):
            text = io.StringIO(newline="")
            csv.writer(text).writerows([cell(row.get(c)) for c in columns] for row in rows)
            try:
                with (self.path / name).open("ab") as file:
                    file.write(text.getvalue().encode())
                    file.flush()
                    os.fsync(file.fileno())
            except OSError as error:
                raise OSError(error.errno, error.strerror, os.fspath(self.path / name)) from None
        self.done[summary["run"]] = {c: cell(value) for c, value in summary.items()}

    def arrange(self, order: Sequence[str]) -> None:
        """Puts the rows of both tables into the order of the configuration's runs."""
        rank = {name: i for i, name in enumerate(order)}
        for name in ("frames.csv", "summary.csv"):
            rows = self._read(name)
            self._write(name, rows[:1] + sorted(rows[1:], key=lambda row: rank.get(row[0], len(rank))))

    def write_noise(self, rows: Sequence[Mapping[str, Any]]) -> None:
        """Writes `noise.csv`: a row for each column of times of the run that was timed twice."""
        text = io.StringIO(newline="")
        csv.writer(text).writerows([NOISE_COLUMNS, *([cell(row[c]) for c in NOISE_COLUMNS] for row in rows)])
        write_atomic(self.path / "noise.csv", text.getvalue())

    def provenance(self, **values: Any) -> None:
        """Writes `provenance.json`; keeps the start and the sources of what stands there already."""
        old = read_provenance(self.path)
        record = {
            "lodlab": version(),
            "commit": commit(),
            "start": now(),
            **old,
            "machine": machine(),
            **values,
        }
        record["sources"] = {**old.get("sources", {}), **values.get("sources", {})}
        record["jobs"] = sorted({*old.get("jobs", []), *values.get("jobs", [])})
        record["end"] = now()
        write_atomic(self.path / "provenance.json", json.dumps(record, indent=2) + "\n")

    def close(self) -> None:
        """Lets go of the lock."""
        self._lock.close()

    def __enter__(self) -> RunDirectory:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
