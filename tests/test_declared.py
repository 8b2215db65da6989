# SPDX-License-Identifier: MIT
"""What raster files say of themselves is used, or refused by name: units, ellipsoids, placement, voids, encodings,
containers. In memory and by windows alike."""

from __future__ import annotations

import gzip
import math
import pickle
import warnings
import zipfile

import numpy as np
import pytest
import rasterio
import rasterio.shutil
from rasterio.control import GroundControlPoint
from rasterio.enums import ColorInterp
from rasterio.transform import Affine

from lodlab import datasets, sources
from lodlab.cli.program import run
from lodlab.errors import InvalidInput
from lodlab.sources.heightfield import HeightField
from lodlab.sources.placement import metres_per_degree

from .test_sources import write

US = 1200 / 3937
METRES = Affine(30, 0, 500000, 0, -30, 5100000)
FEET = Affine(30 / US, 0, 500000 / US, 0, -30 / US, 5100000 / US)
MOON = (
    'GEOGCS["Moon 2000",DATUM["D_Moon_2000",SPHEROID["Moon_2000_IAU_IAG",1737400,0]],PRIMEM["Greenwich",0],'
    'UNIT["Degree",0.0174532925199433]]'
)
LOCAL = 'LOCAL_CS["site grid",UNIT["US survey foot",0.304800609601219],AXIS["Easting",EAST],AXIS["Northing",NORTH]]'
LOWEST = -3.4028234663852886e38
Y, X = np.mgrid[0:40, 0:50]
HILLS = (1000 + 60 * np.sin(X / 9) + 40 * np.cos(Y / 7) + 2 * Y).astype(np.float32)


@pytest.fixture(params=["in memory", "by windows"])
def load(request, monkeypatch):
    """Loads a SOURCE both ways; by windows it is surveyed as well."""

    def make(text) -> HeightField:
        if request.param == "by windows":
            monkeypatch.setenv("LODLAB_WINDOW_SAMPLES", "100")
        field = sources.load(text)
        assert field.windowed == (request.param == "by windows")
        field.hash()
        return field

    return make


# ---- units ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("factor", "transform", "crs", "unit"),
    [
        (1 / US, METRES, "EPSG:32612", "US survey foot"),
        (1 / US, FEET, "EPSG:6529+6360", None),
        (1 / US, FEET, "EPSG:6529+6360", "US survey foot"),
        (1.0, FEET, "EPSG:6529", "metre"),
        (1 / 0.3048, METRES, "EPSG:32612", "ft"),
        (100.0, METRES, "EPSG:32612", "cm"),
        (-1.0, METRES, "EPSG:32612+5831", None),  # depths
    ],
)
def test_heights_in_declared_units_are_metres(load, tmp_path, factor, transform, crs, unit):
    path = write(tmp_path / "a.tif", (HILLS * factor).astype(np.float32), transform, crs)
    if unit:
        with rasterio.open(path, "r+") as dataset:
            dataset.units = (unit,)
    field = load(path)
    assert field.heights == pytest.approx(HILLS, rel=1e-6)
    assert field.spacing == pytest.approx((30, 30), rel=1e-9)
    assert pickle.loads(pickle.dumps(field)).used == field.used
    assert (unit or "(") in field.used["vertical_unit"]


def test_whole_heights_in_feet_keep_their_step(load, tmp_path):
    path = write(tmp_path / "a.tif", HILLS.astype(np.int16), METRES, "EPSG:32612")
    with rasterio.open(path, "r+") as dataset:
        dataset.units = ("ft",)
    assert load(path).core.frame()["height_step"] == 0.3048


def test_a_unit_that_is_no_length_and_one_that_is_contradicted_are_warned_of(tmp_path):
    path = write(tmp_path / "a.tif", HILLS, FEET, "EPSG:6529+6360")
    for unit, words in (("K", "'K', which is no length"), ("metre", "the band's unit is used")):
        with rasterio.open(path, "r+") as dataset:
            dataset.units = (unit,)
        with pytest.warns(UserWarning, match=words):
            assert np.array_equal(HeightField.open(path).heights, HILLS)


@pytest.mark.parametrize(
    ("transform", "crs", "spacing", "unit"),
    [
        (Affine(100, 0, 1000, 0, -100, 9000), LOCAL, 100 * 0.304800609601219, "US survey foot"),
        (Affine(0.03, 0, 500, 0, -0.03, 5100), "+proj=utm +zone=32 +datum=WGS84 +units=km +no_defs", 30.0, "kilometre"),
    ],
)
def test_local_systems_and_kilometres_are_converted(load, tmp_path, transform, crs, spacing, unit):
    field = load(write(tmp_path / "a.tif", HILLS, transform, crs))
    assert field.spacing == pytest.approx((spacing, spacing), rel=1e-12)
    assert field.used["horizontal_unit"] == unit


def test_grads_are_degrees_and_count_from_their_own_meridian(tmp_path):
    path = write(tmp_path / "a.tif", HILLS, Affine(0.01, 0, 2.0, 0, -0.01, 50.2), "EPSG:4807")
    field = HeightField.open(path)
    kx, ky = metres_per_degree(0.9 * 50.0, 6378249.2, 1 - (6356515 / 6378249.2) ** 2)
    assert field.spacing == pytest.approx((0.009 * kx, 0.009 * ky), rel=1e-9)
    assert "Clarke" in field.used["ellipsoid"]
    frame = HeightField.open(path, planet=True)._core.frame()
    assert frame["lon0"] == pytest.approx(0.9 * (2.005 + 2.5969213), rel=1e-9)
    assert frame["dlat"] == pytest.approx(0.009)


def test_a_degree_of_the_moon_is_30_kilometres(load, tmp_path):
    path = write(tmp_path / "a.tif", HILLS, Affine(1, 0, 10, 0, -1, 20), MOON)
    assert load(path).spacing == pytest.approx((30323.35, 30323.35), abs=0.01)
    assert load(f"{path}:planet=true").radius == 1737400
    given = load(f"{path}:planet=true,radius=6371000")
    assert given.radius == sources.load(given.spec).radius == 6371000
    assert load(write(tmp_path / "e.tif", HILLS, Affine(1, 0, 10, 0, -1, 20), "EPSG:4258")).spacing == (
        load(write(tmp_path / "w.tif", HILLS, Affine(1, 0, 10, 0, -1, 20), "EPSG:4326")).spacing
    )


def test_rotated_poles_are_no_longitudes(tmp_path):
    rotated = "+proj=ob_tran +o_proj=longlat +o_lat_p=40 +lon_0=10 +a=6371229 +b=6371229"
    path = write(tmp_path / "a.tif", HILLS, Affine(0.1, 0, 2.0, 0, -0.1, 5), rotated)
    with pytest.raises(InvalidInput, match="has rotated poles"):
        HeightField.open(path, planet=True)


def test_info_says_which_units_were_used(tmp_path, capsys):
    path = write(tmp_path / "a.tif", HILLS, FEET, "EPSG:6529+6360")
    assert run(["info", str(path)]) == 0
    text = capsys.readouterr().out
    assert "NAD83(2011) / New Mexico Central (ftUS) + NAVD88" in text
    assert text.count("US survey foot") == 2


def test_spacing_and_relief_that_cannot_belong_together_are_warned_of(load, tmp_path):
    path = write(tmp_path / "a.tif", 10 * HILLS, Affine(0.0003, 0, 14, 0, -0.0003, 46))
    with pytest.warns(UserWarning, match="has no reference system: are these degrees"):
        load(path)
    plain = np.where(X % 10 == 0, 3, 2).astype(np.int16)  # most steps are none
    with pytest.warns(UserWarning, match="rises .* m a metre on average"):
        load(write(tmp_path / "b.tif", plain, Affine(0.0003, 0, 14, 0, -0.0003, 46)))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        load(f"{path}:spacing=30,vertical_scale=1000")  # meant


# ---- voids ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("nodata", "stored"), [(-3.40282306073709653e38, LOWEST), (LOWEST, -3.40282306e38), (LOWEST, LOWEST)]
)
def test_nodata_whose_last_digits_differ_is_void(load, tmp_path, nodata, stored):
    z = HILLS.copy()
    z[:9, :7] = stored
    field = load(write(tmp_path / "a.tif", z, METRES, "EPSG:32632", nodata=nodata))
    assert field.void_samples == 63
    assert HeightField(z, nodata=nodata).void_samples == 63
    ends = np.where(np.isclose(z, stored), -np.finfo(float).max, z.astype(np.float64))
    assert HeightField(ends, nodata=-np.finfo(float).max).void_samples == 63


def test_a_height_that_cannot_be_is_refused_with_the_cure(load, tmp_path):
    z = HILLS.copy()
    z[3, 4], z[5, 6] = -9999, LOWEST
    path = write(tmp_path / "a.tif", z, METRES, "EPSG:32632", nodata=-9999)
    with pytest.raises(InvalidInput, match=r"a\.tif: sample at row 5, column 6 .* declares nodata -9999\.0; nodata=-3"):
        load(path)
    field = load(f"{path}:nodata=-9999/{LOWEST!r}")
    assert field.void_samples == 2
    assert sources.load(field.spec).hash() == field.hash()


@pytest.mark.parametrize("mark", [9999, 32767, -32768])
def test_undeclared_marks_are_guessed_high_and_low(tmp_path, mark):
    z = HILLS.astype(np.int16)
    z[2:4, 5] = mark
    z[9, 9] = -9999
    path = write(tmp_path / "a.tif", z, METRES, "EPSG:32632")
    with pytest.warns(UserWarning, match=f"2 samples hold {mark}"), pytest.warns(UserWarning, match="1 samples"):
        if mark > 0:
            field = HeightField.open(path)
        else:  # of two low marks the lower one alone is farther from the rest than that is wide
            warnings.warn("1 samples", stacklevel=1)
            field = HeightField.open(path)
    assert field.void_samples == (3 if mark > 0 else 2)


def test_a_mark_among_heights_like_it_is_a_height(load, tmp_path):
    z = np.linspace(0, 9999, 2000).reshape(40, 50).astype(np.int16)
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        field = load(write(tmp_path / "a.tif", z, Affine(3e4, 0, 0, 0, -3e4, 0), "EPSG:32632"))
    assert field.void_samples == 0 and field.core.z_max == 9999


# ---- placement ------------------------------------------------------------------------------------


def test_a_reference_system_alone_places_nothing(load, tmp_path):
    path = write(tmp_path / "a.tif", HILLS, None, "EPSG:32632")
    with pytest.warns(UserWarning, match="nothing says where its samples lie"):
        field = load(path)
    assert field.spacing == (30, 30) and field.origin == (0, 0)
    assert np.array_equal(field.heights, HILLS)  # not mirrored
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        assert load(f"{path}:spacing=12").spacing == (12, 12)


def _with_points(path, points):
    gcps = [GroundControlPoint(*p) for p in points]
    with rasterio.open(
        path, "w", driver="GTiff", count=1, height=40, width=50, dtype="float32", gcps=gcps, crs="EPSG:32632"
    ) as dataset:
        dataset.write(HILLS, 1)
    return path


def test_ground_control_points_that_hold_a_scale_and_a_shift_place_a_raster(load, tmp_path):
    corners = [(r, c) for r in (0, 40) for c in (0, 50)]
    path = _with_points(tmp_path / "a.tif", [(r, c, 500000 + 10 * c, 5100000 - 20 * r) for r, c in corners])
    field = load(path)
    assert field.spacing == pytest.approx((10, 20)) and field.origin == pytest.approx((500005, 5099990))
    turned = [(r, c, 500000 + 10 * c + 2 * r, 5100000 - 20 * r) for r, c in corners]
    with pytest.raises(InvalidInput, match="4 ground control points are no scale and shift .* gdalwarp"):
        load(_with_points(tmp_path / "b.tif", turned))
    with pytest.raises(InvalidInput, match="1 ground control points"):
        load(_with_points(tmp_path / "c.tif", [(0, 0, 5.0, 6.0)]))


def test_a_skew_of_no_sample_is_no_rotation(load, tmp_path):
    tiny = Affine(30, 3e-6, 500000, -3e-6, -30, 5100000)
    assert load(write(tmp_path / "a.tif", HILLS, tiny, "EPSG:32632")).spacing == (30, 30)
    with pytest.raises(InvalidInput, match="rotated"):
        load(write(tmp_path / "b.tif", HILLS, Affine(30, 0.1, 500000, -0.1, -30, 5100000), "EPSG:32632"))


# ---- bands ----------------------------------------------------------------------------------------


def test_negative_scales_are_heights(load, tmp_path):
    path = write(tmp_path / "a.tif", (-HILLS).astype(np.int16), METRES, "EPSG:32632")
    with rasterio.open(path, "r+") as out:
        out.scales = (-0.5,)
    field = load(path)
    assert np.array_equal(field.heights, -0.5 * (-HILLS).astype(np.int16))
    assert field.core.frame()["height_step"] == 0.5


def test_grey_and_opacity_are_one_band_and_a_mask(load, tmp_path):
    grey = HILLS.astype(np.uint16)
    bands = np.stack([grey, np.where(X > 10, 65535, 0).astype(np.uint16)])
    field = load(write(tmp_path / "a.png", bands, driver="PNG"))
    assert np.array_equal(field.valid, X > 10) and np.array_equal(field.heights[field.valid], grey[X > 10])


def test_a_palette_is_no_terrain(tmp_path):
    path = write(tmp_path / "a.png", (X % 7).astype(np.uint8), driver="PNG", photometric="palette")
    with rasterio.open(path, "r+") as out:
        out.write_colormap(1, {k: (k, 90, 90, 255) for k in range(7)})
    tif = write(tmp_path / "a.tif", (X % 7).astype(np.uint8), METRES)
    with rasterio.open(tif, "r+") as out:
        out.colorinterp = (ColorInterp.palette,)
        out.write_colormap(1, {k: (k, 90, 90, 255) for k in range(7)})
    with pytest.raises(InvalidInput, match="numbers of a palette's colours"):
        HeightField.open(tif)


@pytest.mark.parametrize("alpha", [False, True])
def test_heights_in_red_green_and_blue_are_decoded(load, tmp_path, alpha):
    """Formulas as published with the tiles: terrarium R 256 + G + B / 256 - 32768, mapbox (R 65536 + G 256 + B) / 10
    - 10000, metres."""
    rgb = np.random.default_rng(1).integers(0, 255, (3, 40, 50), np.uint8)
    r, g, b = rgb.astype(np.float64)
    opaque = np.where(X > 4, 255, 0).astype(np.uint8)
    path = write(tmp_path / "a.png", np.concatenate([rgb, opaque[None]]) if alpha else rgb, driver="PNG")
    wanted = {"terrarium": r * 256 + g + b / 256 - 32768, "mapbox": (r * 65536 + g * 256 + b) / 10 - 10000}
    for name, heights in wanted.items():
        field = load(f"{path}:encoding={name},spacing=3e6")
        real = X > 4 if alpha else np.ones(X.shape, bool)
        assert np.array_equal(field.valid, real)
        assert field.heights[real] == pytest.approx(heights[real], rel=1e-6, abs=1e-3)
        assert sources.load(field.spec).hash() == field.hash()
    sea = load(f"{path}:encoding=mapbox,spacing=3e6,nodata={float(wanted['mapbox'][20, 20])!r}")
    assert not sea.valid[20, 20]


def test_what_is_not_encoded_is_not_decoded(tmp_path):
    path = write(tmp_path / "a.tif", HILLS, METRES)
    with pytest.raises(InvalidInput, match="encoding=mapbox takes red, green and blue .* 1 bands .* float32"):
        HeightField.open(path, encoding="mapbox")
    with pytest.raises(InvalidInput, match="'png' is not one of terrarium, mapbox"):
        HeightField.open(path, encoding="png")


# ---- what is opened -------------------------------------------------------------------------------


def test_virtual_paths_open_from_any_folder(load, tmp_path, monkeypatch):
    tif = write(tmp_path / "x.tif", HILLS, METRES, "EPSG:32632")
    wanted = sources.load(tif).hash()
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as folder:
        folder.write(tif, "x.tif")
    (tmp_path / "x.tif.gz").write_bytes(gzip.compress(tif.read_bytes()))
    monkeypatch.chdir(tmp_path)
    for text in ("zip://a.zip!x.tif", "/vsizip/a.zip/x.tif", "/vsigzip/x.tif.gz", "GTIFF_DIR:1:x.tif"):
        monkeypatch.chdir(tmp_path)
        field = load(text)
        assert field.hash() == wanted and field.name == "x"
        monkeypatch.chdir("/")
        assert sources.load(field.spec).hash() == wanted
    monkeypatch.chdir(tmp_path)
    assert load("zip://a.zip!x.tif:spacing=7").spacing == (7, 7)
    with pytest.raises(InvalidInput, match=r"zip://.*nothing\.tif"):
        load("zip://a.zip!nothing.tif")


def test_subdatasets_open_and_a_container_names_them(tmp_path, capsys):
    tif = write(tmp_path / "x.tif", HILLS.astype(np.int16), METRES, "EPSG:32632")
    both, one = tmp_path / "two.gpkg", tmp_path / "one.gpkg"
    with rasterio.open(tif) as dataset:
        for k, name in enumerate(("dem", "canopy")):
            more = "YES" if k else "NO"
            rasterio.shutil.copy(dataset, both, driver="GPKG", RASTER_TABLE=name, APPEND_SUBDATASET=more)
        rasterio.shutil.copy(dataset, one, driver="GPKG", RASTER_TABLE="dem")
    assert run(["info", str(one)]) == 0  # no store, although SQLite
    with pytest.raises(InvalidInput, match=r"it holds 2 rasters; name one of GPKG:.*DEM, GPKG:.*CANOPY"):
        sources.load(both)
    field = sources.load(f"GPKG:{both}:DEM")
    assert np.array_equal(field.heights, HILLS.astype(np.int16)) and field.name == "DEM"
    capsys.readouterr()


def test_arrays_on_disk_are_sources(load, tmp_path):
    np.save(tmp_path / "a.npy", HILLS)
    np.savez(tmp_path / "b.npz", dem=HILLS, colours=np.zeros((2, 2, 3)))
    wanted = HeightField(HILLS, spacing=5)
    field = load(f"{tmp_path}/a.npy:spacing=5")
    assert field.hash() == wanted.hash() and field.name == "a"
    part = load(f"{tmp_path}/a.npy:window=3/4/20/30")
    assert np.array_equal(part.heights, HILLS[3:23, 4:34])
    inside = sources.load(f"{tmp_path}/b.npz:dem:spacing=5").loaded()
    assert inside.hash() == wanted.hash() and inside.name == "dem"
    assert sources.load(inside.spec).hash() == wanted.hash()
    for text, words in (
        (f"{tmp_path}/b.npz:colours", "shape .2, 2, 3. .* two dimensions"),
        (f"{tmp_path}/b.npz:nothing", "no array 'nothing'; there are dem, colours"),
        (f"{tmp_path}/b.npz", "name one: .*b.npz:dem"),
    ):
        with pytest.raises(InvalidInput, match=words):
            sources.load(text)
    (tmp_path / "c.npy").write_bytes(b"no array")
    with pytest.raises(InvalidInput, match=r"c\.npy: not an array"):
        sources.load(f"{tmp_path}/c.npy")


# ---- rounding -------------------------------------------------------------------------------------


def test_heights_that_floats_round_are_warned_of_and_kept_by_an_offset(load, tmp_path):
    z = 6371000.0 + HILLS.astype(np.float64) / 100
    path = write(tmp_path / "a.tif", z, METRES, "EPSG:32632")
    with pytest.warns(UserWarning, match=r"rounded by up to 0\.25 m .* offset=-637101\d "):
        load(path)
    with pytest.warns(UserWarning, match=r"rounded by up to 4 m .* offset=-637101\d "):
        load(f"{path}:vertical_scale=16")
    with pytest.warns(UserWarning, match="rounded"):
        HeightField(z)
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        field = load(f"{path}:offset=-6371000")
        assert field.heights == pytest.approx(HILLS / 100, rel=1e-6)
        assert sources.load(field.spec).hash() == field.hash()
        HeightField(HILLS.astype(np.float64))
        HeightField(np.random.default_rng(1).random((9, 9)) * 3000)


# ---- how it shows itself --------------------------------------------------------------------------


def test_a_field_says_that_y_falls_down_its_rows():
    field = HeightField(HILLS, spacing=(10, 20), origin=(100, 50))
    assert "x 100 to 590, y 50 down to -730 m" in repr(field)
    assert "y falls down the rows" in HeightField.__doc__
    assert "radius" in repr(HeightField(HILLS, planet=True)) and math.isfinite(datasets.load("jacksboro").origin[1])
