# SPDX-License-Identifier: MIT
"""The commands of stores: build, info."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

import lodlab

from .. import _core
from ..disk import is_store
from ..errors import InvalidInput
from ..runs import tables
from ..sources.base import FieldSource
from ..sources.mesh import Mesh
from . import verdicts
from .arguments import Force, Json, Method, OptionTexts, SourceOption, SourceText, options_from, print_json, print_table

commands = typer.Typer()


def open_store(path: Path, source: str | None = None) -> Any:
    """Opens a store that must be there."""
    if not path.is_file() and not Path(f"{path}.partial").is_file():  # the core says that one is incomplete
        raise InvalidInput(f"open store: no file {path}; lodlab build SOURCE METHOD STORE writes one")
    return lodlab.open(path, source)


@commands.command("build", epilog="Example: lodlab build jacksboro chunked jacksboro.lod -o finest_error=0.5")
def build_command(
    source: SourceText,
    method: Method,
    store: Annotated[Path, typer.Argument(metavar="STORE", help="The file to write, NAME.lod.")],
    option: OptionTexts = None,
    force: Force = False,
    resume: Annotated[bool, typer.Option("--resume", help="Take up an interrupted build.")] = False,
) -> None:
    """Builds a store of a source.

    Ends with sizes, seconds and error bounds per level.
    """
    if force and resume:
        raise InvalidInput("build: --force and --resume exclude each other")
    if store.is_file() and not (force or resume):
        raise InvalidInput(f"build: {store} is there already; --force replaces it")
    if store.is_dir():
        raise InvalidInput(f"build: {store} is a directory; name a file")
    if not store.parent.is_dir():
        raise InvalidInput(f"build: no directory {store.parent}")
    mode = "force" if force else "resume" if resume else "new"
    options = options_from(option)
    _core.resolve_options(method, "build", options)
    built = lodlab.build(source, method, store, mode=mode, **options)
    print_levels(built.info())
    typer.echo(f"{store}: {built.bytes / 1e6:.2f} MB in {built.build_seconds:.2f} s")


def print_levels(info: dict[str, Any]) -> None:
    """Nodes, triangles and error bound of each level."""
    rows = [[v["level"], f"{v['nodes']:,}", f"{v['triangles']:,}", f"{v['error_max']:.6g}"] for v in info["levels"]]
    print_table(["level", "nodes", "triangles", "error bound"], rows)
    typer.echo(
        f"{info['bytes_per_sample']:.2f} bytes per sample, {info['bytes_per_vertex']:.1f} bytes per vertex, "
        f"quantum {info['quantum']:.6g}"
    )
    if "build" in info:
        told = {**info["build"], **{f"{stage} s": round(s, 3) for stage, s in info["build"].get("seconds", {}).items()}}
        typer.echo(", ".join(f"{name.replace('_', ' ')} {value}" for name, value in told.items() if name != "seconds"))


@commands.command(epilog="Example: lodlab info jacksboro.lod --verify")
def info(
    what: Annotated[str, typer.Argument(metavar="STORE_OR_SOURCE", help="A store or a source.")],
    json_: Json = False,
    verify: Annotated[bool, typer.Option("--verify", help="Read and check all of a store.")] = False,
    audit: Annotated[bool, typer.Option("--audit", help="Measure every bound of a store.")] = False,
    cuts: Annotated[int, typer.Option("--cuts", metavar="N", help="With --audit: random cuts besides.")] = 0,
    option: OptionTexts = None,
    source: SourceOption = None,
) -> None:
    """What a store or a source is.

    With --audit every node is drawn in every state of morph and edges and measured against its bound (-o gives
    draw options); status 1 when one is broken.
    """
    if (cuts or option or source) and not audit:
        raise InvalidInput("info: --cuts, -o and --source are for --audit")
    if not is_store(what):
        if verify or audit:
            raise InvalidInput(f"info: {what} is a source; --{'verify' if verify else 'audit'} is for stores")
        found = source_info(what)
        print_json(found) if json_ else print_table(["", ""], [[k, _shown(v)] for k, v in found.items()], left=2)
        return
    store = open_store(Path(what), source)
    found = store.info()
    if verify:
        store.verify()
    audited = lodlab.instrument.audit(store, cuts=cuts, **options_from(option)) if audit else None
    if json_:
        extra = {**({"verified": True} if verify else {}), **({"audit": audited.to_dict()} if audited else {})}
        print_json({**found, **extra})
        if audited:
            verdicts.print_audit(audited, json_=True)
        return
    for key in ("method", "source", "source_hash", "content_hash", "format_version", "bytes", "build_seconds"):
        typer.echo(f"{key}: {found[key]}")
    typer.echo(f"options: {tables.options_text(found['options'])}")
    print_levels(found)
    if verify:
        typer.echo("verified: every page is as it was written")
    if audited:
        verdicts.print_audit(audited, json_=False)


def _shown(value: Any) -> str:
    """A value of `info` for people."""
    if isinstance(value, list):
        return ", ".join(f"{v:.9g}" if isinstance(v, float) else str(v) for v in value)
    return str(value)


def source_info(text: str) -> dict[str, Any]:
    """What `info` says of a source."""
    source = lodlab.datasets.load(text)
    said = _mesh_info(source) if source.kind == "mesh" else _field_info(source)
    return {"source": source.spec, **source.used, **said, "source_hash": source.hash()}


def _field_info(field: FieldSource) -> dict[str, Any]:
    flat = ("dx", "dy", "x0", "y0")
    round_ = ("radius", "lon0", "lat0", "dlon", "dlat", "wraps")
    hidden = flat if field.planet else round_
    frame = {k: v for k, v in field.core.frame().items() if k not in hidden}
    return {**frame, "samples": field.samples, "void_samples": field.void_samples}


def _mesh_info(mesh: Mesh) -> dict[str, Any]:
    low, high = mesh.bounds.tolist()
    attributes = [what for what, array in (("colors", mesh.colors), ("normals", mesh.normals)) if array is not None]
    return {
        "vertices": mesh.samples,
        "triangles": len(mesh.faces),
        "lowest": low,
        "highest": high,
        "extent": mesh.extent,
        "attributes": attributes,
        **mesh.census,
    }
