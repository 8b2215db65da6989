# SPDX-License-Identifier: MIT
"""Runs read from disk, flown once more without a clock: cuts are selected again from what the run directory says, and
must be those of its table. So every picture of a run is there, whichever it wrote.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from . import results
from .errors import InvalidInput, StoreError
from .passes import Flown, Recording, Yardstick, check_budget, look_of, make_path, still, store_file, store_for
from .sources import as_source
from .stores import options_of

_ALL = "fly with images='all' to keep its pictures"


def fly_again(run: Any) -> Flown:
    """The cuts, views and instrument of a run in a run directory.

    InvalidInput, with the reason, where they cannot be had: a streamed run, a source or path that was in memory, one
    that has changed since.
    """
    directory, row = Path(run.directory), run.frames.iloc[0]
    where = f"image: run {run.name} in {directory}"
    config = results.read_config(directory / "config.toml")
    if row["stream"]:
        raise InvalidInput(f"{where}: it streamed, and what was loaded in time is not written down; {_ALL}")
    try:
        source = as_source(row["source"])
        path = make_path(row["path"], source, len(run.frames), config.get("fov"))
    except (ValueError, OSError) as error:
        raise InvalidInput(f"{where}: it cannot be drawn again: {error}; {_ALL}") from error
    _check_source(where, directory, row["source"], source)
    options, method = json.loads(row["options"]), row["method"]
    build = {name: options[name] for name in options_of(method, "build")}
    stores = directory / "stores"
    if not store_file(source, method, build, stores).exists():
        stores = results.temporary_folder(run)
    store = store_for(source, method, build, stores, progress=False)
    session = store.core.session(still(method, {name: options[name] for name in options_of(method, "draw")}))
    limits = {kind: row[f"budget_{kind}"] for kind in ("pixel_error", "triangles", "nodes")}
    given = {k: v if k == "pixel_error" else int(v) for k, v in limits.items() if not math.isnan(v)}
    budget = check_budget(method, given)
    views = list(path.views(tuple(config["size"]), config.get("fov")))
    cuts = [session.select(view, budget) for view in views]
    for f, (cut, wanted) in enumerate(zip(cuts, run.frames["triangles"], strict=True)):
        if cut.triangles != wanted:
            raise InvalidInput(
                f"{where}: frame {f} had {wanted:.0f} triangles and now has {cut.triangles}: its path {row['path']} is "
                f"another one, or the program is; {_ALL}"
            )
    yardstick = Yardstick(source, stores, False, look_of(store), config.get("metrics", "all"))
    measured = bool(run.frames["accuracy"].any())
    return Flown([], Recording(views, cuts, [], np.empty((0, len(views), 3))), session, yardstick if measured else None)


def _check_source(where: str, directory: Path, name: str, source: Any) -> None:
    """InvalidInput when a source is not one that the run directory was made of."""
    file = directory / "provenance.json"
    try:
        sources = json.loads(file.read_text())["sources"]
    except (OSError, ValueError, KeyError) as error:
        raise StoreError(f"{where}: {file} cannot be read: {error}") from error
    known = sources.get(name)
    if known != source.hash():
        raise InvalidInput(f"{where}: source {name} has changed since: hash {source.hash()} instead of {known}; {_ALL}")
