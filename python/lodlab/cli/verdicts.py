# SPDX-License-Identifier: MIT
"""The commands that end in a verdict: bench, calibrate, stability, fit, check, and the audit of a store. Status 1 when
one does not hold."""

from __future__ import annotations

import inspect
import math
import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

import lodlab

from ..runs import columns, tables
from ..runs.fitting import candidate_text, number_text
from .arguments import (
    Force,
    Json,
    Method,
    OptionTexts,
    OutFolder,
    SourceText,
    Track,
    limits_from,
    options_from,
    print_json,
    print_table,
    unfolded,
)

commands = typer.Typer()


def fail(lines: Sequence[str], most: int = 20) -> None:
    """Prints what does not hold, a line each, and ends with status 1."""
    rest = [f"and {len(lines) - most} more"] if len(lines) > most else []
    for line in [*lines[:most], *rest]:
        typer.echo(f"error: {line}", err=True)
    raise typer.Exit(1)


@commands.command("bench", epilog="Example: lodlab bench draw --json")
def bench_command(
    name: Annotated[list[str] | None, typer.Argument(metavar="NAME", help="Benchmarks [default: all].")] = None,
    json_: Json = False,
    list_: Annotated[bool, typer.Option("--list", help="Name the benchmarks.")] = False,
    check: Annotated[bool, typer.Option("--check", help="Status 1 when one falls short of its bar.")] = False,
) -> None:
    """Benchmarks, each beside a reference.

    The reference is measured in the same process, interleaved.
    """
    from ..bench import suite

    if list_:
        for key, text in suite.names().items():
            typer.echo(f"{key}: {text}")
        return
    records = suite.run(name, say=lambda text: typer.echo(text, err=True))
    typer.echo(suite.to_json(records) if json_ else suite.table(records))
    failures = suite.check(records) if check else []
    for line in failures:
        typer.echo(f"error: bench: {line}", err=True)
    if failures:
        raise typer.Exit(1)


@commands.command(epilog="Example: lodlab calibrate --json")
def calibrate(json_: Json = False) -> None:
    """The instrument against cases known on paper.

    Every metric, through build, draw and capture; within 0.1 % or 0.01 px. Status 1 when one is off.
    """
    from ..instrument import calibrate as run

    rows = run()
    if json_:
        print_json(rows.to_dict("records"))
    else:
        head = list(rows.columns)
        body = [
            [f"{v:.6g}" if isinstance(v, float) else "yes" if v is True else "NO" if v is False else v for v in row]
            for row in rows.astype(object).itertuples(index=False)
        ]
        print_table(head, body, left=2)
    bad = rows[~rows["pass"].astype(bool)]
    if len(bad):
        fail(
            [f"calibrate: {r.metric}, {r.case}: {r.returned:.6g} instead of {r.expected:.6g}" for r in bad.itertuples()]
        )
    if not json_:
        typer.echo(f"{len(rows)} cases of {rows['metric'].nunique()} metrics: all within tolerance")


@commands.command(epilog="Example: lodlab stability --out runs/stability --methods chunked --short")
def stability(
    out: OutFolder,
    methods: Annotated[str | None, typer.Option("--methods", metavar="A,B", help="[default: all]")] = None,
    scenes: Annotated[str | None, typer.Option("--scenes", metavar="s01,s02,...", help="[default: all]")] = None,
    short: Annotated[bool, typer.Option("--short", help="Minutes instead of an hour: fewer and smaller.")] = False,
    seed: Annotated[int, typer.Option("--seed", metavar="N", min=0, help="Of the random search, s20.")] = 0,
    seconds: Annotated[
        float | None, typer.Option("--seconds", metavar="S", help="How long the random search goes on, all methods.")
    ] = None,
) -> None:
    """Known failures of level of detail, tried on every method.

    Scenes s01 to s15, one figure each with its limit, and the random search, s20; writes stability.csv and
    stability.html. Status 1 on FAIL.
    """
    from ..stability import run

    result = run(
        out,
        methods=None if methods is None else methods.split(","),
        scenes=None if scenes is None else scenes.split(","),
        short=short,
        seed=seed,
        seconds=seconds,
    )
    table = result.table
    columns = ["scene", "method", "source", "figure", "value", "limit", "verdict"]
    body = [[f"{v:.4g}" if isinstance(v, float) else v for v in row] for row in table[columns].itertuples(index=False)]
    print_table(columns, body, left=4)
    for name, summary in result.searches.items():
        typer.echo(f"search, {name}: {summary}")
    typer.echo(f"report: {out / 'stability.html'}")
    if len(result.failed):
        fail([
            f"stability: {r.scene}, {r.method} on {r.source}: {r.figure} is {r.value:.6g} {r.unit} (limit: {r.limit:g})"
            for r in result.failed.itertuples()
        ])  # fmt: skip


@commands.command(epilog="Example: lodlab fit jacksboro chunked s.lod --path flyover --pixel-error 1")
@unfolded
def fit(
    source: SourceText,
    method: Method,
    store: Annotated[Path, typer.Argument(metavar="STORE", help="The file to write, NAME.lod.")],
    pixel_error: Annotated[float, typer.Option("--pixel-error", metavar="E", help="Limit of the measured error, px.")],
    track: Track,
    option: OptionTexts = None,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="RUN", help="Fly and measure the answer into this run directory.")
    ] = None,
    force: Force = False,
    json_: Json = False,
) -> None:
    """The smallest store and cheapest budget for a measured error.

    Store bytes first, then median triangles, over steps of finest_error (a factor of 1.41) and of the budget (10 %),
    such that the measured error stays within E on the path, sampled four times as densely. Status 1 with the best
    that was reached when nothing does. Ends with the two lines that fly the answer and check it.
    """
    found = lodlab.fit(
        source, method, store, pixel_error=pixel_error, out=out, force=force, **track.given(), **options_from(option)
    )  # fmt: skip
    flight = [*([] if track.path is None else ["--path", track.path]), "--frames", str(found.frames)]
    flight += ["--size", track.size, *([] if track.fov is None else ["--fov", tables.cell(track.fov)])]
    lines = fit_lines(found, out or store.with_suffix(".run"), flight) if found.reached else []
    if json_:
        print_json({**found.to_dict(), "commands": lines})
    else:
        print_fit(found)
        for line in [*lines, *([] if out is None else [f"report: {out / 'report.html'}"])]:
            typer.echo(line)
    if not found.reached:
        fail([f"fit: {pixel_error:g} px is out of reach; the best is {found.worst_px:.4g} px, written to {store}"])


def print_fit(found: Any) -> None:
    """What was chosen, and why nothing cheaper was."""

    typer.echo(f"chosen: {candidate_text(found.finest_error, found.budget)}")
    typer.echo(
        f"  {found.bytes / 1e6:.3f} MB, median {found.median_triangles:,.0f} triangles, worst measured "
        f"{found.worst_px:.4g} px over {found.verified_frames} frames ({found.candidates} candidates tried)"
    )
    if found.unmet_frames and "pixel_error" in found.budget:
        typer.echo(
            f"  budget met: no in {found.unmet_frames} of {found.frames} frames: there the finest is drawn, "
            f"with bounds of up to {found.predicted_px:.4g} px; fit goes by what is measured"
        )
    if found.unseen_frames:
        typer.echo(f"  {found.unseen_frames} frames see nothing of the source: undefined, which passes no check")
    for name, other in (("coarser", found.coarser), ("looser", found.looser)):
        if other is None:
            typer.echo(f"{name}: there is no such step")
        else:
            what = candidate_text(other.finest_error, other.budget)
            typer.echo(f"{name}: {what}: {other.worst_px:.4g} px at {other.t:.3f} of the path")


def fit_lines(found: Any, out: Path, flight: Sequence[str]) -> list[str]:
    """The commands that fly the answer, measuring every frame, and check it. `flight`: the arguments of its path."""
    budget = [
        word for name, value in found.budget.items() for word in (f"--{name.replace('_', '-')}", number_text(value))
    ]
    options = [word for name, value in found.fly_options.items() for word in ("-o", f"{name}={tables.cell(value)}")]
    measured = ["--accuracy-frames", str(found.frames)]
    fly = ["lodlab", "fly", str(found.store.path), "--out", str(out), *flight, *budget, *measured, *options]
    return [
        shlex.join(fly),
        shlex.join(["lodlab", "check", str(out), "--max", f"measured_px_max={tables.cell(found.pixel_error)}"]),
    ]


def check(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="A run directory.")],
    max_: Annotated[
        list[str] | None, typer.Option("--max", metavar="COLUMN=VALUE", help="At most; may be repeated.")
    ] = None,
    min_: Annotated[
        list[str] | None, typer.Option("--min", metavar="COLUMN=VALUE", help="At least; may be repeated.")
    ] = None,
) -> None:
    """Figures of a run against limits: the gate for your own CI.

    Columns of frames.csv hold in every frame (accuracy columns: in every measured one), columns of summary.csv in
    every run; flags count as 0 and 1. Status 1 naming run, frame and value when a figure is outside, missing or nan.
    """
    high, low = limits_from("max", max_), limits_from("min", min_)
    violations = lodlab.check(run, max=high, min=low)
    if violations:
        fail([f"check: {violation}" for violation in violations])
    typer.echo(f"{run}: {len(high) + len(low)} limits hold")


commands.command(
    help=f"{inspect.cleandoc(check.__doc__)}\n\n\b\n{columns.listing()}",
    epilog="Example: lodlab check runs/demo --max measured_px_max=8 --max hole_samples=0",
)(check)


def print_audit(audit: Any, json_: bool) -> None:
    """What an audit found; the histogram lies beside the store."""
    chart = Path(f"{audit.store.path}.audit.png")
    tight = audit.tightness
    if not math.isnan(tight):
        audit.histogram().save(chart)
    if not json_:
        rows = []
        for level, part in audit.nodes[audit.nodes["level"] >= 0].groupby("level"):
            finite = part["ratio"][part["ratio"] < math.inf]
            least, median = (f"{v:.4g}" if finite.size else "-" for v in (finite.min(), finite.median()))
            rows.append([level, part["node"].nunique(), f"{part['bound'].max():.6g}", f"{part['measured'].max():.6g}",
                         least, median, int((~part["holds"]).sum())])  # fmt: skip
        head = ["level", "nodes", "largest bound", "largest measured", "least bound/measured", "median", "broken"]
        print_table(head, rows)
        typer.echo(repr(audit)[1:-1])
        if not math.isnan(tight):
            typer.echo(f"histogram: {chart}")
    if len(audit.broken):
        fail([
            f"info: {r.drawn} cut {r.cut}, node {r.node}: measured {r.measured:.6g}, bound {r.bound:.6g}"
            for r in audit.broken.itertuples()
        ])  # fmt: skip
