# SPDX-License-Identifier: MIT
"""Height fields from arrays, rasters, data sets; SOURCE texts; bad input."""

from __future__ import annotations

import math
import os
import warnings

import numpy as np
import pytest
import rasterio
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from rasterio.transform import Affine, from_origin

from lodlab import _core, datasets, sources
from lodlab.errors import InvalidInput
from lodlab.sources.heightfield import HeightField
from lodlab.sources.placement import metres_per_degree

Z = np.arange(20, dtype=np.float32).reshape(4, 5)


def write(path, array, transform=None, crs=None, **more):
    """A raster of (H, W) or (bands, H, W)."""
    bands = array[None] if array.ndim == 2 else array
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
        with rasterio.open(
            path,
            "w",
            driver=more.pop("driver", "GTiff"),
            height=bands.shape[1],
            width=bands.shape[2],
            count=bands.shape[0],
            dtype=bands.dtype,
            transform=transform,
            crs=crs,
            **more,
        ) as out:
            out.write(bands)
    return path


# ---- arrays -----------------------------------------------------------------------------------------


def test_an_array_keeps_its_heights_and_lies_where_it_is_told():
    field = HeightField(Z, spacing=(10, 20), origin=(100, -50))
    assert field.shape == (4, 5)
    assert field.spacing == (10.0, 20.0)
    assert field.origin == (100.0, -50.0)
    assert field.heights.dtype == np.float32
    assert np.array_equal(field.heights, Z)
    assert field.valid.dtype == bool and field.valid.all()
    assert not field.planet and field.radius == 6371000.0
    assert field._core.position([1], [2]).tolist() == [[120.0, -70.0, 7.0]]
    with pytest.raises(ValueError):
        field.heights[0, 0] = 1


def test_default_spacing_is_30_metres():
    assert HeightField(Z).spacing == (30.0, 30.0)


@pytest.mark.parametrize("dtype", ["i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", "f2", "f4", "f8", ">i2", ">f4", "g"])
def test_any_real_dtype(dtype):
    assert np.array_equal(HeightField(Z.astype(dtype)).heights, Z)


@pytest.mark.parametrize(
    "view", [Z.T, Z[::-1], Z[:, ::-2], np.asfortranarray(Z), np.broadcast_to(Z[0], (3, 5)), Z.tolist()]
)
def test_arrays_need_not_be_contiguous(view):
    assert np.array_equal(HeightField(view).heights, np.asarray(view))


def test_the_callers_array_is_neither_changed_nor_shared():
    mine = Z.copy()
    mine[1, 1] = np.nan
    before = mine.copy()
    field = HeightField(mine)
    mine[0, 0] = 99
    assert field.heights[0, 0] == 0
    assert np.array_equal(mine[1:], before[1:], equal_nan=True)


@pytest.mark.parametrize(
    ("array", "words"),
    [
        (np.zeros((3, 3), bool), "dtype bool"),
        (np.zeros((3, 3), complex), "dtype complex128"),
        (np.full((3, 3), "x"), "dtype <U1"),
        (np.full((3, 3), None), "dtype object"),
        (np.zeros((3, 3), "M8[s]"), "dtype datetime64"),
        (np.zeros(()), "0 dimensions"),
        (np.zeros(4), "1 dimensions"),
        (np.zeros((2, 2, 2)), "3 dimensions"),
        (np.zeros((0, 5)), "at least 2 x 2"),
        (np.zeros((1, 9)), "at least 2 x 2"),
        (np.zeros((9, 1)), "at least 2 x 2"),
        (np.full((3, 3), np.nan), "all 9 samples"),
        (np.array([[1, 2], [np.inf, 4]]), "inf at row 1, column 0"),
        (np.array([[1, 2], [3, -1e300]]), "-1e+300 at row 1, column 1"),
        (np.array([[1, 2], [3, 2.0**127]]), "e+38 at row 1, column 1 is not within 1e+36"),
        ([[1, 2], [3]], "array is no array"),
    ],
)
def test_arrays_that_are_no_height_field(array, words):
    with pytest.raises(InvalidInput, match="^height field: .*" + words.replace("+", r"\+").replace("<", "<")):
        HeightField(array)


def test_too_many_samples_are_refused_before_anything_is_copied():
    huge = np.broadcast_to(np.float32(0), (2**16, 2**15 + 1))
    with pytest.raises(InvalidInput, match="more than 2\\^31"):
        HeightField(huge)


@pytest.mark.parametrize(
    "keys",
    [
        {"spacing": 0},
        {"spacing": -1},
        {"spacing": math.nan},
        {"spacing": (1, 2, 3)},
        {"spacing": "wide"},
        {"spacing": 1e-320},
        {"spacing": 1e300},
        {"nodata": "none"},
        {"origin": None},
        {"origin": (1, 2, 3)},
        {"origin": (1e300, 0)},
        {"vertical_scale": 0},
        {"vertical_scale": math.inf},
        {"radius": -1},
        {"origin": (math.nan, 0)},
        {"planet": True, "radius": 0},
        {"planet": True, "spacing": 30},
        {"planet": True, "degrees": (0, 95, 1, 1)},
        {"planet": True, "degrees": (0, 90, 100, 1)},
        {"planet": True, "degrees": (0, 90, 1, 0)},
        {"planet": True, "degrees": (math.nan, 90, 1, 1)},
        {"planet": True, "degrees": (0, 90, 1, 61)},
        {"planet": True, "radius": 5, "vertical_scale": 1e-3, "nodata": 0, "degrees": (0, 90, 1, 1), "array": -1e4 * Z},
    ],
)
def test_values_out_of_range(keys):
    with pytest.raises(InvalidInput, match="height field"):
        HeightField(keys.pop("array", Z), **keys)


# ---- voids ------------------------------------------------------------------------------------------


def test_voids_are_nan_outside_and_filled_inside():
    z = Z.copy()
    z[1, 2] = np.nan
    z[3, 4] = -9999
    field = HeightField(z, nodata=-9999)
    assert not field.valid[1, 2] and not field.valid[3, 4] and field.valid.sum() == 18
    assert np.isnan(field.heights[1, 2]) and np.isnan(field.heights[3, 4])
    assert np.isfinite(field.filled).all()
    assert np.array_equal(field.filled[field.valid], z[field.valid])
    assert field.filled[1, 2] == pytest.approx(Z[1, 2], abs=0.01)  # a plane's membrane is the plane


def test_nodata_is_meant_before_scaling_and_masks_count():
    ints = np.array([[1, 2, 3], [4, -32768, 6]], np.int16)
    field = HeightField(ints, nodata=-32768, vertical_scale=0.5)
    assert field.heights[0, 1] == 1.0 and not field.valid[1, 1]
    masked = np.ma.masked_equal(ints, 6)
    assert HeightField(masked).valid.tolist() == [[True, True, True], [True, True, False]]
    assert HeightField(ints, nodata=1e9).valid.all()  # not a value that int16 has
    assert (
        HeightField(np.array([[0.0, 1e30], [-3.4028234663852886e38, 2]]), nodata=-3.4028234663852886e38).valid.sum()
        == 3
    )


def test_height_step_is_known_for_integers_alone():
    assert HeightField(Z.astype(np.int16), vertical_scale=0.25)._core.height_step == 0.25
    assert HeightField(Z)._core.height_step == 0.0
    assert HeightField(np.array([[0, 2**24 + 2], [1, 2]]))._core.height_step == 0.0


@settings(max_examples=60, deadline=None)
@given(
    hnp.arrays(
        np.float32,
        hnp.array_shapes(min_dims=2, max_dims=2, min_side=2, max_side=33),
        elements=st.floats(-1000, 1000, width=32),
    ),
    st.data(),
)
def test_any_mask_fills_within_the_range_of_the_real_samples(z, data):
    valid = data.draw(hnp.arrays(bool, z.shape))
    valid.flat[data.draw(st.integers(0, z.size - 1))] = True
    field = HeightField(np.where(valid, z, np.nan))
    low, high = z[valid].min(), z[valid].max()
    assert np.array_equal(field.filled[valid], z[valid])
    assert low <= field.filled.min() and field.filled.max() <= high


def test_the_hash_is_that_of_the_content():
    assert HeightField(Z).hash() == HeightField(Z.astype(np.float64)).hash()
    others = [HeightField(Z + 1), HeightField(Z, spacing=31), HeightField(Z, nodata=3), HeightField(Z, origin=(1, 0))]
    assert len({HeightField(Z).hash(), *(f.hash() for f in others)}) == 5


# ---- planets ----------------------------------------------------------------------------------------


def test_an_array_covers_the_sphere():
    field = HeightField(np.zeros((19, 36)), planet=True, radius=1000.0)
    frame = field._core.frame()
    assert (frame["lon0"], frame["lat0"], frame["dlon"], frame["dlat"]) == (0.0, 90.0, 10.0, 10.0)
    assert frame["wraps"]
    poles = field._core.position([0, 0, 18, 9], [0, 17, 5, 9])
    assert poles[:3].tolist() == [[0, 0, 1000], [0, 0, 1000], [0, 0, -1000]]
    assert poles[3].tolist() == [0, 1000, 0]


def test_a_last_column_that_repeats_the_first_is_dropped():
    field = HeightField(np.zeros((19, 37)), planet=True, degrees=(-180, 90, 10, 10))
    assert field.shape == (19, 36) and field._core.wraps


def test_a_patch_of_a_planet_does_not_wrap():
    field = HeightField(Z, planet=True, degrees=(10, 50, 0.5, 0.25))
    assert field.shape == (4, 5) and not field._core.wraps
    x, y, z = field._core.position([2], [3])[0]
    assert math.degrees(math.atan2(y, x)) == pytest.approx(11.5)
    assert math.degrees(math.asin(z / (6371000.0 + 13))) == pytest.approx(49.5)


# ---- rasters ----------------------------------------------------------------------------------------


def test_a_projected_raster_lies_at_the_centres_of_its_samples(tmp_path):
    path = write(tmp_path / "a.tif", Z, from_origin(500000, 4000000, 10, 20), "EPSG:32633")
    field = HeightField.open(path)
    assert field.spacing == (10, 20)
    assert field.origin == (500005, 3999990)
    assert np.array_equal(field.heights, Z)
    assert field.name == "a" and field.spec == str(path)


def test_feet_become_metres(tmp_path):
    path = write(tmp_path / "a.tif", Z, from_origin(1000, 2000, 100, 100), "EPSG:2263")
    foot = 1200 / 3937
    assert HeightField.open(path).spacing == pytest.approx((100 * foot, 100 * foot), rel=1e-12)


def test_degrees_become_metres_at_the_middle_latitude_of_the_whole_raster(tmp_path):
    path = write(tmp_path / "a.tif", Z, from_origin(14.0, 46.0, 0.01, 0.02), "EPSG:4326")
    kx, ky = metres_per_degree(46.0 - 0.04)
    field = HeightField.open(path)
    assert field.spacing == pytest.approx((0.01 * kx, 0.02 * ky), rel=1e-9)
    part = HeightField.open(path, window=(1, 2, 3, 2))
    assert part.spacing == field.spacing
    assert part.origin == pytest.approx((field.origin[0] + 2 * field.spacing[0], field.origin[1] - field.spacing[1]))
    assert np.array_equal(part.heights, Z[1:4, 2:4])


def test_the_length_of_a_degree():
    published = {0: (111.320, 110.574), 45: (78.847, 111.132), 60: (55.800, 111.412)}  # km, to the metre
    for latitude, lengths in published.items():
        assert metres_per_degree(latitude) == pytest.approx([1000 * v for v in lengths], abs=0.6)


@pytest.mark.parametrize(("south_up", "mirrored"), [(True, False), (False, True), (True, True)])
def test_rasters_that_lie_otherwise_are_turned(tmp_path, south_up, mirrored):
    stored = Z[:: -1 if south_up else 1, :: -1 if mirrored else 1]
    transform = Affine(
        -10 if mirrored else 10, 0, 50 if mirrored else 0, 0, 20 if south_up else -20, -80 if south_up else 0
    )
    path = write(tmp_path / "a.tif", stored, transform, "EPSG:32633")
    field = HeightField.open(path)
    assert np.array_equal(field.heights, Z)
    assert field.origin == (5, -10)
    part = HeightField.open(path, window=(1, 1, 2, 3))
    assert np.array_equal(part.heights, Z[1:3, 1:4])
    assert part.origin == (15, -30)


def test_a_rotated_raster_is_refused(tmp_path):
    path = write(tmp_path / "a.tif", Z, Affine(9.8, 1.7, 0, 1.7, -9.8, 0), "EPSG:32633")
    with pytest.raises(InvalidInput, match="rotated"):
        HeightField.open(path)


def test_nodata_of_the_file_can_be_overridden(tmp_path):
    path = write(tmp_path / "a.tif", Z.astype(np.int16), from_origin(0, 0, 1, 1), nodata=7)
    assert not HeightField.open(path).valid[1, 2]
    assert HeightField.open(path, nodata=8).valid.sum() == 19 and not HeightField.open(path, nodata=8).valid[1, 3]
    assert HeightField.open(path, nodata="none").valid.all()


def test_an_undeclared_mark_is_void_with_a_warning(tmp_path):
    z = Z.astype(np.int16)
    z[0, 0] = -32767
    path = write(tmp_path / "a.tif", z, from_origin(0, 0, 1, 1))
    with pytest.warns(UserWarning, match="1 samples hold -32767"):
        field = HeightField.open(path)
    assert field.valid.sum() == 19
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert sources.load(field.spec).hash() == field.hash()
    with pytest.warns(UserWarning, match="cannot belong together"):  # a mark that is kept is a cliff
        assert HeightField.open(path, nodata="none").valid.all()


def test_a_mask_band_and_scaled_samples(tmp_path):
    path = write(tmp_path / "a.tif", Z.astype(np.int16), from_origin(0, 0, 1, 1))
    with rasterio.open(path, "r+") as out:
        out.write_mask(np.where(Z == 3, 0, 255).astype(np.uint8))
        out.scales, out.offsets = (0.5,), (100.0,)
    field = HeightField.open(path, vertical_scale=2)
    assert not field.valid[0, 3]
    assert field.heights[1, 1] == 2 * (0.5 * 6 + 100)
    assert field._core.height_step == 0


@pytest.mark.parametrize(("scale", "offset"), [(0.0, 0.0), (math.nan, 0.0), (1.0, math.inf)])
def test_a_band_whose_scale_makes_no_heights_is_refused(tmp_path, scale, offset):
    path = write(tmp_path / "a.tif", Z, from_origin(0, 0, 1, 1))
    with rasterio.open(path, "r+") as out:
        out.scales, out.offsets = (scale,), (offset,)
    with pytest.raises(InvalidInput, match=r"a\.tif: its band has scale"):
        HeightField.open(path)


@pytest.mark.parametrize("spacing", [(3, 4), [3, 4], np.array([3.0, 4.0])])
def test_any_pair_of_spacings_makes_a_spec_that_loads_again(tmp_path, spacing):
    field = HeightField.open(write(tmp_path / "a.tif", Z, from_origin(0, 0, 1, 1)), spacing=spacing)
    assert field.spec.endswith(":spacing=3/4")
    assert datasets.load(field.spec).hash() == field.hash()


def test_several_bands_need_a_choice(tmp_path):
    path = write(tmp_path / "a.tif", np.stack([Z, Z + 100]), from_origin(0, 0, 1, 1))
    with pytest.raises(InvalidInput, match="2 bands .*band=1..2"):
        HeightField.open(path)
    assert sources.load(f"{path}:band=2").heights[0, 0] == 100
    with pytest.raises(InvalidInput, match="band 3 is not within 1 to 2"):
        HeightField.open(path, band=3)


def test_a_picture_lies_nowhere(tmp_path):
    path = write(tmp_path / "a.png", (Z * 1000).astype(np.uint16), driver="PNG")
    field = sources.load(f"{path}:vertical_scale=0.1")
    assert field.spacing == (30, 30) and field.origin == (0, 0)
    assert field.heights == pytest.approx(Z * 100)
    part = sources.load(f"{path}:spacing=10/20,window=1/2/2/3")
    assert part.spacing == (10, 20) and part.origin == (20, -20)
    sphere = HeightField.open(path, planet=True)
    assert sphere._core.wraps and sphere._core.dlon == 72


def test_planets_from_rasters(tmp_path):
    globe = np.zeros((10, 20), np.int16)
    area = write(tmp_path / "area.tif", globe, from_origin(-180, 90, 18, 18), "EPSG:4326")
    frame = HeightField.open(area, planet=True)._core.frame()
    assert (frame["lon0"], frame["lat0"], frame["dlat"], frame["wraps"]) == (-171, 81, 18, True)
    east = HeightField.open(area, planet=True, window=(0, 10, 10, 10))
    assert east._core.lon0 == pytest.approx(9) and not east._core.wraps
    projected = write(tmp_path / "p.tif", globe, from_origin(0, 0, 1, 1), "EPSG:32633")
    with pytest.raises(InvalidInput, match="planet=true needs longitude and latitude"):
        HeightField.open(projected, planet=True)


@pytest.mark.skipif(not hasattr(_core, "write_image"), reason="built without OpenImageIO")
def test_what_only_openimageio_reads(tmp_path):
    path = tmp_path / "a.exr"
    _core.write_image(str(path), np.ascontiguousarray((Z * 10).astype(np.uint8)[..., None]))
    image = _core.read_image(str(path))
    assert image.shape == (4, 5, 1) and image.dtype == np.float32
    field = HeightField.open(path, spacing=2)
    assert np.array_equal(field.heights, image[..., 0]) and np.ptp(field.heights) > 0
    assert field.spacing == (2, 2)


@pytest.mark.skipif(not hasattr(_core, "read_rgba8"), reason="built without OpenImageIO")
def test_colours_are_read_as_rgba(tmp_path):
    rgb = np.random.default_rng(1).integers(0, 255, (3, 6, 7), np.uint8)
    colours = _core.read_rgba8(str(write(tmp_path / "a.png", rgb, driver="PNG")))
    assert np.array_equal(colours[..., :3], np.moveaxis(rgb, 0, 2)) and (colours[..., 3] == 255).all()
    grey = _core.read_rgba8(str(write(tmp_path / "g.png", rgb[:1], driver="PNG")))
    assert np.array_equal(grey[..., :3], np.repeat(rgb[0][..., None], 3, 2))


def test_files_that_cannot_be_read(tmp_path):
    missing = tmp_path / "missing.tif"
    with pytest.raises(InvalidInput, match="missing.tif: there is no such file"):
        HeightField.open(missing)
    with pytest.raises(InvalidInput, match="is a directory"):
        HeightField.open(tmp_path)
    text = tmp_path / "text.tif"
    text.write_text("not a raster")
    with pytest.raises(InvalidInput, match="text.tif: not a raster"):
        HeightField.open(text)
    (tmp_path / "empty.png").write_bytes(b"")
    with pytest.raises(InvalidInput, match="empty.png"):
        HeightField.open(tmp_path / "empty.png")
    if os.geteuid() != 0:  # root reads everything
        text.chmod(0)
        with pytest.raises(InvalidInput, match="permission denied"):
            HeightField.open(text)


@pytest.mark.parametrize("share", [0.02, 0.4, 0.9])
def test_truncated_files(tmp_path, share):
    noise = np.random.default_rng(3).integers(0, 30000, (300, 300)).astype(np.int16)
    whole = write(tmp_path / "whole.tif", noise, from_origin(0, 0, 1, 1)).read_bytes()
    cut = tmp_path / "cut.tif"
    cut.write_bytes(whole[: int(len(whole) * share)])
    with pytest.raises(InvalidInput, match="cut.tif"):
        HeightField.open(cut)


@pytest.mark.parametrize("window", [(0, 0, 5, 5), (-1, 0, 2, 2), (0, 0, 0, 2), (0, 4, 2, 2), (0, 0, 2), "all"])
def test_windows_stay_inside(tmp_path, window):
    path = write(tmp_path / "a.tif", Z, from_origin(0, 0, 1, 1))
    with pytest.raises(InvalidInput, match="window"):
        HeightField.open(path, window=window)


# ---- SOURCE texts -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("nowhere", "'nowhere' is neither a file .* earth, fractal"),
        ("", "names neither"),
        ("earth:colour=red", "unknown key 'colour'; 'earth' knows spacing, vertical_scale"),
        ("earth:planet", "'planet' has no value; it takes true or false"),
        ("earth:planet=yes", "planet=yes is not true or false"),
        ("earth:radius=big", "radius=big is not metres"),
        ("earth:", "unknown key ''"),
        ("earth:radius=1,radius=2", "'radius' is given twice"),
        ("fractal:size=1", "size 1 is not within 2"),
        ("fractal:size=50000", "size 50000"),
        ("fractal:size=2.5", "size=2.5 is not a whole number"),
        ("fractal:size=9,roughness=2", "roughness 2.0* is not within 0 to 1"),
        ("fractal:size=9,seed=-1", "seed -1"),
        ("fractal:planet=true", "unknown key 'planet'; 'fractal' knows size, seed, roughness"),
        ("fractal:size=9,spacing=0", "spacing 0.0 is not positive"),
        ("fractal:size=9,spacing=1/2/3", "spacing=1/2/3 is not metres, or dx/dy"),
        ("nowhere.tif:spacing=3", "'nowhere.tif' is neither"),
    ],
)
def test_source_texts_that_are_wrong(text, words):
    with pytest.raises(InvalidInput, match=words):
        sources.load(text)


def test_a_file_of_the_whole_name_wins(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write(tmp_path / "a.tif:spacing=5", Z, from_origin(0, 0, 1, 1))
    field = sources.load("a.tif:spacing=5")
    assert field.spacing == (1, 1)
    other = sources.load("a.tif:spacing=5:spacing=7")
    assert other.spacing == (7, 7)
    assert sources.load(other.spec).hash() == other.hash()
    write(tmp_path / "fractal", Z, from_origin(0, 0, 1, 1))
    assert sources.load("fractal").shape == (4, 5)


def test_bare_names_are_looked_up_in_the_data_folder(tmp_path, monkeypatch):
    (tmp_path / "terrain").mkdir()
    write(tmp_path / "terrain" / "there.tif", Z, from_origin(0, 0, 1, 1))
    monkeypatch.setenv("LODLAB_DATA", str(tmp_path))
    field = sources.load("there.tif:vertical_scale=3")
    assert field.heights[0, 1] == 3
    monkeypatch.delenv("LODLAB_DATA")
    monkeypatch.chdir("/")
    assert sources.load(field.spec).hash() == field.hash()


@pytest.mark.parametrize(
    "text",
    [
        "jacksboro",
        "jacksboro:vertical_scale=2.5",
        "fractal:size=65,seed=3,roughness=0.75",
        "fractal:size=33,spacing=10/20",
        "earth:window=1000/0/50/60",
        "earth:vertical_scale=20,window=1000/0/50/60",
    ],
)
def test_a_spec_loads_the_same_again(text):
    field = sources.load(text)
    again = sources.load(field.spec)
    assert again.hash() == field.hash() and again.spec == field.spec


def test_as_source_takes_what_a_user_has():
    field = HeightField(Z)
    assert sources.as_source(field) is field
    assert sources.as_source(Z).hash() == field.hash()
    assert sources.as_source("fractal:size=9").shape == (9, 9)
    with pytest.raises(InvalidInput, match="dict"):
        sources.as_source({})


# ---- data sets --------------------------------------------------------------------------------------


def test_the_list_tells_the_truth():
    rows = {row["name"]: row for row in datasets.list()}
    assert set(rows) == {"jacksboro", "earth", "fractal", "earth-globe", "icosphere", "torus", "blob"}
    for name, row in rows.items():
        field = datasets.load(name)
        assert field.kind == row["kind"]
        if row["kind"] == "mesh":
            assert len(field.faces) == row["triangles"]
            continue
        assert field.shape == (row["rows"], row["cols"])
        assert field.spacing == pytest.approx(row["spacing"], rel=1e-3)
        assert row["description"]


def test_jacksboro_lies_where_its_corners_say():
    field = datasets.load("jacksboro")
    assert field.spacing == pytest.approx((74.573, 92.475), abs=0.01)  # 3 arc-seconds at 36.59 N
    assert field._core.z_min == 236 and field._core.z_max == 1076
    assert field._core.height_step == 1.0


def test_earth_is_round():
    flat, planet = datasets.load("earth"), datasets.load("earth:planet=true")
    assert flat.shape == planet.shape == (2161, 4320)
    assert (flat._core.z_min, flat._core.z_max) == (-10376, 7833)
    frame = planet._core.frame()
    assert (frame["lon0"], frame["lat0"], frame["dlon"], frame["dlat"]) == (0, 90, 360 / 4320, 180 / 2160)
    assert frame["wraps"]
    high = np.unravel_index(np.argmax(planet.heights), planet.shape)
    lon, lat = high[1] / 12, 90 - high[0] / 12
    assert 70 < lon < 105 and 25 < lat < 40  # the Himalaya or Karakoram


def test_fractal_windows_agree():
    whole = datasets.fractal_window(100, 120, -30, 40, seed=5)
    part = datasets.fractal_window(17, 33, -3, 71, seed=5)
    assert np.array_equal(whole[27:44, 31:64], part)
    assert np.array_equal(
        datasets.load("fractal:size=129,seed=5").heights[:70, :100], datasets.fractal_window(70, 100, seed=5)
    )


def test_real_voids_stay_holes(shared_data):
    field = HeightField.open(shared_data("terrain/mt_rainier_srtm3.tif"))
    assert field.shape == (1201, 1201)
    assert (~field.valid).sum() == 9033
    assert field.spacing == pytest.approx((63.97, 92.63), abs=0.01)
    assert field.filled[~field.valid].min() >= 263 and field.filled[~field.valid].max() <= 4392


def test_crater_lake_has_undeclared_voids(shared_data):
    with pytest.warns(UserWarning, match="39489 samples hold -32767"):
        field = HeightField.open(shared_data("terrain/craterlake-elev-16bit-30m.tif"))
    assert (field._core.z_min, field._core.z_max) == (1289, 1880)
    with pytest.raises(InvalidInput, match="4 bands \\(red, green, blue, alpha\\)"):
        HeightField.open(shared_data("terrain/craterlake-imagery-30m.tif"))


# ---- looks ------------------------------------------------------------------------------------------


def test_a_field_shows_itself():
    z = np.hypot(*np.mgrid[-40:41, -60:61]).astype(np.float32)
    z[10:20, 10:20] = np.nan
    field = HeightField(z, name="cone")
    assert "cone: 81 x 121" in repr(field) and "100 voids" in repr(field)
    assert field._repr_png_().startswith(b"\x89PNG")
    assert "data:image/png;base64," in field._repr_html_()
    image = field.thumbnail(64)
    assert image.shape == (41, 61, 3) and image.dtype == np.uint8
    assert image[30, 40].tolist() != image[10, 40].tolist()  # lit from the north-west
    assert HeightField(np.zeros((2, 2))).thumbnail().shape == (2, 2, 3)
