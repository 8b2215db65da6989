# SPDX-License-Identifier: MIT
"""The command line: a thin layer over the Python face. Exit status: 0 done; 1 something failed, a check did not
hold, or a run broke a promise (its results are there); 2 the user's mistake; 130 stopped by Ctrl-C. `LODLAB_DEBUG=1`
shows the traceback of any error.

Longer than other files because every command declares its arguments here, each on its line.
"""

from __future__ import annotations

import errno
import os
import sys
import traceback
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

import lodlab

from .. import _core, pictures
from ..disk import is_store
from ..errors import BrokenPromise, GLError, InvalidInput, StoreError, Unsupported, check_one_of
from ..instrument.yardstick import MEASURES
from ..runs import tables
from ..sources import datasets
from ..stores.session import SHOWS
from . import verdicts
from .arguments import (
    AccuracyFrames,
    At,
    Device,
    Force,
    Fov,
    Frames,
    Images,
    Jobs,
    Json,
    Method,
    Metrics,
    Nodes,
    OptionTexts,
    OutFolder,
    PathText,
    PixelError,
    Repeat,
    Size,
    SourceOption,
    SourceText,
    StoreFile,
    Stores,
    Triangles,
    budget_from,
    completing,
    numbers_of,
    options_from,
    print_json,
    print_table,
    size_of,
)

app = typer.Typer(
    name="lodlab",
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    epilog="Example: lodlab compare jacksboro --out runs/jacksboro",
)


def _version(asked: bool) -> None:
    if asked:
        typer.echo(f"lodlab {lodlab.__version__}")
        raise typer.Exit


@app.callback()
def program(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Say the version and exit.")
    ] = False,
) -> None:
    """A laboratory for level of detail: build hierarchies of terrains, fly them under budgets, measure."""


def open_store(path: Path, source: str | None = None) -> Any:
    """Opens a store that must be there."""
    if not path.is_file() and not Path(f"{path}.partial").is_file():  # the core says that one is incomplete
        raise InvalidInput(f"open store: no file {path}; lodlab build SOURCE METHOD STORE writes one")
    return lodlab.open(path, source)


# ---- what is there --------------------------------------------------------------------------------


@app.command(epilog="Example: lodlab doctor")
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


@app.command("devices", epilog="Example: lodlab devices --json")
def devices_command(json_: Json = False) -> None:
    """EGL devices: what --device and LODLAB_DEVICE choose from."""
    found = lodlab.devices()
    if json_:
        print_json(found)
        return
    print_table(["index", "name"], [[d["index"], d["name"] + (" (software)" if d["software"] else "")] for d in found])


@app.command("methods", epilog="Example: lodlab methods --json")
def methods_command(json_: Json = False) -> None:
    """Methods with their budgets and options."""
    found = lodlab.methods()
    if json_:
        print_json(found)
        return
    for method in found:
        typer.echo(f"{method['name']}: {method['summary']}")
        typer.echo(f"  accepts {', '.join(method['accepts'])}; budgets {', '.join(method['budgets']) or 'ignored'}")
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


@app.command("datasets", epilog="Example: lodlab datasets")
def datasets_command(json_: Json = False) -> None:
    """Built-in and generated sources."""
    found = datasets.list()
    if json_:
        print_json(found)
        return
    for entry in found:
        typer.echo(f"{entry['name']}: {entry['description']}")
        dx, dy = entry["spacing"]
        typer.echo(f"  {entry['rows']} x {entry['cols']} samples, {dx:g} x {dy:g} m; keys: {', '.join(entry['keys'])}")


# ---- stores ---------------------------------------------------------------------------------------


@app.command("build", epilog="Example: lodlab build jacksboro chunked jacksboro.lod -o finest_error=0.5")
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


@app.command(epilog="Example: lodlab info jacksboro.lod --verify")
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
        print_json(found) if json_ else print_table(["", ""], [[k, v] for k, v in found.items()])
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


def source_info(text: str) -> dict[str, Any]:
    """What `info` says of a source."""
    field = lodlab.datasets.load(text)
    frame = dict(field.core.frame())
    flat = ("dx", "dy", "x0", "y0")
    round_ = ("radius", "lon0", "lat0", "dlon", "dlat", "wraps")
    hidden = flat if field.planet else round_
    return {
        "source": field.spec,
        **field.used,
        **{k: v for k, v in frame.items() if k not in hidden},
        "samples": field.shape[0] * field.shape[1],
        "void_samples": field.void_samples,
        "source_hash": field.hash(),
    }


# ---- runs -----------------------------------------------------------------------------------------


@app.command("fly", epilog="Example: lodlab fly jacksboro.lod --out runs/one --pixel-error 1 --path orbit")
def fly_command(
    store: StoreFile,
    out: OutFolder,
    path: PathText = "flyover",
    frames: Frames = 120,
    size: Size = "1280x720",
    fov: Fov = None,
    pixel_error: PixelError = None,
    triangles: Triangles = None,
    nodes: Nodes = None,
    option: OptionTexts = None,
    images: Images = "worst",
    metrics: Metrics = "all",
    accuracy_frames: AccuracyFrames = 12,
    repeat: Repeat = 1,
    stores: Stores = None,
    device: Device = None,
    source: SourceOption = None,
) -> None:
    """One run, timed and measured.

    A store along a path under a budget; at least one budget is given where the method takes any. A directory that
    holds other runs grows by this one.
    """
    run = lodlab.fly(
        open_store(store, source),
        path,
        budget_from(pixel_error, triangles, nodes),
        size=size_of(size),
        frames=frames,
        fov=fov,
        images=images,
        metrics=metrics,
        accuracy_frames=accuracy_frames,
        repeat=repeat,
        device=device,
        out=out,
        stores=stores,
        **options_from(option),
    )
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
    from ..report.page import number

    body = [[r["run"], *(number(r[n]).replace("\u202f", ",") for n in names), number(r["budget_met"])] for r in rows]
    print_table(head, body)


@app.command(
    "compare", epilog="Example: lodlab compare jacksboro --out runs/mine --pixel-errors 0.5,1,2 -o chunked.morph=false"
)
def compare_command(
    source: SourceText,
    out: OutFolder,
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
    path: PathText = "flyover",
    frames: Frames = 120,
    size: Size = "1280x720",
    fov: Fov = None,
    images: Images = "worst",
    metrics: Metrics = "all",
    accuracy_frames: AccuracyFrames = 12,
    repeat: Repeat = 1,
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
        path=path,
        frames=frames,
        size=size_of(size),
        fov=fov,
        images=images,
        metrics=metrics,
        accuracy_frames=accuracy_frames,
        repeat=repeat,
        jobs=jobs,
        device=device,
        out=out,
        stores=stores,
    )
    finish(result, out)


@app.command("sweep", epilog="Example: lodlab sweep runs/demo/config.toml --out runs/again --jobs 2")
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


@app.command(epilog="Example: lodlab report runs/demo")
def report(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="A run directory.")],
) -> None:
    """(Re)writes a run's report and charts."""
    typer.echo(f"report: {lodlab.report.write(run)}")


# ---- pictures and meshes --------------------------------------------------------------------------


def still_session(store: Any, budget: dict[str, Any], options: dict[str, str]) -> tuple[Any, Any]:
    """(session, budget) that draw with all data; 1 px where no budget is given."""
    from ..runs.flight import check_budget
    from ..stores.methods import still

    checked = check_budget(store.method, budget or {"pixel_error": 1.0})
    return store.session(**still(store.method, options)), checked


def one_cut(
    store: Any, path: str, at: float, size: str, fov: float | None, budget: dict[str, Any], options: dict[str, str]
) -> tuple[Any, Any, Any]:
    """(session, cut, view) of one spot on a path."""
    from ..paths.path import make_path

    if not 0.0 <= at <= 1.0:
        raise InvalidInput(f"at: {at} is not within 0 to 1")
    view = make_path(path, store.source, 2, fov).view_at(at, size_of(size), fov)
    session, checked = still_session(store, budget, options)
    return session, session.select(view, checked), view


@app.command(epilog="Example: lodlab render jacksboro.lod picture.png --at 0.5 --pixel-error 2 --show level")
def render(
    store: StoreFile,
    picture: Annotated[Path | None, typer.Argument(metavar="[OUT.png]", help="The picture to write.")] = None,
    video: Annotated[
        Path | None, typer.Option("--video", metavar="OUT.mp4|.gif", help="Write the whole path instead.")
    ] = None,
    frames: Frames = 120,
    fps: Annotated[float, typer.Option("--fps", metavar="F", help="Of --video: frames a second, 1 to 100.")] = 30.0,
    at: At = 0.5,
    path: PathText = "flyover",
    size: Size = "1280x720",
    fov: Fov = None,
    pixel_error: PixelError = None,
    triangles: Triangles = None,
    nodes: Nodes = None,
    option: OptionTexts = None,
    show: Annotated[
        str,
        typer.Option(
            "--show",
            metavar="shade|level|error|wire|normal",
            help="What to show.",
            autocompletion=completing(lambda: (*SHOWS, "error")),
        ),
    ] = "shade",
    device: Device = None,
    source: SourceOption = None,
) -> None:
    """One picture of a store, or a whole path as a moving one.

    Of one view on a path, or with --video of --frames views along it; 1 px where no budget is given. `--show error`
    colours the surface by its measured error.
    """
    from .. import movies

    if (picture is None) == (video is None):
        raise InvalidInput("render: name a picture (OUT.png) or --video OUT.mp4 or .gif, one of both")
    check_one_of("render: show", show, (*SHOWS, "error"))
    if video is None:
        pictures.check_name(picture)
    else:
        movies.check_name(video)
        movies.check_fps(fps)
    choose(device)
    opened = open_store(store, source)
    budget = budget_from(pixel_error, triangles, nodes)
    instrument = _core.Instrument(opened.source.core) if show == "error" else None

    def drawn(session: Any, cut: Any, view: Any) -> Any:
        if instrument is None:
            return session.draw(cut, view, show).image
        measured = instrument.examine(session.core, cut.core, view)
        return pictures.error_picture(measured.image, measured.error_px())

    if video is not None:
        from ..paths.path import make_path

        track = make_path(path, opened.source, frames, fov)
        session, checked = still_session(opened, budget, options_from(option))
        views = track.views(size_of(size), fov)
        movies.save(video, (drawn(session, session.select(view, checked), view) for view in views), fps)
        typer.echo(f"{video}: {len(track)} frames, {len(track) / fps:.3g} s")
        return
    session, cut, view = one_cut(opened, path, at, size, fov, budget, options_from(option))
    pictures.save(picture, drawn(session, cut, view))
    typer.echo(
        f"{picture}: {cut.visible_nodes} nodes, {cut.triangles:,} triangles, predicted {cut.predicted_px:.3g} px"
    )


@app.command(epilog="Example: lodlab export jacksboro.lod mesh.ply --at 0.5 --triangles 50000")
def export(
    store: StoreFile,
    mesh: Annotated[Path, typer.Argument(metavar="OUT.ply|.glb|.obj", help="The mesh to write.")],
    at: At = 0.5,
    path: PathText = "flyover",
    size: Size = "1280x720",
    fov: Fov = None,
    pixel_error: PixelError = None,
    triangles: Triangles = None,
    nodes: Nodes = None,
    option: OptionTexts = None,
    device: Device = None,
    source: SourceOption = None,
) -> None:
    """The cut of one view as a mesh.

    An indexed mesh in source coordinates, with normals, and colours where the store has them; .glb is turned by its
    node so that y is up. Fillers (skirts) are left out. 1 px where no budget is given.
    """
    from ..stores.export import about, check_name, save

    check_name(mesh)
    choose(device)
    opened = open_store(store, source)
    budget = budget_from(pixel_error, triangles, nodes)
    _, cut, view = one_cut(opened, path, at, size, fov, budget, options_from(option))
    made = cut.to_trimesh(view)
    save(mesh, made, about(opened, cut, budget or {"pixel_error": 1.0}))
    typer.echo(f"{mesh}: {len(made.vertices):,} vertices, {len(made.faces):,} triangles")


def choose(device: str | None) -> None:
    """Takes the device that --device names."""
    if device:
        _core.choose_device(device)


# ---- benchmarks -----------------------------------------------------------------------------------


@app.command("bench", epilog="Example: lodlab bench draw --json")
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


verdicts.add_to(app)


# ---- the program ----------------------------------------------------------------------------------

STOPPED = 130
_MISTAKES = (InvalidInput, Unsupported)
_FILE_MISTAKES = (FileNotFoundError, PermissionError, IsADirectoryError, NotADirectoryError, FileExistsError)
_NAME_MISTAKES = (errno.ENAMETOOLONG, errno.ELOOP)


#: Messages name Python's arguments; here each is said as this program has it.
SPOKEN = {
    'mode="force"': "--force",
    'mode="resume"': "--resume",
    "force=True": "--force",
    "source=SOURCE": "--source SOURCE",
    "accuracy_frames=0": "--accuracy-frames 0",
    "max={'measured_px_max': 1}": "--max measured_px_max=1",
    "accuracy_frames is": "--accuracy-frames is",
    "pixel_error, triangles, nodes": "--pixel-error, --triangles, --nodes",
}


def spoken(message: Any) -> str:
    """A message as one line that names this program's arguments."""
    line = " ".join(str(message).split())
    for python, ours in SPOKEN.items():
        line = line.replace(python, ours)
    return line


def status_of(error: BaseException) -> tuple[int, str]:
    """(exit status, the one line that says what is wrong)."""
    if isinstance(error, KeyboardInterrupt) or isinstance(error.__cause__, KeyboardInterrupt):
        return STOPPED, "stopped; what was finished is kept"
    if hasattr(error, "format_message") and hasattr(error, "exit_code"):  # typer's own, whatever click it uses
        return int(error.exit_code), error.format_message()
    if isinstance(error, _MISTAKES):
        return 2, str(error)
    if isinstance(error, (StoreError, GLError)):
        return 1, str(error)
    if isinstance(error, OSError):
        mistake = isinstance(error, _FILE_MISTAKES) or error.errno in _NAME_MISTAKES
        text = f"{error.strerror or error}: {error.filename}" if error.filename else str(error)
        return 2 if mistake else 1, text
    if isinstance(error, MemoryError):
        return 1, f"out of memory: {error}" if str(error) else "out of memory"
    return 1, f"{type(error).__name__}: {error} (LODLAB_DEBUG=1 shows where)"


def run(arguments: Sequence[str] | None = None) -> int:
    """Runs the command line and returns its exit status: 1 where all went well but a run broke a promise."""
    broken = False

    def warn(message: Warning | str, *_: Any, **__: Any) -> None:
        """A warning as one line, without the code that it came from."""
        nonlocal broken
        promise = isinstance(message, BrokenPromise)
        broken = broken or promise
        print(("error: " if promise else "warning: ") + spoken(message), file=sys.stderr)

    with warnings.catch_warnings():
        warnings.showwarning = warn
        warnings.simplefilter("always", BrokenPromise)
        return _run(arguments) or int(broken)


def _run(arguments: Sequence[str] | None) -> int:
    try:
        words = list(sys.argv[1:] if arguments is None else arguments) or ["--help"]
        status = int(app(args=words, prog_name="lodlab", standalone_mode=False) or 0)
        if status == STOPPED:  # typer turns Ctrl-C into this status, and says nothing
            raise KeyboardInterrupt
        return status
    except BrokenPipeError:  # `lodlab methods | head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except (Exception, KeyboardInterrupt) as error:
        status, text = status_of(error)
        if os.environ.get("LODLAB_DEBUG"):
            traceback.print_exc()
        if text:
            print("error: " + spoken(text), file=sys.stderr)
        return status


def main() -> None:
    """The entry point of the program `lodlab`."""
    sys.exit(run())
