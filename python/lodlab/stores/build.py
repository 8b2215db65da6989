# SPDX-License-Identifier: MIT
"""Building stores, and folders of stores that are built once."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from .. import _core
from ..disk import attribute_hash, short_hash
from ..errors import StoreError
from ..sources.base import Source
from ..sources.datasets import as_source
from .brought import as_text, meshes_of
from .methods import method_table
from .store import Store, open


def build(
    source: Any,
    method: str,
    path: str | os.PathLike[str],
    *,
    mode: str = "new",
    progress: bool = True,
    **options: Any,
) -> Store:
    """Builds a store and opens it.

    `source`: Source, SOURCE text or 2-D array. `options`: the method's build options. `mode`: "new"
    (the file must not exist), "force" (replace), "resume" (take up an interrupted build). InvalidInput for
    an unknown method or option, Unsupported when the method does not accept the source, StoreError when the
    file stands in the way.
    """
    from ..progress import Progress

    by_rows = method_table(method)["by_rows"]
    field = as_source(source)
    given = field.core if by_rows else field.loaded().core
    meshes = meshes_of(method, options)
    with Progress(f"build {method}", progress) as bar:
        core = _core.build(given, method, os.fspath(path), as_text(method, options), mode, bar.stage, meshes)
    return Store(core, field)


def store_file(source: Source, method: str, options: Mapping[str, Any], folder: Path) -> Path:
    """Where `store_for` keeps the store of a source, method and build options."""
    resolved = _core.resolve_options(method, "build", as_text(method, options))
    colours = attribute_hash(resolved)
    digest = short_hash({"source": source.hash(), "options": resolved, **({"files": colours} if colours else {})})
    return folder / f"{method}-{digest}.lod"


def store_for(
    source: Source,
    method: str,
    options: Mapping[str, Any],
    folder: Path,
    *,
    progress: bool = True,
    named: bool = False,
) -> Store:
    """The store of a source, method and build options in a `stores/` folder.

    Reused when it is there with the same source, options and colours; an interrupted build is taken up. `named`: the
    user's own folder, where a store of any name is reused, but for those with colours, whose raster may have
    changed since.
    """
    resolved = _core.resolve_options(method, "build", as_text(method, options))
    folder.mkdir(parents=True, exist_ok=True)
    file = store_file(source, method, resolved, folder)

    def fits(store: Store) -> bool:
        return store.method == method and store.source_hash == source.hash() and store.options == resolved

    user = named and not attribute_hash(resolved) and not file.exists()
    for store in map(_opened, sorted(folder.glob("*.lod")) if user else []):
        if store is not None and fits(store):
            store.attach(source)
            return store
    if file.exists():
        store = open(file)
        if fits(store):
            store.attach(source)
            return store
        raise StoreError(f"stores: {file} is not the store that its name says; remove it")
    return build(source, method, file, mode="resume", progress=progress, **(resolved | dict(options)))


def _opened(file: Path) -> Store | None:
    """A store, or None for a file that is none, or not yet."""
    try:
        return open(file)
    except StoreError:
        return None
