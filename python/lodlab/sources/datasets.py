# SPDX-License-Identifier: MIT
"""Sources that need no file of the user's. Terrains: `jacksboro`, `earth` (real), `fractal` (generated). Meshes:
`earth-globe` (real), `icosphere`, `torus`, `blob`. And the way from what a user names to a source."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from importlib import resources
from typing import Any

import numpy as np

from .. import _core
from ..errors import InvalidInput
from . import shapes
from .base import Source
from .frames import DEFAULT_SPACING, make_frame, positive
from .heightfield import HeightField, window_samples
from .mesh import Mesh, is_trimesh
from .mesh_files import format_of
from .placement import metres_per_degree
from .spec import format_spec, parse
from .windowed import FractalReader, WindowedHeightField


@dataclass(frozen=True)
class Dataset:
    """A built-in or generated source. `make` takes the `keys` of its SOURCE text."""

    name: str
    kind: str
    size: tuple[int, int] | None  # rows and columns; None: a mesh
    spacing: tuple[float, float] | None  # metres
    triangles: int | None  # of a mesh, by default
    description: str
    keys: tuple[str, ...]
    make: Callable[..., Source]


def _jacksboro_grid() -> tuple[np.ndarray, tuple[float, float], tuple[float, float]]:
    """Heights (344, 403) int16, spacing and origin in metres, from the corners in degrees."""
    from matplotlib.cbook import get_sample_data

    with get_sample_data("jacksboro_fault_dem.npz") as data:
        heights = data["elevation"]
        west, east = float(data["xmin"]), float(data["xmax"])
        south, north = sorted((float(data["ymin"]), float(data["ymax"])))
    rows, cols = heights.shape
    kx, ky = metres_per_degree(0.5 * (south + north))
    step_x, step_y = (east - west) / cols, (north - south) / rows
    origin = ((west + 0.5 * step_x) * kx, (north - 0.5 * step_y) * ky)
    return heights, (step_x * kx, step_y * ky), origin


def _jacksboro(
    spacing: float | tuple[float, float] | None = None, vertical_scale: float = 1.0, nodata: float | None = None
) -> HeightField:
    heights, real_spacing, origin = _jacksboro_grid()
    keys = {
        "spacing": spacing,
        "vertical_scale": None if vertical_scale == 1.0 else vertical_scale,
        "nodata": nodata,
    }
    return HeightField(
        heights,
        spacing=real_spacing if spacing is None else spacing,
        vertical_scale=vertical_scale,
        nodata=None if nodata == "none" else nodata,
        origin=origin if spacing is None else (0.0, 0.0),
        name="jacksboro",
        spec=format_spec("jacksboro", keys),
    )


def _earth(
    spacing: float | tuple[float, float] | None = None,
    vertical_scale: float = 1.0,
    nodata: float | None = None,
    planet: bool = False,
    radius: float | None = None,
    window: tuple[int, int, int, int] | None = None,
) -> HeightField:
    with resources.as_file(resources.files("lodlab") / "data" / "etopo5_earth.tif") as path:
        return HeightField.open(
            path,
            spacing=spacing,
            vertical_scale=vertical_scale,
            nodata=nodata,
            planet=planet,
            radius=radius,
            window=window,
            name="earth",
            dataset="earth",
        )


def _earth_globe(size: int = 256, vertical_scale: float = 1.0) -> Mesh:
    return shapes.globe(_earth(planet=True).loaded(), size, vertical_scale)


def fractal_window(
    rows: int, cols: int, row0: int = 0, col0: int = 0, *, seed: int = 1, roughness: float = 0.5
) -> np.ndarray:
    """A window of the generated terrain, (rows, cols) float32, metres. Windows agree where they overlap."""
    if not 0 <= seed < 2**64:
        raise InvalidInput(f"fractal: seed {seed} is not within 0 to 2^64 - 1")
    return _core.fractal(rows, cols, row0, col0, seed, float(roughness))


def _fractal(
    size: int = 2049,
    seed: int = 1,
    roughness: float = 0.5,
    spacing: float | tuple[float, float] | None = None,
    vertical_scale: float = 1.0,
) -> HeightField:
    if not 2 <= size <= 46340:
        raise InvalidInput(f"fractal: size {size} is not within 2 to 46340 (2^31 samples)")
    keys = {
        "size": size,
        "seed": seed,
        "roughness": None if roughness == 0.5 else roughness,
        "spacing": spacing,
        "vertical_scale": None if vertical_scale == 1.0 else vertical_scale,
    }
    if size * size > window_samples():
        scale = positive("vertical_scale", vertical_scale)
        frame, _ = make_frame((size, size), spacing)
        return WindowedHeightField(
            FractalReader(seed, roughness, scale), frame, "fractal", format_spec("fractal", keys), held=HeightField
        )
    return HeightField(
        fractal_window(size, size, seed=seed, roughness=roughness),
        spacing=DEFAULT_SPACING if spacing is None else spacing,
        vertical_scale=vertical_scale,
        name="fractal",
        spec=format_spec("fractal", keys),
    )


DATASETS: dict[str, Dataset] = {
    d.name: d
    for d in (
        Dataset(
            "jacksboro",
            "heightfield",
            (344, 403),
            (74.6, 92.5),
            None,
            "Jacksboro fault, Tennessee: SRTM, 3 arc-seconds (ships with matplotlib)",
            ("spacing", "vertical_scale", "nodata"),
            _jacksboro,
        ),
        Dataset(
            "earth",
            "heightfield",
            (2161, 4320),
            (9276.6, 9214.5),
            None,
            "ETOPO5: the whole Earth, sea floor included, 5 arc-minutes; planet=true puts it on its sphere",
            ("spacing", "vertical_scale", "nodata", "planet", "radius", "window"),
            _earth,
        ),
        Dataset(
            "fractal",
            "heightfield",
            (2049, 2049),
            (30.0, 30.0),
            None,
            "generated mountains without limits: size=2049, seed=1, roughness=0.5",
            ("size", "seed", "roughness", "spacing", "vertical_scale"),
            _fractal,
        ),
        Dataset(
            "earth-globe",
            "mesh",
            None,
            None,
            12 * 255**2,
            "ETOPO5 on its sphere as a closed mesh, size x size points a cube's face: size=256, vertical_scale=1",
            ("size", "vertical_scale"),
            _earth_globe,
        ),
        Dataset(
            "icosphere",
            "mesh",
            None,
            None,
            20 * 4**5,
            "the unit sphere, an icosahedron refined level times: level=5",
            ("level",),
            shapes.icosphere,
        ),
        Dataset(
            "torus",
            "mesh",
            None,
            None,
            2 * 256 * 128,
            "a torus of radius 1, genus 1: rings=256, sides=128, tube=0.4 (its radius)",
            ("rings", "sides", "tube"),
            shapes.torus,
        ),
        Dataset(
            "blob",
            "mesh",
            None,
            None,
            12 * 255**2,
            "a closed fractal surface as large as wanted, 12 (size - 1)^2 triangles: size=256, seed=1",
            ("size", "seed"),
            shapes.blob,
        ),
    )
}


def load(source: str | os.PathLike[str]) -> Source:
    """The source of a SOURCE text: a data set's name or a file, with keys as `earth:planet=true`. Its `.spec` loads it
    again from any directory."""
    spec = parse(source, DATASETS)
    if not spec.is_file:
        return DATASETS[spec.name].make(**spec.keys)
    return (Mesh if format_of(spec.name) else HeightField).open(spec.name, **spec.keys)


def as_source(source: Any) -> Source:
    """A source as it is; a SOURCE text or path loaded; an array with 30 m spacing; a trimesh object."""
    if isinstance(source, Source):
        return source
    if isinstance(source, (str, os.PathLike)):
        return load(source)
    if isinstance(source, np.ndarray):
        return HeightField(source)
    if is_trimesh(source):
        return Mesh(source)
    what = type(source).__name__
    cure = "; its source is store.source" if what == "Store" else ""
    raise InvalidInput(f"source: {what} is no height field, mesh, SOURCE text, path, array or trimesh object{cure}")


def list() -> list[dict[str, Any]]:  # noqa: A001 - reads as lodlab.datasets.list()
    """A row per data set: name, kind, rows, cols and spacing (dx, dy) in metres of heights, triangles of a mesh,
    description, keys."""
    return [
        {
            "name": d.name,
            "kind": d.kind,
            **({"rows": d.size[0], "cols": d.size[1], "spacing": d.spacing} if d.size else {"triangles": d.triangles}),
            "description": d.description,
            "keys": d.keys,
        }
        for d in DATASETS.values()
    ]
