# SPDX-License-Identifier: MIT
"""Arguments that several commands of the command line share, and how their texts are read."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

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
PathText = Annotated[
    str | None,
    typer.Option(
        "--path",
        metavar="NAME|FILE",
        help="flyover, orbit, walk, zoom, still, or a key-frame file; around meshes orbit, zoom, flyby, still "
        "[default: flyover, orbit around a mesh].",
        autocompletion=completing(lambda: NAMES),
    ),
]
Frames = Annotated[int, typer.Option("--frames", metavar="N", help="Frames of the path.")]
Size = Annotated[str, typer.Option("--size", metavar="WxH", help="Viewport in pixels.")]
Fov = Annotated[
    float | None,
    typer.Option("--fov", metavar="DEGREES", help="Horizontal field of view [default: the path's, or 60]."),
]
PixelError = Annotated[
    float | None, typer.Option("--pixel-error", metavar="P", help="Target for the projected error, pixels.")
]
Triangles = Annotated[int | None, typer.Option("--triangles", metavar="T", help="Hard limit on triangles.")]
Nodes = Annotated[int | None, typer.Option("--nodes", metavar="N", help="Hard limit on nodes.")]
OptionTexts = Annotated[
    list[str] | None, typer.Option("-o", metavar="NAME=VALUE", help="An option of the method; may be repeated.")
]
AccuracyFrames = Annotated[
    int, typer.Option("--accuracy-frames", metavar="N", help="Frames to measure, evenly spaced; 0: none.")
]
Repeat = Annotated[int, typer.Option("--repeat", metavar="N", help="Timing passes; times are medians over them.")]
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
Images = Annotated[
    str,
    typer.Option(
        "--images", metavar="all|worst|none", help="Pictures to keep.", autocompletion=completing(lambda: IMAGES)
    ),
]
Metrics = Annotated[
    str,
    typer.Option(
        "--metrics",
        metavar="all|geometry",
        help="What to measure; geometry: nothing of pictures.",
        autocompletion=completing(lambda: MEASURES),
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Print JSON.")]
Force = Annotated[bool, typer.Option("--force", help="Replace the file if it is there.")]
At = Annotated[float, typer.Option("--at", metavar="T", help="Where on the path, from 0 to 1.")]
SourceOption = Annotated[
    str | None, typer.Option("--source", metavar="SOURCE", help="The store's source, when it cannot be found again.")
]


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


def budget_from(pixel_error: float | None, triangles: int | None, nodes: int | None) -> dict[str, Any]:
    """The budgets that were given."""
    given = {"pixel_error": pixel_error, "triangles": triangles, "nodes": nodes}
    return {k: v for k, v in given.items() if v is not None}


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
