# SPDX-License-Identifier: MIT
"""The run directory: what a run leaves on disk, so that it can be read, charted, repeated and resumed.

`config.toml` (frozen configuration), `provenance.json`, `frames.csv` (a row a frame), `summary.csv`
(a row a run), `noise.csv` (one run timed twice), `images/`, `stores/`, and what `report` makes of them.

Invariant: a run counts as done when its row stands in `summary.csv`. Its frames are appended (and
synced) before that row, so a killed sweep leaves at most frames without a summary; they are dropped when
the directory is opened for writing again, and the run is repeated. A run is known by what decides its rows, not
by its name: a grid that grows may rename what is done.

Longer than other files: columns, tables, provenance and resumption rest on that one invariant.
"""

from __future__ import annotations

import csv
import fcntl
import io
import json
import math
import os
import platform
import shutil
import subprocess
import tomllib
import warnings
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from ..disk import write_atomic
from ..errors import InvalidInput, StoreError
from ..instrument import statistics
from ..instrument.metrics import METRICS
from .columns import COSTS, EXTRAS, FLAG, HASHES, KEYS, NOISE, TEXT

KEY_COLUMNS = tuple(column.name for column in KEYS)
COST_COLUMNS = tuple(column.name for column in COSTS)
TIME_COLUMNS = ("select_ms", "gpu_ms", "frame_ms")
ACCURACY_COLUMNS = tuple(metric.name for metric in METRICS)
SMALLER_IS_WORSE = tuple(metric.name for metric in METRICS if metric.smaller_is_worse)
EXTRA_COLUMNS = tuple(column.name for column in EXTRAS)
HASH_COLUMNS = tuple(column.name for column in HASHES)
FRAME_COLUMNS = KEY_COLUMNS + COST_COLUMNS + ACCURACY_COLUMNS + EXTRA_COLUMNS + HASH_COLUMNS
OPTION = "option."  # `summary.csv` has a column more for every option that some run has
SUMMARY_COLUMNS = (
    tuple(c for c in KEY_COLUMNS if c != "frame")
    + tuple(f"{c}_{s}" for c in COST_COLUMNS for s in ("median", "p95", "p99"))
    + tuple(f"{c}_{s}" for c in ACCURACY_COLUMNS for s in ("worst", "median"))
    + ("store_bytes", "build_seconds", "gpu_clock", "frames", "accuracy_frames")
    + tuple(f"{c}_median_{s}" for c in TIME_COLUMNS for s in ("low", "high"))
    + HASH_COLUMNS
)
NOISE_COLUMNS = tuple(column.name for column in NOISE)
_TABLES = (*KEYS, *EXTRAS, *HASHES, *NOISE)
TEXT_COLUMNS = tuple(dict.fromkeys(column.name for column in _TABLES if column.unit == TEXT))
_FLAG_COLUMNS = tuple(column.name for column in _TABLES if column.unit == FLAG)


# ---- values and rows ------------------------------------------------------------------------------


def cell(value: Any) -> str:
    """One CSV cell: `true`/`false`, empty when unset (None), `nan`, `inf`, shortest exact number."""
    if value is None:
        return ""
    if isinstance(value, (bool, np.bool_)):
        return "true" if value else "false"
    if isinstance(value, (int, np.integer)):
        return str(int(value))
    if isinstance(value, (float, np.floating)):
        number = float(value)
        if math.isnan(number):
            return "nan"
        if math.isinf(number):
            return "inf" if number > 0 else "-inf"
        return repr(number)
    return str(value)


def options_text(options: Mapping[str, Any]) -> str:
    """Compact JSON of all options, keys sorted: the column `options`."""
    return json.dumps(dict(options), sort_keys=True, separators=(",", ":"))


def short_source(text: str) -> str:
    """A SOURCE text for people: of a file, its name without the folders, keys kept."""
    head, colon, keys = text.partition(":")
    return os.path.basename(head) + colon + keys


def summarize(
    rows: Sequence[Mapping[str, Any]], *, store_bytes: int, build_seconds: float, times: np.ndarray | None = None
) -> dict[str, Any]:
    """The summary row of a run's frame rows: medians and percentiles of costs, worst and median of errors.

    `times`: (passes, frames, 3) of every timing pass, for the intervals of the medians; the rows' own when left
    out. `predicted_px` is known in every frame; the other accuracy columns are taken over the frames that were
    measured, and are nan when none was.
    """
    first = rows[0]
    out: dict[str, Any] = {c: first[c] for c in KEY_COLUMNS if c != "frame"}
    out["budget_met"] = all(r["budget_met"] for r in rows)
    out["promises_bound"] = all(r["promises_bound"] for r in rows)
    for column in COST_COLUMNS:
        values = np.array([r[column] for r in rows], dtype=np.float64)
        out[f"{column}_median"] = float(np.median(values))
        out[f"{column}_p95"] = float(np.percentile(values, 95))
        out[f"{column}_p99"] = float(np.percentile(values, 99))
    for column in ACCURACY_COLUMNS:
        values = np.array([r[column] for r in rows], dtype=np.float64)
        values = values[~np.isnan(values)]
        worst = np.min if column in SMALLER_IS_WORSE else np.max
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # the median of two infinities
            out[f"{column}_worst"] = float(worst(values)) if values.size else math.nan
            out[f"{column}_median"] = float(np.median(values)) if values.size else math.nan
    out["store_bytes"] = store_bytes
    out["build_seconds"] = build_seconds
    out["gpu_clock"] = first["gpu_clock"]
    out["frames"] = len(rows)
    out["accuracy_frames"] = sum(1 for r in rows if r["accuracy"])
    if times is None:
        times = np.array([[[r[c] for c in TIME_COLUMNS] for r in rows]], dtype=np.float64)
    for column, (low, high) in zip(TIME_COLUMNS, statistics.median_intervals(times).T.tolist(), strict=True):
        out[f"{column}_median_low"], out[f"{column}_median_high"] = low, high
    out.update({column: first[column] for column in HASH_COLUMNS})
    out.update({f"{OPTION}{name}": value for name, value in json.loads(first["options"]).items()})
    return out


def summary_columns(rows: Iterable[Mapping[str, Any]], known: Sequence[str] = ()) -> tuple[str, ...]:
    """The columns of a summary of these rows: SUMMARY_COLUMNS, those of options that are `known` already, then new
    ones in the order of their names."""
    known = [c for c in known if c.startswith(OPTION)]
    new = {c for row in rows for c in row if c.startswith(OPTION)} - set(known)
    return (*SUMMARY_COLUMNS, *known, *sorted(new))


def summary_table(rows: Sequence[Mapping[str, Any]]) -> Any:
    """Summary rows as a DataFrame that equals the one read back from `summary.csv`."""
    columns = summary_columns(rows)
    return table([{c: row.get(c) for c in columns} for row in rows], columns)


def read_table(path: Path | str) -> Any:
    """A `frames.csv`, `summary.csv` or `noise.csv` as a pandas DataFrame: bools as bool, unset and undefined as NaN.

    StoreError where it is not whole: cut off, a column missing, a row or a cell that is none.
    """
    import pandas as pd

    path = Path(path)
    if not path.is_file():
        raise InvalidInput(f"read results: no file {path} (a run directory has frames.csv and summary.csv)")
    data = path.read_bytes()
    try:
        header, *rows = csv.reader(io.StringIO(data.decode(), newline=""))
    except (ValueError, csv.Error) as error:  # not text, or empty
        why = f"it is no table ({error})" if data else "it is empty"
        raise _damaged(path, why, cut=not data) from None
    if absent := [c for c in _COLUMNS.get(path.name, ()) if c not in header]:
        raise _damaged(path, f"it has no column {absent[0]}")
    for number, row in enumerate(rows, 1):
        if len(row) != len(header):
            raise _damaged(path, f"row {number} has {len(row)} of {len(header)} cells", cut=True)
    if not data.endswith(b"\n"):
        raise _damaged(path, f"its last row, {len(rows)}, is cut off", cut=True)
    text = {c: str for c in header if c in TEXT_COLUMNS}
    missing = {c: ["", "nan"] for c in header if c not in TEXT_COLUMNS and c not in _FLAG_COLUMNS}
    table = pd.read_csv(io.BytesIO(data), dtype=text, keep_default_na=False, na_values=missing)
    for column in (c for c in _COLUMNS.get(path.name, ()) if c not in text):
        flag = column in _FLAG_COLUMNS
        if table.empty:
            table[column] = table[column].astype("bool" if flag else "float64")
        elif (table[column].dtype.kind == "b") != flag or table[column].dtype.kind not in "biuf":
            raise _damaged(path, f"column {column} holds what is no {'flag' if flag else 'number'}")
    return table


_COLUMNS = {"frames.csv": FRAME_COLUMNS, "summary.csv": SUMMARY_COLUMNS, "noise.csv": NOISE_COLUMNS}


def _damaged(path: Path, why: str, *, cut: bool = False) -> StoreError:
    """`cut`: what is whole of it can be used."""
    again = "a sweep of its config.toml into this directory flies again what is not whole"
    cure = "" if not cut else "; without it the runs can still be read" if path.name == "noise.csv" else f"; {again}"
    return StoreError(f"read results: {path} is damaged, or of another version: {why}{cure}")


def read_runs(folder: Path) -> tuple[Any, Any]:
    """`frames.csv` and `summary.csv` of a run directory. StoreError where a finished run lacks frames."""
    frames, summary = (read_table(folder / name) for name in ("frames.csv", "summary.csv"))
    there = frames["run"].value_counts()
    for run, count in summary[["run", "frames"]].itertuples(index=False):
        if there.get(run, 0) < count:
            why = f"run {run} has {there.get(run, 0)} of {count} frames"
            raise _damaged(folder / "frames.csv", why, cut=True)
    return frames, summary


def read_provenance(folder: Path) -> dict[str, Any]:
    """`provenance.json` of a run directory; empty where there is none."""
    file = folder / "provenance.json"
    try:
        return json.loads(file.read_bytes()) if file.exists() else {}
    except ValueError as error:
        raise StoreError(f"read results: {file} is damaged ({error}); without it results can still be read") from None


def read_noise(folder: Path | None) -> Any:
    """`noise.csv` of a run directory, or None where there is none."""
    file = None if folder is None else folder / "noise.csv"
    return read_table(file) if file is not None and file.is_file() else None


def table(rows: Iterable[Mapping[str, Any]], columns: Sequence[str]) -> Any:
    """Rows as a DataFrame that equals the one read back from the file."""
    import pandas as pd

    frame = pd.DataFrame([[r[c] for c in columns] for r in rows], columns=list(columns))
    for column in ("budget_pixel_error", "budget_triangles", "budget_nodes"):
        if column in frame:
            frame[column] = frame[column].astype("float64")
    return frame


# ---- configuration --------------------------------------------------------------------------------


def toml_text(config: Mapping[str, Any]) -> str:
    """A configuration as TOML: scalars and lists, tables, arrays of tables. None is left out."""
    lines: list[str] = []
    _toml_table(lines, config, "")
    return "\n".join(lines) + "\n"


def _toml_table(lines: list[str], values: Mapping[str, Any], prefix: str) -> None:
    def is_tables(value: Any) -> bool:
        return isinstance(value, list) and bool(value) and all(isinstance(v, Mapping) for v in value)

    for key, value in values.items():
        if value is not None and not isinstance(value, Mapping) and not is_tables(value):
            lines.append(f"{key} = {_toml_value(value)}")
    for key, value in values.items():
        if isinstance(value, Mapping):
            lines += ["", f"[{prefix}{key}]"]
            _toml_table(lines, value, f"{prefix}{key}.")
        elif is_tables(value):
            for item in value:
                lines += ["", f"[[{prefix}{key}]]"]
                _toml_table(lines, item, f"{prefix}{key}.")


def _toml_value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (int, float)):
        return cell(value)
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_toml_value(v) for v in value) + "]"
    raise TypeError(f"no TOML form for {type(value).__name__}")


def first_difference(old: Any, new: Any, where: str = "") -> str | None:
    """Names the first key at which two configurations differ, or None."""
    if isinstance(old, Mapping) and isinstance(new, Mapping):
        for key in [*old, *(k for k in new if k not in old)]:
            if key not in old or key not in new:
                return f"{where}{key}: {old.get(key, 'unset')} there, {new.get(key, 'unset')} now"
            found = first_difference(old[key], new[key], f"{where}{key}.")
            if found:
                return found
        return None
    if isinstance(old, list) and isinstance(new, list):
        for i, (a, b) in enumerate(zip(old, new, strict=False)):
            found = first_difference(a, b, f"{where}{i + 1}.")
            if found:
                return found
    return None if old == new else f"{where.rstrip('.')}: {old!r} there, {new!r} now"


# ---- provenance -----------------------------------------------------------------------------------


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


# ---- the directory --------------------------------------------------------------------------------


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


HEAD = "# lodlab run configuration, every default written out. Repeat: lodlab sweep config.toml --out DIRECTORY\n"


def read_config(file: Path | str) -> dict[str, Any]:
    """A TOML file as a dict; InvalidInput names file, line and column of a mistake."""
    file = Path(file)
    if not file.is_file():
        raise InvalidInput(f"configuration: no file {file}")
    try:
        return tomllib.loads(file.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InvalidInput(f"configuration: {file} is not valid TOML: {error}") from None
