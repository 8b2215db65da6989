# SPDX-License-Identifier: MIT
"""Normals as a map: the same light as `full` has, whatever the triangles; and maps that come while one flies."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import lodlab as lod
from lodlab import _core
from lodlab.instrument import measure
from lodlab.instrument.yardstick import look_of
from tests.contract import over

from .map_paging import BUDGET, memory_is_within, settled, slow_storage_delays_no_frame, views
from .test_multigrain_colors import NEAR, from_space, noise, pictures, raster


def pair(field: lod.HeightField, folder: Path, **options: object) -> tuple[lod.Store, lod.Store]:
    """The field's store with normals, and `full` in the same mode."""
    store = lod.build(field, "multigrain", folder / "m.lod", progress=False, normals="attribute", **options)
    return store, lod.build(field, "full", folder / "full.lod", progress=False, **look_of(store))


def fractal(rows: int, cols: int, roughness: float = 0.5) -> lod.HeightField:
    return lod.HeightField(_core.fractal(rows, cols, 0, 0, seed=4, roughness=roughness))


def test_the_reference_is_shaded_alike(tmp_path: Path) -> None:
    field = fractal(129, 129)
    store, full = pair(field, tmp_path)
    assert look_of(store)["normals"] == full.options["normals"] == "attribute"
    assert lod.build(field, "multigrain", tmp_path / "g.lod", progress=False).options["normals"] == "geometric"


def test_a_plane_looks_as_with_its_triangles_normals(tmp_path: Path) -> None:
    slope = 0.3 * np.arange(200)[None, :] + 0.2 * np.arange(150)[:, None]
    field = lod.HeightField(slope, spacing=1.0)
    store, full = pair(field, tmp_path)
    plain = lod.build(field, "full", tmp_path / "plain.lod", progress=False)
    view = over(field, height=0.5, size=(320, 200))
    session = plain.core.session({})
    wanted = session.draw(session.select(view, NEAR), view).image[..., :3].astype(int)
    # 8 bits turn a normal by less than 0.4 degrees: light by 0.007, two steps of a colour.
    ours, reference, _ = pictures(store, full, view)
    assert np.abs(reference - wanted).max() <= 2
    assert np.percentile(np.abs(ours - wanted).max(axis=2), 99.9) <= 2  # a silhouette's pixels may be another's


@pytest.mark.parametrize("size", [(512, 512), (257, 330)])
def test_light_is_that_of_the_reference(tmp_path: Path, size: tuple[int, int]) -> None:
    field = fractal(*size)
    store, full = pair(field, tmp_path, chart=128)
    ours, wanted, _ = pictures(store, full, over(field, height=0.3, size=(320, 200)))
    assert np.abs(ours - wanted).mean() < 1.0


@pytest.mark.parametrize("place", [(0.0, 40.0), (180.0, 10.0), (77.0, 89.0), (-120.0, -88.0)])
def test_light_goes_round_a_planet(tmp_path: Path, place: tuple[float, float]) -> None:
    rows, cols = 241, 480
    lat, lon = np.radians(np.linspace(90, -90, rows))[:, None], np.radians(np.arange(cols) * 360 / cols)[None, :]
    east, north, up = np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)
    waves = 60_000.0 * (np.sin(9 * east) + np.sin(9 * north + 1.0) + np.sin(9 * up + 2.0))  # smooth at poles, too
    field = lod.HeightField(waves + np.zeros((rows, cols)), planet=True)
    store, full = pair(field, tmp_path)
    ours, wanted, _ = pictures(store, full, from_space(*place))
    difference = np.abs(ours - wanted)
    assert difference.mean() < 0.5
    # Beside the drawn triangles' own normals, which are constant on each, but of the same mountains.
    plain = lod.build(field, "full", tmp_path / "plain.lod", progress=False).core.session({})
    view = from_space(*place)
    drawn = plain.draw(plain.select(view, NEAR), view).image[..., :3].astype(int)
    assert drawn.std() > 20.0
    assert np.abs(drawn - ours).mean() < 1.5
    assert abs(drawn.mean() - ours.mean()) < 0.2


def test_few_triangles_look_more_like_the_source(tmp_path: Path) -> None:
    field = lod.datasets.load("jacksboro")
    view = over(field, height=0.25, size=(480, 270))
    found = {}
    for normals in ("geometric", "attribute"):
        store = lod.build(field, "multigrain", tmp_path / f"{normals}.lod", progress=False, normals=normals)
        full = lod.build(field, "full", tmp_path / f"{normals}-full.lod", progress=False, **look_of(store))
        instrument = _core.Instrument(field.core, full.core.session({}))
        session = store.core.session({"stream": False})
        cut = session.select(view, _core.Budget(triangles=5000))
        found[normals] = measure(instrument, session, cut, view, instrument.reference(view), pictures=True)
    a, b = found["attribute"], found["geometric"]
    assert a["psnr_db"] > b["psnr_db"] + 3.0
    assert a["flip"] < 0.7 * b["flip"]
    assert a["measured_px_max"] == b["measured_px_max"]  # the same triangles
    assert (a["crack_edges"], a["capture_mismatch_pixels"]) == (0, 0)


def test_colours_and_normals_have_resolutions_of_their_own(tmp_path: Path) -> None:
    field = fractal(512, 512)
    attribute = raster(tmp_path / "colour.png", 2048, 2048, 40.0)
    store, full = pair(field, tmp_path, attribute=attribute, chart=128)
    for height in (0.05, 0.5):
        view = over(field, height=height, size=(320, 200))
        ours, wanted, _ = pictures(store, full, view)
        assert np.abs(ours - wanted).mean() < 1.0
    shown = store.core.session({"stream": False})
    cut = shown.select(view, NEAR)
    normal = shown.draw(cut, view, show="normal").image[..., :3].astype(int)
    plain = lod.build(field, "full", tmp_path / "plain.lod", progress=False, normals="attribute").core.session({})
    wanted = plain.draw(plain.select(view, NEAR), view, show="normal").image[..., :3].astype(int)
    assert np.abs(normal - wanted).mean() < 1.0


def test_normals_beside_voids_are_those_of_the_filled_surface(tmp_path: Path) -> None:
    heights = np.asarray(fractal(200, 200).heights).copy()
    heights[80:110, 90:140] = np.nan
    field = lod.HeightField(heights)
    store, full = pair(field, tmp_path)
    (tmp_path / "filled").mkdir()
    filled, filled_full = pair(lod.HeightField(field.filled.copy()), tmp_path / "filled")
    view = over(field, height=0.6, size=(320, 200))
    ours, wanted, _ = pictures(store, full, view)
    whole, _, _ = pictures(filled, filled_full, view)
    assert np.abs(ours - wanted).mean() < 1.0
    hole = (ours != whole).any(axis=2)
    assert 0.0 < hole.mean() < 0.1  # and all beside it is as if nothing were missing


def test_what_no_method_knows_is_refused(tmp_path: Path) -> None:
    field = fractal(65, 65)
    with pytest.raises(lod.errors.InvalidInput, match="normals = smooth is not one of geometric, attribute"):
        lod.build(field, "multigrain", tmp_path / "x.lod", progress=False, normals="smooth")
    with pytest.raises(lod.errors.InvalidInput, match="unknown build option 'normals'"):
        lod.build(field, "chunked", tmp_path / "x.lod", progress=False, normals="attribute")
    store = lod.build(field, "multigrain", tmp_path / "m.lod", progress=False)
    with pytest.raises(lod.errors.InvalidInput, match="'normals', which is said when building: build a store with it"):
        store.core.session({"normals": "attribute"})


# ---- maps that come while one flies ----------------------------------------------------------------


@pytest.fixture(scope="module")
def mapped(tmp_path_factory: pytest.TempPathFactory) -> tuple[lod.HeightField, lod.Store]:
    """A field with noisy colours of 2 x 2 texels a sample, and normals."""
    folder = tmp_path_factory.mktemp("mapped")
    field = fractal(1024, 1024)
    attribute = raster(folder / "colour.png", 2048, 2048, noise(2048, 2048))
    store = lod.build(
        field, "multigrain", folder / "m.lod", progress=False, attribute=attribute, normals="attribute", chart=256
    )
    return field, store


def test_maps_come_while_one_flies(mapped) -> None:
    field, store = mapped
    session, loaded = store.core.session({"stream": True}), store.core.session({"stream": False})
    for view in views(field, 3):
        settled(session, view)  # of heights there is enough: the cut is the loaded one's
        cut, row = settled(session, view, 2)
        wanted = loaded.select(view, BUDGET)
        assert cut.missing_nodes == 0
        assert row["upload_bytes"] < 1 << 20
        assert np.array_equal(session.draw(cut, view).image, loaded.draw(wanted, view).image)


def test_a_coarser_tile_stands_in(mapped) -> None:
    field, store = mapped
    session, loaded = store.core.session({"stream": True}), store.core.session({"stream": False})
    view = views(field, 3)[1]
    cut, _ = session.time_frame(view, BUDGET)
    assert cut.missing_nodes > 0
    # The loaded session draws the same cut with all its tiles.
    blurred, sharp = (s.draw(cut, view).image[..., :3].astype(int) for s in (session, loaded))
    ground = (sharp != sharp[0, 0]).any(axis=2)
    assert blurred[ground].std() < sharp[ground].std()
    assert abs(blurred[ground].mean() - sharp[ground].mean()) < 8.0  # blurred, neither black nor of another place


def test_slow_storage_delays_no_frame(mapped) -> None:
    slow_storage_delays_no_frame(*mapped)


@pytest.mark.parametrize("stream", [True, False])
def test_memory_of_maps_is_within_the_budget(mapped, stream: bool) -> None:
    memory_is_within(*mapped, stream=stream, gpu_cache_mb=24)


def test_caches_that_cannot_hold_the_coarsest_tiles_are_refused(mapped) -> None:
    _, store = mapped
    for option in ("gpu_cache_mb", "cpu_cache_mb"):
        with pytest.raises(lod.errors.InvalidInput, match=rf"those of the maps.* need {option} of at least \d+, not 1"):
            store.core.session({option: 1})
