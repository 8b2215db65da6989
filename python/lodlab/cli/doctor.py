# SPDX-License-Identifier: MIT
"""What this machine has, and whether a triangle is really drawn: `lodlab doctor`."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

import numpy as np

from .. import _core
from ..errors import GLError, InvalidInput
from ..runs.provenance import commit, machine, version
from ..sources.heightfield import window_samples
from ..sources.spec import data_folder

PACKAGES = ("numpy", "pandas", "matplotlib", "pillow", "rasterio", "scipy", "tomli-w", "tqdm", "trimesh", "typer")


@dataclass(frozen=True)
class Finding:
    """One line of the doctor: `ok` is True (fine), False (needed and missing) or None (for information)."""

    what: str
    text: str
    ok: bool | None = True
    cure: str = ""


def examine() -> Iterator[Finding]:
    """All findings, one after the other."""
    host = machine()
    memory = host["memory_bytes"] / 2**30
    yield Finding("lodlab", f"{version()}, commit {commit()}", None)
    yield Finding("machine", f"{host['cpu']}, {host['cores']} cores, {memory:.1f} GiB, {host['system']}", None)
    yield from _settings()
    yield from _libraries()
    yield from _writing()
    yield from _graphics()


def _settings() -> Iterator[Finding]:
    """What the environment says, LODLAB_DEVICE aside."""
    for what, name, value_of in (
        ("threads", "LODLAB_THREADS", _core.thread_count),
        ("samples read at once", "LODLAB_WINDOW_SAMPLES", window_samples),
    ):
        try:
            yield Finding(what, f"{value_of():,} ({name})", None)
        except InvalidInput as error:
            yield Finding(what, str(error), False, f"unset {name}, or set it right")
    data = data_folder()
    if data is None or data.is_dir():
        yield Finding("data folder", str(data) if data else "none (LODLAB_DATA; built-in data needs none)", None)
    else:
        yield Finding("data folder", f"LODLAB_DATA: no folder {data}", False, "unset LODLAB_DATA, or make that folder")


def _libraries() -> Iterator[Finding]:
    yield Finding("Python", host_python(), True)
    for name in PACKAGES:
        try:
            yield Finding(name, metadata.version(name))
        except metadata.PackageNotFoundError:
            yield Finding(name, "missing", False, f"pip install {name}")
    for name, text in sorted(_core.libraries().items()):
        yield Finding(name, str(text))
    if not hasattr(_core, "write_image"):
        yield Finding("OpenImageIO", "built without it; pictures go through Pillow, EXR is not read", None)


def host_python() -> str:
    """Python's version."""
    return machine()["python"]


def _writing() -> Iterator[Finding]:
    for what, folder in (("working folder", Path.cwd()), ("temporary folder", Path(tempfile.gettempdir()))):
        try:
            with tempfile.TemporaryFile(dir=folder) as file:
                file.write(b"lodlab")
            free = os.statvfs(folder)
            yield Finding(what, f"{folder}, writable, {free.f_bavail * free.f_frsize / 2**30:.1f} GiB free")
        except OSError as error:
            cure = "work in a folder of your own" if what == "working folder" else "set TMPDIR to a writable folder"
            yield Finding(what, f"{folder} is not writable ({error.strerror})", False, cure)


def _graphics() -> Iterator[Finding]:
    install = "apt-get install libegl1 libgl1-mesa-dri (software) or NVIDIA's driver with its EGL library"
    try:
        devices = _core.devices()
    except GLError as error:
        yield Finding("EGL devices", str(error), False, install)
        return
    if not devices:
        yield Finding("EGL devices", "none", False, install)
        return
    for device in devices:
        yield Finding(f"device {device['index']}", f"{device['name']}{' (software)' if device['software'] else ''}")
    try:
        info = _core.gl_info()
    except (GLError, ValueError, RuntimeError) as error:
        yield Finding("OpenGL", str(error), False, "LODLAB_DEVICE=software, or " + install)
        return
    yield Finding("OpenGL", f"{info['version']}, {info['renderer']} ({info['vendor']})")
    try:
        text, ok = draw_one()
    except (GLError, ValueError, OSError, RuntimeError) as error:
        text, ok = str(error), False
    yield Finding("a triangle", text, ok, "" if ok else "LODLAB_DEVICE=software, or update the graphics driver")


def draw_one() -> tuple[str, bool]:
    """Draws the smallest field with `full` from straight above and reads it back."""
    from ..sources.heightfield import HeightField
    from ..stores.build import build

    field = HeightField(np.zeros((2, 2), np.float32), spacing=10.0)
    with tempfile.TemporaryDirectory(prefix="lodlab-") as folder:
        store = build(field, "full", Path(folder) / "smallest.lod", progress=False)
        view = _core.View(eye=(5.0, -5.0, 20.0), target=(5.0, -5.0, 0.0), up=(0.0, 1.0, 0.0), fov=60.0, size=(64, 64))
        frame = store.draw(store.select(view, _core.Budget(pixel_error=1.0)))
    covered = int(np.isfinite(frame.depth).sum())
    # the square is 10 of the 2 * 20 * tan(30 deg) = 23.09 units that 64 pixels see
    expected = round((64 * 10.0 / (40.0 * np.tan(np.pi / 6.0))) ** 2)
    depth = float(np.median(frame.depth[np.isfinite(frame.depth)])) if covered else float("nan")
    ok = abs(covered - expected) <= 4 * 28 and abs(depth - 20.0) < 1e-3
    return f"drawn and read back: {covered} pixels of {expected} expected, at distance {depth:g} of 20", ok
