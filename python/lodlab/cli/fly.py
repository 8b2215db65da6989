# SPDX-License-Identifier: MIT
"""The commands that make runs: fly, compare, sweep; and report, which writes their page anew."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

import lodlab

from ..errors import InvalidInput
from ..figures import number
from ..instrument.yardstick import MEASURES
from ..paths.deform import NAMES as DEFORMS
from .arguments import (
    Device,
    Jobs,
    Limits,
    Measuring,
    OptionTexts,
    OutFolder,
    SourceOption,
    SourceText,
    StoreFile,
    Stores,
    Track,
    completing,
    numbers_of,
    options_from,
    print_table,
    unfolded,
)
from .build import open_store

commands = typer.Typer()


@commands.command("fly", epilog="Example: lodlab fly jacksboro.lod --out runs/one --pixel-error 1 --path orbit")
@unfolded
def fly_command(
    store: StoreFile,
    out: OutFolder,
    track: Track,
    limits: Limits,
    measuring: Measuring,
    deform: Annotated[
        str | None,
        typer.Option(
            "--deform",
            metavar="NAME|FILE.npy",
            help="bend, twist, wave, or control positions (F, V, 3): a mesh deformed on the way, where the method can.",
            autocompletion=completing(lambda: DEFORMS),
        ),
    ] = None,
    option: OptionTexts = None,
    stores: Stores = None,
    device: Device = None,
    source: SourceOption = None,
) -> None:
    """One run, timed and measured.

    A store along a path under a budget; at least one budget is given where the method takes any. A directory that
    holds other runs grows by this one.
    """
    run = lodlab.fly(
        open_store(store, source), budget=limits.given(), device=device, out=out, stores=stores, deform=deform,
        **track.given(), **vars(measuring), **options_from(option),
    )  # fmt: skip
    print_runs([run.summary])
    typer.echo(f"report: {out / 'report.html'}")


def print_runs(rows: Sequence[Any]) -> None:
    """The runs at a glance."""
    head = ["run", "frame ms", "p95", "triangles", "predicted px", "measured px", "cracks", "budget met"]
    names = (
        "frame_ms_median",
        "frame_ms_p95",
        "triangles_median",
        "predicted_px_worst",
        "measured_px_max_worst",
        "crack_pixels_worst",
    )
    body = [[r["run"], *(number(r[n]).replace("\u202f", ",") for n in names), number(r["budget_met"])] for r in rows]
    print_table(head, body)


@commands.command(
    "compare", epilog="Example: lodlab compare jacksboro --out runs/mine --pixel-errors 0.5,1,2 -o chunked.morph=false"
)
@unfolded
def compare_command(
    source: SourceText,
    out: OutFolder,
    track: Track,
    measuring: Measuring,
    methods: Annotated[
        str | None, typer.Option("--methods", metavar="A,B", help="Methods beside full [default: all that can].")
    ] = None,
    pixel_errors: Annotated[
        str | None, typer.Option("--pixel-errors", metavar="P,P,...", help="[default: 0.5,1,2,4,8]")
    ] = None,
    triangles: Annotated[str | None, typer.Option("--triangles", metavar="T,T,...", help="Hard limits.")] = None,
    nodes: Annotated[str | None, typer.Option("--nodes", metavar="N,N,...", help="Hard limits.")] = None,
    option: Annotated[
        list[str] | None, typer.Option("-o", metavar="METHOD.NAME=VALUE", help="An option; may be repeated.")
    ] = None,
    jobs: Jobs = 1,
    stores: Stores = None,
    device: Device = None,
) -> None:
    """Methods beside full, over a grid of budgets.

    Every method that accepts the source; where several kinds of budgets are given, every combination. Goes on
    where it was stopped; a directory grows by more budgets, methods and options. Ends with the report.
    """
    options: dict[str, dict[str, str]] = {}
    for name, value in options_from(option).items():
        method, dot, key = name.partition(".")
        if not dot:
            raise InvalidInput(f"compare: option {name!r} names no method; give METHOD.NAME=VALUE")
        options.setdefault(method, {})[key] = value
    result = lodlab.compare(
        source,
        methods=None if methods is None else methods.split(","),
        pixel_errors=numbers_of("pixel-errors", pixel_errors, float),
        triangles=numbers_of("triangles", triangles, int),
        nodes=numbers_of("nodes", nodes, int),
        options=options,
        **track.given(),
        **vars(measuring),
        jobs=jobs,
        device=device,
        out=out,
        stores=stores,
    )
    finish(result, out)


@commands.command("sweep", epilog="Example: lodlab sweep runs/demo/config.toml --out runs/again --jobs 2")
def sweep_command(
    config: Annotated[Path, typer.Argument(metavar="CONFIG.toml", help="See docs/sweeps.md.")],
    out: OutFolder,
    metrics: Annotated[
        str | None,
        typer.Option(
            "--metrics",
            metavar="all|geometry",
            help="What to measure [default: the file's].",
            autocompletion=completing(lambda: MEASURES),
        ),
    ] = None,
    jobs: Jobs = 1,
    stores: Stores = None,
) -> None:
    """Runs over a grid that a file describes.

    Sources, paths, methods, options and budgets: see docs/sweeps.md, or the config.toml of any run directory. Goes
    on where it was stopped; a directory grows by more of them. Ends with the report.
    """
    finish(lodlab.sweep(config, out=out, jobs=jobs, metrics=metrics, stores=stores), out)


def finish(result: Any, out: Path) -> None:
    """What compare and sweep end with."""
    print_runs(result.summary.to_dict("records"))
    typer.echo(f"report: {out / 'report.html'}")


@commands.command(epilog="Example: lodlab report runs/demo")
def report(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="A run directory.")],
) -> None:
    """(Re)writes a run's report and charts."""
    typer.echo(f"report: {lodlab.report.write(run)}")
