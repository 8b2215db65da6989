# SPDX-License-Identifier: MIT
"""Arguments that several commands of the command line share, and how their texts are read."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from functools import wraps
from inspect import Parameter, Signature, signature
from pathlib import Path
from typing import Annotated, Any, get_type_hints

import typer

from ..errors import InvalidInput
from ..instrument.yardstick import MEASURES
from ..paths.path import NAMES
from ..runs.flight import IMAGES
from ..sources.datasets import DATASETS
from ..stores.methods import methods


def completing(names: Callable[[], Iterable[str]]) -> Callable[[str], list[str]]:
    """What the shell completes an argument to: those of these names that begin as it does. Where none does, bash goes
    on with files."""
    return lambda incomplete: [name for name in names() if name.startswith(incomplete)]


StoreFile = Annotated[Path, typer.Argument(metavar="STORE", help="A store, as lodlab build writes it.")]
SourceText = Annotated[
    str,
    typer.Argument(
        metavar="SOURCE",
        help="NAME_OR_FILE[:key=value,...], see lodlab datasets.",
        autocompletion=completing(lambda: DATASETS),
    ),
]
Method = Annotated[
    str,
    typer.Argument(
        metavar="METHOD",
        help="One of lodlab methods.",
        autocompletion=completing(lambda: (m["name"] for m in methods())),
    ),
]
OutFolder = Annotated[Path, typer.Option("--out", metavar="RUN", help="The run directory.")]
OptionTexts = Annotated[
    list[str] | None, typer.Option("-o", metavar="NAME=VALUE", help="An option of the method; may be repeated.")
]
Jobs = Annotated[int, typer.Option("--jobs", metavar="N", help="Worker processes; more than 1 disturbs timings.")]
Stores = Annotated[
    Path | None,
    typer.Option("--stores", metavar="DIR", help="Stores to be reused; new ones go there [default: RUN/stores]."),
]
Device = Annotated[
    str | None,
    typer.Option(
        "--device",
        metavar="D",
        help="auto, software, cuda:N or an index [default: LODLAB_DEVICE, auto].",
        autocompletion=completing(lambda: ("auto", "software", "cuda:0")),
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Print JSON.")]
Force = Annotated[bool, typer.Option("--force", help="Replace the file if it is there.")]
At = Annotated[float, typer.Option("--at", metavar="T", help="Where on the path, from 0 to 1.")]
SourceOption = Annotated[
    str | None, typer.Option("--source", metavar="SOURCE", help="The store's source, when it cannot be found again.")
]


# ---- groups of options ------------------------------------------------------------------------------


@dataclass(frozen=True)
class Sight:
    """How a path is seen."""

    path: Annotated[
        str | None,
        typer.Option(
            "--path",
            metavar="NAME|FILE",
            help="flyover, orbit, walk, zoom, still, or a key-frame file; around meshes orbit, zoom, flyby, still "
            "[default: flyover, orbit around a mesh].",
            autocompletion=completing(lambda: NAMES),
        ),
    ] = None
    size: Annotated[str, typer.Option("--size", metavar="WxH", help="Viewport in pixels.")] = "1280x720"
    fov: Annotated[
        float | None,
        typer.Option("--fov", metavar="DEGREES", help="Horizontal field of view [default: the path's, or 60]."),
    ] = None

    def given(self) -> dict[str, Any]:
        """The arguments of Python for it."""
        return {**vars(self), "path": self.path or "", "size": size_of(self.size)}


@dataclass(frozen=True)
class Track(Sight):
    """A path flown in frames."""

    frames: Annotated[int, typer.Option("--frames", metavar="N", help="Frames of the path.")] = 120


@dataclass(frozen=True)
class Limits:
    """The budget of a frame."""

    pixel_error: Annotated[
        float | None, typer.Option("--pixel-error", metavar="P", help="Target for the projected error, pixels.")
    ] = None
    triangles: Annotated[int | None, typer.Option("--triangles", metavar="T", help="Hard limit on triangles.")] = None
    nodes: Annotated[int | None, typer.Option("--nodes", metavar="N", help="Hard limit on nodes.")] = None

    def given(self) -> dict[str, Any]:
        """The budgets that were given."""
        return {name: value for name, value in vars(self).items() if value is not None}


@dataclass(frozen=True)
class Measuring:
    """What is measured and kept of a run."""

    images: Annotated[
        str,
        typer.Option(
            "--images", metavar="all|worst|none", help="Pictures to keep.", autocompletion=completing(lambda: IMAGES)
        ),
    ] = "worst"
    metrics: Annotated[
        str,
        typer.Option(
            "--metrics",
            metavar="all|geometry",
            help="What to measure; geometry: nothing of pictures.",
            autocompletion=completing(lambda: MEASURES),
        ),
    ] = "all"
    accuracy_frames: Annotated[
        int, typer.Option("--accuracy-frames", metavar="N", help="Frames to measure, evenly spaced; 0: none.")
    ] = 12
    repeat: Annotated[
        int, typer.Option("--repeat", metavar="N", help="Timing passes; times are medians over them.")
    ] = 1


def unfolded(command: Callable[..., None]) -> Callable[..., None]:
    """A command for typer, each group among its arguments (a dataclass of options) as the options of that."""
    hints = get_type_hints(command, include_extras=True)
    groups = {name: kind for name, kind in hints.items() if is_dataclass(kind)}
    parameters: list[Parameter] = []
    for each in signature(command).parameters.values():
        if (kind := groups.get(each.name)) is None:
            parameters.append(each.replace(annotation=hints[each.name], kind=Parameter.KEYWORD_ONLY))
            continue
        inside = get_type_hints(kind, globals(), include_extras=True)  # whose lambdas know this module
        parameters += (
            Parameter(f.name, Parameter.KEYWORD_ONLY, default=f.default, annotation=inside[f.name])
            for f in fields(kind)
        )

    @wraps(command)
    def folded(**values: Any) -> None:
        made = {name: kind(**{f.name: values.pop(f.name) for f in fields(kind)}) for name, kind in groups.items()}
        command(**values, **made)

    folded.__signature__ = Signature(parameters)  # type: ignore[attr-defined]
    folded.__annotations__ = {each.name: each.annotation for each in parameters}
    return folded


# ---- texts ----------------------------------------------------------------------------------------


def size_of(text: str) -> tuple[int, int]:
    """(width, height) from `1280x720`."""
    width, cross, height = text.lower().partition("x")
    if not (cross and width.isdecimal() and height.isdecimal()):
        raise InvalidInput(f"size: {text!r} is not WIDTHxHEIGHT in pixels, as 1280x720")
    return int(width), int(height)


def options_from(texts: Sequence[str] | None) -> dict[str, str]:
    """{name: text} from NAME=VALUE texts."""
    out: dict[str, str] = {}
    for text in texts or ():
        name, equals, value = text.partition("=")
        if not equals or not name:
            raise InvalidInput(f"option: {text!r} is not NAME=VALUE")
        if name in out:
            raise InvalidInput(f"option: {name} is given twice")
        out[name] = value
    return out


def numbers_of(name: str, text: str | None, kind: type) -> list[Any] | None:
    """Numbers from a comma-separated list; None when it was not given."""
    if text is None:
        return None
    try:
        return [kind(part) for part in text.split(",")]
    except ValueError:
        what = "whole numbers" if kind is int else "numbers"
        raise InvalidInput(f"{name}: {text!r} is not a list of {what} with commas between them") from None


def limits_from(name: str, texts: Sequence[str] | None) -> dict[str, float]:
    """{column: limit} from COLUMN=VALUE texts."""
    out: dict[str, float] = {}
    for column, text in options_from(texts).items():
        try:
            out[column] = float(text)
        except ValueError:
            raise InvalidInput(f"check: --{name} {column}={text}: {text!r} is no number") from None
    return out


def print_table(head: Sequence[str], rows: Sequence[Sequence[Any]], left: int = 1) -> None:
    """Columns for people: the first `left` ones left, the others right."""
    cells = [[str(c) for c in row] for row in (head, *rows)]
    widths = [max(len(row[i]) for row in cells) for i in range(len(head))]
    for row in cells:
        padded = [c.ljust(w) if i < left else c.rjust(w) for i, (c, w) in enumerate(zip(row, widths, strict=True))]
        typer.echo("  ".join(padded).rstrip())


def print_json(value: Any) -> None:
    """JSON on standard output; undefined numbers are null, infinite ones the text `inf`."""
    typer.echo(json.dumps(_plain(value), indent=2, allow_nan=False))


def _plain(value: Any) -> Any:
    """A value as JSON has it."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if hasattr(value, "item"):  # numpy
        return _plain(value.item())
    if isinstance(value, float) and not math.isfinite(value):
        return None if math.isnan(value) else "inf" if value > 0 else "-inf"
    return value if value is None or isinstance(value, (bool, int, float, str)) else str(value)
