# SPDX-License-Identifier: MIT
"""Colours of multigrain: a resolution of their own, and the same picture as `full` has."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import lodlab as lod
from lodlab import _core
from lodlab.instrument import measure
from tests.contract import over

NEAR = _core.Budget(pixel_error=0.25)


def raster(file: Path, rows: int, cols: int, blue: np.ndarray | float = 0.0) -> str:
    """A picture that goes from black to red to the east, once there and back, and to green to the south."""
    image = np.zeros((rows, cols, 4), np.uint8)
    image[..., 0] = (np.sin(np.pi * (np.arange(cols) + 0.5) / cols) * 255)[None, :]
    image[..., 1] = np.linspace(0, 255, rows)[:, None]
    image[..., 2] = blue
    image[..., 3] = 255
    _core.write_image(str(file), image)
    return str(file)


def noise(rows: int, cols: int) -> np.ndarray:
    return np.random.default_rng(3).integers(0, 256, (rows, cols))


def pair(field: lod.HeightField, folder: Path, attribute: str, **options: object) -> tuple[lod.Store, lod.Store]:
    store = lod.build(field, "multigrain", folder / "m.lod", progress=False, attribute=attribute, **options)
    return store, lod.build(field, "full", folder / "full.lod", progress=False, attribute=attribute)


def pictures(
    store: lod.Store, full: lod.Store, view: _core.View, budget: _core.Budget = NEAR, **options: object
) -> tuple[np.ndarray, np.ndarray, dict]:
    """Both pictures as (H, W, 3) int64, and what the frame of `store` cost."""
    session, reference = store.core.session({"stream": False, **options}), full.core.session({})
    cut, row = session.time_frame(view, budget)
    ours = session.draw(cut, view).image[..., :3].astype(int)
    return ours, reference.draw(reference.select(view, NEAR), view).image[..., :3].astype(int), row


def planet() -> lod.HeightField:
    heights = np.asarray(lod.datasets.load("earth:planet=true").heights)[::24, ::24]
    return lod.HeightField(np.ascontiguousarray(heights), planet=True)


def from_space(longitude: float, latitude: float, height: float = 0.4) -> _core.View:
    lon, lat = np.radians([longitude, latitude])
    out = np.array([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)]) * 6_371_000.0
    return _core.View(tuple(out * (1.0 + height)), tuple(out), fov=60.0, size=(320, 200))


@pytest.mark.parametrize("texels", [0.25, 1, 2, 8])
def test_colours_are_those_of_the_raster(tmp_path: Path, texels: float) -> None:
    rows, cols = 257, 330
    field = lod.HeightField(_core.fractal(rows, cols, 0, 0, seed=4, roughness=0.5))
    size = round(rows * texels), round(cols * texels)
    store, full = pair(field, tmp_path, raster(tmp_path / "colour.png", *size, 40.0), chart=128)
    ours, wanted, _ = pictures(store, full, over(field, height=0.3, size=(320, 200)))
    # A quarter of a pixel of error moves edges of the hillshade; colours are the same raster.
    assert np.abs(ours - wanted).mean() < 1.0


@pytest.mark.parametrize("place", [(0.0, 40.0), (180.0, 10.0), (77.0, 89.0), (-120.0, -88.0)])
def test_colours_go_round_a_planet(tmp_path: Path, place: tuple[float, float]) -> None:
    field = planet()
    rows, cols = field.shape
    store, full = pair(field, tmp_path, raster(tmp_path / "colour.png", 4 * rows, 4 * cols, 40.0))
    ours, wanted, _ = pictures(store, full, from_space(*place))
    difference = np.abs(ours - wanted)
    assert difference.mean() < 0.5
    # Red falls to 0 where the raster closes: half of it would show there as a line.
    assert np.percentile(difference, 99.9) <= 8


def test_levels_of_colour_meet_without_a_seam(tmp_path: Path) -> None:
    field = lod.HeightField(np.zeros((1024, 1024)), spacing=1.0)
    wave = np.sin(np.arange(2048) * (2 * np.pi / 128)) * 60  # up to 3 steps a texel, each way
    blue = 128 + wave[None, :] + wave[:, None]
    store, full = pair(field, tmp_path, raster(tmp_path / "colour.png", 2048, 2048, blue))
    view = _core.View((100.0, -1000.0, 160.0), (450.0, -600.0, 0.0), fov=70.0, size=(640, 360))
    ours, wanted, row = pictures(store, full, view)
    one_tile = 288 * 288 * 4  # texels, without mip levels
    assert row["resident_bytes"] > 12 * one_tile
    ground = (ours != ours[0, 0]).any(axis=2) & (wanted != wanted[0, 0]).any(axis=2)
    ground[:150] = False  # farther off a pixel has more texels than a tile's mip levels go down to
    assert ground.sum() > 320 * 200
    # Steps of 8 bits: the rounding of mip levels, of weights between two of them, of the picture. A seam of one texel
    # would be six.
    assert np.abs(ours - wanted)[ground].max() <= 4
    for axis in (0, 1):
        both = ground & np.roll(ground, -1, axis)
        both = both[:-1] if axis == 0 else both[:, :-1]
        jump, reference = (np.abs(np.diff(picture, axis=axis))[both] for picture in (ours, wanted))
        assert (jump - reference).max() <= 4


def test_mip_levels_of_tiles_are_those_of_the_raster(tmp_path: Path) -> None:
    """Noise shows which level of the pyramid each pixel is from."""
    field = lod.HeightField(np.zeros((1024, 1024)), spacing=1.0)
    store, full = pair(field, tmp_path, raster(tmp_path / "colour.png", 1024, 1024, noise(1024, 1024)))
    view = _core.View((512.0, -1000.0, 250.0), (512.0, -500.0, 0.0), fov=60.0, size=(320, 200))
    ours, wanted, _ = pictures(store, full, view)
    blue = np.abs(ours - wanted)[..., 2]
    assert wanted[..., 2].std() > 8.0  # there is something to see
    assert blue.mean() < 1.0  # one texel aside it would be 6


def test_colours_take_memory_by_their_size_on_the_screen(tmp_path: Path) -> None:
    field = lod.HeightField(_core.fractal(513, 513, 0, 0, seed=2, roughness=0.4))
    attribute = raster(tmp_path / "colour.png", 2052, 2052)
    store = lod.build(field, "multigrain", tmp_path / "m.lod", progress=False, attribute=attribute)
    bare = lod.build(field, "multigrain", tmp_path / "bare.lod", progress=False)

    def uploaded(height: float, texels_per_pixel: float = 1.0) -> int:
        """Bytes of colours that a first frame brings."""
        view = over(field, height=height, size=(320, 200))
        rows = [
            s.core.session({"stream": False, "texels_per_pixel": texels_per_pixel}).time_frame(view, NEAR)[1]
            for s in (store, bare)
        ]
        return rows[0]["upload_bytes"] - rows[1]["upload_bytes"]

    one_tile = 288 * 288 * 4 * 1.4  # with mip levels, and the instances
    assert uploaded(20.0) <= one_tile
    assert uploaded(20.0) < uploaded(1.5) < uploaded(0.05)
    assert uploaded(0.05, 0.25) < uploaded(0.05, 1.0) < uploaded(0.05, 4.0)


def test_memory_of_colours_grows_with_what_is_seen_and_ends_at_the_budget(tmp_path: Path) -> None:
    field = lod.HeightField(np.zeros((1024, 1024)), spacing=1.0)
    attribute = raster(tmp_path / "colour.png", 4100, 4100)
    store = lod.build(field, "multigrain", tmp_path / "m.lod", progress=False, attribute=attribute)
    session = store.core.session({"stream": False, "gpu_cache_mb": 48})
    resident = []
    for x in range(60, 1000, 60):  # over the whole field, so low that each place has tiles of its own
        view = _core.View((x, -500.0, 20.0), (x + 30.0, -500.0, 0.0), fov=60.0, size=(320, 200))
        resident.append(session.time_frame(view, NEAR)[1]["resident_bytes"])
    assert resident[0] < resident[-1] / 2
    assert max(resident) <= 48 << 20  # the whole pyramid takes 400 MiB and more


def test_coloured_cuts_are_captured_as_drawn(tmp_path: Path) -> None:
    field = lod.HeightField(_core.fractal(257, 300, 0, 0, seed=4, roughness=0.5))
    store, full = pair(field, tmp_path, raster(tmp_path / "colour.png", 4 * 257, 4 * 300), chart=128)
    instrument = _core.Instrument(field.core, full.core.session({}))
    session, view = store.core.session({"stream": False}), over(field, height=0.05, size=(320, 200))
    for budget in (NEAR, _core.Budget(pixel_error=4.0), _core.Budget(triangles=5000, nodes=60)):
        cut, row = session.time_frame(view, budget)
        found = measure(instrument, session, cut, view)
        assert (found["crack_edges"], found["hole_samples"], found["capture_mismatch_pixels"]) == (0, 0, 0)
        assert (row["nodes"], row["triangles"]) == (cut.visible_nodes, cut.triangles)


def test_equal_colours_make_equal_stores(tmp_path: Path) -> None:
    field = lod.HeightField(_core.fractal(129, 200, 0, 0, seed=4, roughness=0.5))
    attribute = raster(tmp_path / "colour.png", 300, 300, noise(300, 300))
    stores = [
        lod.build(field, "multigrain", tmp_path / f"{i}.lod", progress=False, attribute=attribute) for i in range(2)
    ]
    assert stores[0].info()["content_hash"] == stores[1].info()["content_hash"]


def test_rasters_that_cannot_be_drawn_are_refused(tmp_path: Path) -> None:
    field = lod.HeightField(np.zeros((65, 65)))
    with pytest.raises(lod.errors.InvalidInput, match="missing.png"):
        lod.build(field, "multigrain", tmp_path / "x.lod", progress=False, attribute=str(tmp_path / "missing.png"))
    attribute = raster(tmp_path / "fine.png", 65 * 40, 65 * 40)
    with pytest.raises(lod.errors.InvalidInput, match="more than 1024"):
        lod.build(field, "multigrain", tmp_path / "x.lod", progress=False, attribute=attribute, chart=64, levels=1)
