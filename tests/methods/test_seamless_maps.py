# SPDX-License-Identifier: MIT
"""Colours and normals of seamless: a resolution of their own, the same picture as `full` has, and maps that come while
one flies."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lodlab as lod
from lodlab import _core
from lodlab.instrument import measure
from lodlab.instrument.yardstick import look_of
from tests.contract import over

from .map_paging import BUDGET, memory_is_within, settled, slow_storage_delays_no_frame, views
from .test_multigrain_colors import NEAR, noise, pictures, raster
from .test_multigrain_normals import fractal


def pair(field: lod.HeightField, folder: Path, **options: Any) -> tuple[lod.Store, lod.Store]:
    """The field's store with maps, and `full` with the same ones."""
    store = lod.build(field, "seamless", folder / "s.lod", progress=False, **options)
    return store, lod.build(field, "full", folder / "full.lod", progress=False, **look_of(store))


def finest(store: lod.Store) -> Any:
    """Ids and resolutions of a cut in which everything is at its finest."""
    nodes = store.nodes
    last = nodes[nodes["level"] == nodes["level"].max()]
    ids = np.unique(last["id"]).astype(np.int64)
    return ids, np.full(len(ids), last["resolution"].max(), np.int32)


@pytest.mark.parametrize("resolutions", [2, 3])
@pytest.mark.parametrize("maps", ["colours", "normals", "both"])
def test_the_finest_cut_looks_as_the_source(tmp_path: Path, maps: str, resolutions: int) -> None:
    rows, cols = 256, 512  # halves are whole: `full` has the same mip levels
    field, options = fractal(rows, cols), {}
    if maps != "normals":
        options["attribute"] = raster(tmp_path / "colour.png", 2 * rows, 2 * cols, 40.0)
    if maps != "colours":
        options["normals"] = "attribute"
    store, full = pair(field, tmp_path, resolutions=resolutions, **options)
    view = over(field, height=0.3, size=(320, 200))
    session, reference = store.core.session({"stream": False}), full.core.session({})
    # The triangles are the source's own: what is left is the rounding of mip levels in 8 bits.
    ours = session.draw(session.cut(*finest(store)), view).image[..., :3].astype(int)
    wanted = reference.draw(reference.select(view, NEAR), view).image[..., :3].astype(int)
    assert np.abs(ours - wanted).mean() < 0.5
    assert np.percentile(np.abs(ours - wanted), 99.9) <= 8
    assert wanted.std() > 10.0  # there is something to see


@pytest.mark.parametrize("texels", [0.25, 1, 4])
def test_cuts_have_the_colours_of_the_raster(tmp_path: Path, texels: float) -> None:
    rows, cols = 257, 330
    field = fractal(rows, cols)
    size = round(rows * texels), round(cols * texels)
    store, full = pair(field, tmp_path, attribute=raster(tmp_path / "colour.png", *size, 40.0))
    ours, wanted, _ = pictures(store, full, over(field, height=0.3, size=(320, 200)))
    # A quarter of a pixel of error moves edges of the hillshade; colours are the same raster.
    assert np.abs(ours - wanted).mean() < 1.0


def test_a_coarse_cut_keeps_fine_colours(tmp_path: Path) -> None:
    """On level ground a patch has few triangles and many texels: it is cut up, and stays one node."""
    field = lod.HeightField(np.zeros((1024, 1024)), spacing=1.0)
    store, full = pair(field, tmp_path, attribute=raster(tmp_path / "colour.png", 2048, 2048, noise(2048, 2048)))
    view = _core.View((512.0, -900.0, 300.0), (512.0, -512.0, 0.0), fov=60.0, size=(640, 360))
    session, reference = store.core.session({"stream": False}), full.core.session({})
    root = session.cut(np.zeros(1, np.int64), None)
    ours = session.draw(root, view).image[..., :3].astype(int)
    wanted = reference.draw(reference.select(view, NEAR), view).image[..., :3].astype(int)
    ground = (ours != ours[0, 0]).any(axis=2) & (wanted != wanted[0, 0]).any(axis=2)
    ground[:120] = False  # farther off a pixel has more texels than a tile's mip levels go down to
    assert ground.sum() > 320 * 200
    blue = np.abs(ours - wanted)[..., 2][ground]
    assert wanted[..., 2][ground].std() > 8.0  # there is something to see
    assert blue.mean() < 1.0  # one texel aside it would be 6
    captured = session.capture(root, view, everything=True)
    assert len(captured.triangles) == root.triangles


@pytest.mark.parametrize("resolutions", [2, 3])
def test_cuts_with_maps_are_captured_as_drawn(tmp_path: Path, resolutions: int) -> None:
    field = fractal(257, 300)
    attribute = raster(tmp_path / "colour.png", 8 * 257, 8 * 300)
    store, full = pair(field, tmp_path, attribute=attribute, normals="attribute", resolutions=resolutions)
    bare = lod.build(field, "seamless", tmp_path / "bare.lod", progress=False, resolutions=resolutions)
    instrument = _core.Instrument(field.core, full.core.session({}))
    session, plain = (s.core.session({"stream": False}) for s in (store, bare))
    view = over(field, height=0.05, size=(320, 200))
    for budget in (NEAR, _core.Budget(pixel_error=4.0), _core.Budget(triangles=5000, nodes=60)):
        cut, row = session.time_frame(view, budget)
        found = measure(instrument, session, cut, view)
        assert (found["crack_edges"], found["hole_samples"], found["capture_mismatch_pixels"]) == (0, 0, 0)
        assert (row["nodes"], row["triangles"]) == (cut.visible_nodes, cut.triangles)
        wanted = plain.select(view, budget)  # maps change no cut
        assert np.array_equal(cut.nodes["node"], wanted.nodes["node"])
        assert np.array_equal(cut.nodes["resolution"], wanted.nodes["resolution"])


def test_pages_of_maps_are_those_of_multigrain(tmp_path: Path) -> None:
    """Bands of rows or the field at once, this room's or another's: the same maps."""
    field = fractal(513, 600)
    view = over(field, height=0.5, size=(320, 200))
    images = []
    for method in ("seamless", "multigrain"):
        store = lod.build(field, method, tmp_path / f"{method}.lod", progress=False, normals="attribute")
        session = store.core.session({"stream": False})
        images.append(session.draw(session.select(view, NEAR), view, show="normal").image[..., :3].astype(int))
    assert np.abs(images[0] - images[1]).mean() < 0.5


def test_rasters_that_cannot_be_drawn_are_refused(tmp_path: Path) -> None:
    field = fractal(65, 65)
    with pytest.raises(lod.errors.InvalidInput, match="missing.png"):
        lod.build(field, "seamless", tmp_path / "x.lod", progress=False, attribute=str(tmp_path / "missing.png"))
    attribute = raster(tmp_path / "fine.png", 8, 65 * 600)
    with pytest.raises(lod.errors.InvalidInput, match="seamless: .*more than 1024; take a smaller finest_error"):
        lod.build(field, "seamless", tmp_path / "x.lod", progress=False, attribute=attribute)


# ---- maps that come while one flies ----------------------------------------------------------------


@pytest.fixture(scope="module")
def mapped(tmp_path_factory: pytest.TempPathFactory) -> tuple[lod.HeightField, lod.Store]:
    """A field with noisy colours of 2 x 2 texels a sample, and normals."""
    folder = tmp_path_factory.mktemp("mapped")
    field = fractal(1024, 1024)
    attribute = raster(folder / "colour.png", 2048, 2048, noise(2048, 2048))
    store = lod.build(field, "seamless", folder / "s.lod", progress=False, attribute=attribute, normals="attribute")
    return field, store


def test_maps_come_while_one_flies(mapped) -> None:
    field, store = mapped
    session, loaded = store.core.session({"stream": True}), store.core.session({"stream": False})
    for view in views(field, 3):
        cut, _ = settled(session, view)
        wanted = loaded.select(view, BUDGET)
        assert cut.missing_nodes == 0
        assert np.array_equal(session.draw(cut, view).image, loaded.draw(wanted, view).image)


def test_slow_storage_delays_no_frame(mapped) -> None:
    slow_storage_delays_no_frame(*mapped)


@pytest.mark.parametrize("stream", [True, False])
def test_memory_of_maps_is_within_the_budget(mapped, stream: bool) -> None:
    memory_is_within(*mapped, stream=stream, gpu_cache_mb=16)


def test_caches_that_cannot_hold_the_coarsest_tiles_are_refused(mapped) -> None:
    _, store = mapped
    with pytest.raises(lod.errors.InvalidInput, match=r"those of the maps.* need gpu_cache_mb of at least \d+, not 1"):
        store.core.session({"stream": True, "gpu_cache_mb": 1})
    with pytest.raises(lod.errors.InvalidInput, match="upload_bytes=100000 cannot move a tile of a map of"):
        store.core.session({"upload_bytes": 100_000})
