# SPDX-License-Identifier: MIT
"""The commands that draw one view or one path: render, export."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from .. import _core, movies, pictures
from ..errors import InvalidInput, check_one_of
from ..paths.path import CameraPath, default_path, make_path
from ..runs.flight import check_budget
from ..runs.passes import shots_of
from ..stores.methods import still
from ..stores.session import SHOWS
from .arguments import (
    At,
    Device,
    Limits,
    OptionTexts,
    Sight,
    SourceOption,
    StoreFile,
    Track,
    completing,
    options_from,
    size_of,
    unfolded,
)
from .build import open_store

commands = typer.Typer()


def still_session(store: Any, budget: dict[str, Any], options: dict[str, str]) -> tuple[Any, Any]:
    """(session, budget) that draw with all data; 1 px where no budget is given."""
    checked = check_budget(store.method, budget or {"pixel_error": 1.0})
    return store.session(**still(store.method, options)), checked


def track_of(store: Any, sight: Sight, frames: int) -> CameraPath:
    """The path that was asked for, over a store's source."""
    return make_path(sight.path or default_path(store.source_kind), store.source, frames, sight.fov)


def one_cut(
    store: Any, sight: Sight, at: float, budget: dict[str, Any], options: dict[str, str]
) -> tuple[Any, Any, Any]:
    """(session, cut, view) of one spot on a path."""
    if not 0.0 <= at <= 1.0:
        raise InvalidInput(f"at: {at} is not within 0 to 1")
    path = track_of(store, sight, 2)
    view = path.view_at(at, size_of(sight.size), sight.fov)
    session, checked = still_session(store, budget, options)
    pose = None if path.deform is None else path.control_positions(at, store.control_positions)
    return session, session.select(view, checked, pose), view


@commands.command(epilog="Example: lodlab render jacksboro.lod picture.png --at 0.5 --pixel-error 2 --show level")
@unfolded
def render(
    store: StoreFile,
    track: Track,
    limits: Limits,
    picture: Annotated[Path | None, typer.Argument(metavar="[OUT.png]", help="The picture to write.")] = None,
    video: Annotated[
        Path | None, typer.Option("--video", metavar="OUT.mp4|.gif", help="Write the whole path instead.")
    ] = None,
    fps: Annotated[float, typer.Option("--fps", metavar="F", help="Of --video: frames a second, 1 to 100.")] = 30.0,
    at: At = 0.5,
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
    budget = limits.given()
    instrument = _core.Instrument(opened.source.core) if show == "error" else None

    def drawn(session: Any, cut: Any, view: Any) -> Any:
        if instrument is None:
            return session.draw(cut, view, show).image
        measured = instrument.examine(session.core, cut.core, view)
        return pictures.error_picture(measured.image, measured.error_px())

    if video is not None:
        path = track_of(opened, track, track.frames)
        session, checked = still_session(opened, budget, options_from(option))
        shots = shots_of(path, opened, size_of(track.size), track.fov)
        movies.save(video, (drawn(session, session.select(view, checked, pose), view) for view, pose in shots), fps)
        typer.echo(f"{video}: {len(path)} frames, {len(path) / fps:.3g} s")
        return
    session, cut, view = one_cut(opened, track, at, budget, options_from(option))
    pictures.save(picture, drawn(session, cut, view))
    typer.echo(
        f"{picture}: {cut.visible_nodes} nodes, {cut.triangles:,} triangles, predicted {cut.predicted_px:.3g} px"
    )


@commands.command(epilog="Example: lodlab export jacksboro.lod mesh.ply --at 0.5 --triangles 50000")
@unfolded
def export(
    store: StoreFile,
    mesh: Annotated[Path, typer.Argument(metavar="OUT.ply|.glb|.obj", help="The mesh to write.")],
    sight: Sight,
    limits: Limits,
    at: At = 0.5,
    option: OptionTexts = None,
    device: Device = None,
    source: SourceOption = None,
) -> None:
    """The cut of one view as a mesh.

    An indexed mesh in source coordinates, with normals, and colours where the store has them; of ground, .glb is turned
    by its node so that y is up. Fillers (skirts) are left out. 1 px where no budget is given.
    """
    from ..stores.export import about, check_name, save

    check_name(mesh)
    choose(device)
    opened = open_store(store, source)
    budget = limits.given()
    _, cut, view = one_cut(opened, sight, at, budget, options_from(option))
    made = cut.to_trimesh(view)
    known = about(opened, cut, budget or {"pixel_error": 1.0})
    save(mesh, made, known, ground=opened.source_kind != "mesh")
    typer.echo(f"{mesh}: {len(made.vertices):,} vertices, {len(made.faces):,} triangles")


def choose(device: str | None) -> None:
    """Takes the device that --device names."""
    if device:
        _core.choose_device(device)
