# SPDX-License-Identifier: MIT
"""The commands that say what is there: doctor, devices, methods, datasets."""

from __future__ import annotations

from typing import Any

import typer

import lodlab

from ..runs import tables
from ..sources import datasets
from .arguments import Json, print_json, print_table

commands = typer.Typer()


@commands.command(epilog="Example: lodlab doctor")
def doctor() -> None:
    """What this machine has, and whether it draws.

    A triangle is really drawn and read back. Status 1, with the cure, when something needed is missing.
    """
    from .doctor import examine

    missing = []
    for finding in examine():
        mark = {True: "ok ", False: "NO ", None: "   "}[finding.ok]
        typer.echo(f"{mark} {finding.what}: {finding.text}")
        if finding.ok is False:
            missing.append(finding)
            typer.echo(f"     cure: {finding.cure}")
    if missing:
        typer.echo(f"error: doctor: missing: {', '.join(f.what for f in missing)}", err=True)
        raise typer.Exit(1)
    typer.echo("everything that lodlab needs is there")


@commands.command("devices", epilog="Example: lodlab devices --json")
def devices_command(json_: Json = False) -> None:
    """EGL devices: what --device and LODLAB_DEVICE choose from."""
    found = lodlab.devices()
    if json_:
        print_json(found)
        return
    print_table(["index", "name"], [[d["index"], d["name"] + (" (software)" if d["software"] else "")] for d in found])


@commands.command("methods", epilog="Example: lodlab methods --json")
def methods_command(json_: Json = False) -> None:
    """Methods with their budgets and options."""
    found = lodlab.methods()
    if json_:
        print_json(found)
        return
    for method in found:
        typer.echo(f"{method['name']}: {method['summary']}")
        needs = f" ({method['needs']})" if method["needs"] else ""
        budgets = ", ".join(method["budgets"]) or "ignored"
        typer.echo(f"  accepts {', '.join(method['accepts'])}{needs}; budgets {budgets}")
        for option in method["options"]:
            typer.echo(f"  -o {option['name']}={tables.cell(option['default'])}  {option_text(option)}")
        typer.echo("")


def option_text(option: dict[str, Any]) -> str:
    """Stage, type, range, unit and meaning of an option."""
    kind = " | ".join(option["choices"]) if option.get("choices") else option["type"]
    if option.get("range"):
        low, high = option["range"]
        kind += f" from {low:g}" if low is not None else ""
        kind += f" to {high:g}" if high is not None else ""
    unit = f" {option['unit']}" if option.get("unit") else ""
    return f"({option['stage']}; {kind}{unit}) {option['help']}"


@commands.command("datasets", epilog="Example: lodlab datasets")
def datasets_command(json_: Json = False) -> None:
    """Built-in and generated sources."""
    found = datasets.list()
    if json_:
        print_json(found)
        return
    for entry in found:
        typer.echo(f"{entry['name']}: {entry['description']}")
        size = f"{entry['triangles']:,} triangles" if entry["kind"] == "mesh" else _grid_text(entry)
        typer.echo(f"  {size}; keys: {', '.join(entry['keys'])}")


def _grid_text(entry: dict[str, Any]) -> str:
    """Samples and spacing of a data set of heights."""
    dx, dy = entry["spacing"]
    return f"{entry['rows']} x {entry['cols']} samples, {dx:g} x {dy:g} m"
