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

from ..disk import attribute_hash, temporary_folder
from ..errors import InvalidInput
from ..instrument.yardstick import Yardstick, look_of
from ..paths.path import make_path, poses_hash
from ..stores.build import store_file, store_for
from ..stores.methods import options_of, still
from .flight import check_budget
from .identity import path_in, source_in
from .passes import Flown, Recording, shots_of
from .toml import read_config

_ALL = "fly with images='all' to keep its pictures"


def fly_again(run: Any) -> Flown:
    """The cuts, views and instrument of a run in a run directory.

    InvalidInput, with the reason, where they cannot be had: a streamed run, an array that the directory did not keep,
    a source, path or colour raster that has changed since.
    """
    directory, row = Path(run.directory), run.frames.iloc[0]
    where = f"image: run {run.name} in {directory}"
    config = read_config(directory / "config.toml")
    if row["stream"]:
        raise InvalidInput(f"{where}: it streamed, and what was loaded in time is not written down; {_ALL}")
    try:
        source = source_in(directory, row["source"])
        path = make_path(path_in(directory, row["path"]), source, len(run.frames), config.get("fov"))
    except (ValueError, OSError) as error:
        raise InvalidInput(f"{where}: it cannot be drawn again: {error}; {_ALL}") from error
    size, fov = tuple(config["size"]), config.get("fov")
    views = list(path.views(size, fov))
    options, method = json.loads(row["options"]), row["method"]
    build = {name: options[name] for name in options_of(method, "build")}
    now = {
        "source": ("source", source.hash()),
        "path": ("poses", poses_hash(views, path.deform)),
        "colour raster": ("attribute", attribute_hash(build)),
    }
    for what, (column, value) in now.items():
        known = row[f"{column}_hash"]
        if known != value:
            raise InvalidInput(f"{where}: its {what} has changed since: hash {value} instead of {known}; {_ALL}")
    stores = directory / "stores"
    if not store_file(source, method, build, stores).exists():
        stores = temporary_folder(run)
    store = store_for(source, method, build, stores, progress=False)
    session = store.core.session(still(method, {name: options[name] for name in options_of(method, "draw")}))
    limits = {kind: row[f"budget_{kind}"] for kind in ("pixel_error", "triangles", "nodes")}
    given = {k: v if k == "pixel_error" else int(v) for k, v in limits.items() if not math.isnan(v)}
    budget = check_budget(method, given)
    cuts = [session.select(view, budget, pose) for view, pose in shots_of(path, store, size, fov)]
    for f, (cut, wanted) in enumerate(zip(cuts, run.frames["triangles"], strict=True)):
        if cut.triangles != wanted:
            raise InvalidInput(
                f"{where}: frame {f} had {wanted:.0f} triangles and now has {cut.triangles}: the program is another "
                f"one; {_ALL}"
            )
    yardstick = Yardstick(source, stores, False, look_of(store), config.get("metrics", "all"))
    measured = bool(run.frames["accuracy"].any())
    return Flown([], Recording(views, cuts, [], np.empty((0, len(views), 3))), session, yardstick if measured else None)
