# SPDX-License-Identifier: MIT
"""Sources read by windows are the sources that they are in memory: hash, paths, stores, and what is measured."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from rasterio.transform import from_origin

import lodlab as lod
from lodlab import _core, datasets
from lodlab.errors import InvalidInput, Unsupported
from lodlab.instrument.metrics import METRICS, measure
from lodlab.paths.path import CameraPath

from .test_sources import write

PLANET = "earth:planet=true,window=300/200/400/500"
SPECS = ("fractal:size=300,vertical_scale=1.7,spacing=10/20,seed=5", "earth:window=10/20/300/301", PLANET)
BUILDS = (
    {},
    {"finest_error": 2.0},
    {"chart": 64, "levels": 3, "node_resolution": 32},
    {"chart": 32, "levels": 2, "node_resolution": 16, "finest_error": 20.0},
    {"bounds": "bilinear"},
    {"normals": "attribute", "chart": 64, "levels": 3},
)


@pytest.fixture
def small(monkeypatch):
    """Makes more than 1000 samples too many to be held; called with a SOURCE, gives it in memory and windowed."""

    def both(spec: str) -> tuple[lod.HeightField, lod.HeightField]:
        monkeypatch.delenv("LODLAB_WINDOW_SAMPLES", raising=False)
        held = datasets.load(spec)
        monkeypatch.setenv("LODLAB_WINDOW_SAMPLES", "1000")
        windowed = datasets.load(spec)
        assert windowed.windowed and not held.windowed
        return held, windowed

    return both


def native(field: lod.HeightField, at_once: int, calls: list | None = None):
    """A native windowed field of a field in memory."""
    frame = {k: v for k, v in field.core.frame().items() if k not in ("rows", "cols", "z_min", "z_max")}

    def read(row: int, count: int) -> np.ndarray:
        if calls is not None:
            calls.append((row, count))
        return field.filled[row : row + count], None

    return _core.WindowedField(*field.shape, read, at_once=at_once, **frame)


@pytest.mark.parametrize("spec", SPECS)
def test_a_windowed_source_is_the_one_in_memory(small, spec):
    held, windowed = small(spec)
    for name in ("shape", "spacing", "origin", "planet", "radius", "spec", "name"):
        assert getattr(windowed, name) == getattr(held, name)
    assert windowed.hash() == held.hash()
    assert windowed.core.frame() == held.core.frame()
    assert np.array_equal(windowed.heights, held.heights) and windowed.valid.all()
    assert np.array_equal(windowed.thumbnail(), held.thumbnail())
    assert pickle.loads(pickle.dumps(windowed)).hash() == held.hash()
    assert windowed.loaded().hash() == held.hash() and not windowed.loaded().windowed
    assert "read by windows" in repr(windowed)


@pytest.mark.parametrize("spec", SPECS)
def test_paths_over_a_windowed_source_are_those_in_memory(small, spec):
    held, windowed = small(spec)
    for name in ("flyover", "orbit", "walk", "zoom", "still"):
        paths = [list(CameraPath.named(name, field, frames=5).views()) for field in (held, windowed)]
        assert paths[0] == paths[1]


def test_an_outlier_is_one_by_windows_too(small, tmp_path):
    z = _core.fractal(90, 130)
    z[50, 60], z[40, 70] = 5e4, -5e4
    np.save(tmp_path / "a.npy", z)
    held, windowed = small(str(tmp_path / "a.npy"))
    for name in ("flyover", "orbit"):
        paths = [list(CameraPath.named(name, field, frames=5).views()) for field in (held, windowed)]
        assert paths[0] == paths[1]


@pytest.mark.parametrize("at_once", [1, 5000, 1 << 23])
@pytest.mark.parametrize("planet", [False, True])
def test_the_hash_does_not_depend_on_bands(at_once, planet):
    field = lod.HeightField(_core.fractal(61, 120), planet=planet)
    assert native(field, at_once).hash() == field.hash()
    assert native(field, at_once).frame() == field.core.frame()


@pytest.mark.parametrize(
    ("spec", "options"),
    [("earth:planet=true", BUILDS[2])]
    + [(spec, options) for spec in ("fractal:size=257", "fractal:size=300", PLANET) for options in BUILDS],
)
def test_bands_build_the_store_that_the_whole_builds(tmp_path, spec, options):
    field = datasets.load(spec)
    calls = []
    stores = [
        _core.build(given, "multigrain", tmp_path / f"{k}.lod", options)
        for k, given in enumerate((field.core, native(field, 1 << 23, calls)))
    ]
    assert stores[0].info()["content_hash"] == stores[1].info()["content_hash"]
    assert stores[0].source_hash == stores[1].source_hash
    surveyed = [row for row, _ in calls].index(0, 1) if len(calls) > 1 else 1
    most = max(count for _, count in calls[surveyed:])
    assert most < field.shape[0] or field.shape[0] <= 258, "the build asked for the whole field"
    times = 2 if "finest_error" in options else 1
    asked = sum(count for _, count in calls[surveyed:])
    assert asked <= 1.1 * times * field.shape[0], "rows were read more often than they are needed"


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"finest_error": 2.0},
        {"resolutions": 3},
        {"pyramid": "average"},
        {"patch": 8, "resolutions": 3},
        {"normals": "attribute", "finest_error": 2.0},
    ],
)
@pytest.mark.parametrize("size", [257, 300, 700])
def test_bands_build_the_patches_that_the_whole_builds(tmp_path, size, options):
    field = datasets.load(f"fractal:size={size}")
    stores = [
        _core.build(given, "seamless", tmp_path / f"{k}.lod", options)
        for k, given in enumerate((field.core, native(field, 1 << 23)))
    ]
    assert stores[0].info()["content_hash"] == stores[1].info()["content_hash"]


def test_a_stopped_build_by_bands_goes_on(tmp_path):
    field = datasets.load("fractal:size=700")
    options = {"chart": 64, "levels": 3, "node_resolution": 32}
    whole = _core.build(field.core, "multigrain", tmp_path / "a.lod", options).info()["content_hash"]
    last = [field.shape[0]]

    def read(row: int, count: int) -> tuple[np.ndarray, None]:
        if row + count > last[0]:
            raise KeyError("the disk is gone")
        return field.filled[row : row + count], None

    frame = {"dx": field.core.dx, "dy": field.core.dy}
    windowed = _core.WindowedField(*field.shape, read, spec=field.spec, radius=field.radius, **frame)
    last[0] = 450
    with pytest.raises(KeyError, match="the disk is gone"):
        _core.build(windowed, "multigrain", tmp_path / "b.lod", options)
    last[0] = field.shape[0]
    assert not (tmp_path / "b.lod").exists()
    taken_up = _core.build(windowed, "multigrain", tmp_path / "b.lod", options, "resume")
    assert taken_up.info()["content_hash"] == whole


def test_what_a_reader_raises_comes_out():
    def stops(row, count):
        raise KeyError("no such row")

    with pytest.raises(KeyError, match="no such row"):
        _core.WindowedField(10, 10, stops)
    with pytest.raises(InvalidInput, match="others were read"):
        _core.WindowedField(10, 10, lambda row, count: (np.zeros((1, 10), np.float32), None))
    with pytest.raises(InvalidInput, match="not float32"):
        _core.WindowedField(10, 10, lambda row, count: (np.zeros((count, 10)), None))
    with pytest.raises(InvalidInput, match="heights and a mask"):
        _core.WindowedField(10, 10, lambda row, count: np.zeros((count, 10), np.float32))
    with pytest.raises(InvalidInput, match="not uint8"):
        _core.WindowedField(10, 10, lambda row, count: (np.zeros((count, 10), np.float32), np.ones((count, 10), int)))
    bad = np.zeros((10, 10), np.float32)
    bad[7, 3] = np.inf
    with pytest.raises(InvalidInput, match="row 7, column 3 is not finite"):
        _core.WindowedField(10, 10, lambda row, count: (bad[row : row + count], None), at_once=20)
    with pytest.raises(InvalidInput, match="at least 2 x 2"):
        _core.WindowedField(1, 10, lambda row, count: (bad[:1], None))


@pytest.mark.parametrize("dtype", ["int16", "int32", "float32"])
@pytest.mark.parametrize("flips", [(1, 1), (-1, 1), (1, -1)])
def test_rasters_are_read_by_windows(small, tmp_path, dtype, flips):
    z = np.rint(_core.fractal(90, 70)).astype(dtype)
    transform = from_origin(500.0, 900.0, 10.0, 20.0)
    if flips[0] < 0:
        transform = transform * transform.translation(0, 90) * transform.scale(1, -1)
    if flips[1] < 0:
        transform = transform * transform.translation(70, 0) * transform.scale(-1, 1)
    path = write(tmp_path / "a.tif", z[:: flips[0], :: flips[1]], transform, "EPSG:32611", tiled=True)
    for keys in ("", ":vertical_scale=0.1", ":window=3/4/50/60"):
        held, windowed = small(f"{path}{keys}")
        assert windowed.hash() == held.hash()
        assert np.array_equal(windowed.grid[5:9, 3:20], held.grid[5:9, 3:20])
        store = lod.build(windowed, "multigrain", tmp_path / "w.lod", mode="force", progress=False)
        whole = lod.build(held, "multigrain", tmp_path / "h.lod", mode="force", progress=False)
        assert store.info()["content_hash"] == whole.info()["content_hash"]


def test_voids_of_windowed_rasters_are_filled_alike_whatever_is_read(small, tmp_path):
    z = np.rint(_core.fractal(200, 70)).astype(np.int16)
    z[31:35, 7:20] = z[60:70, 30:40] = z[100:199, :] = -32768
    path = write(tmp_path / "a.tif", z, nodata=-32768)
    held, windowed = small(str(path))
    assert windowed.void_samples == held.void_samples > 0
    assert np.array_equal(windowed.valid, held.valid)
    assert np.array_equal(windowed.heights, held.heights, equal_nan=True)
    assert windowed.core.frame()["height_step"] == held.core.frame()["height_step"] == 1.0
    filled = windowed.filled
    assert np.isfinite(filled).all() and filled[held.valid].max() >= filled.max()
    windows = windowed.grid
    for rows, cols in ((slice(30, 34), slice(5, 12)), (slice(62, 130), slice(0, 70)), (slice(64, 66), slice(39, 41))):
        assert np.array_equal(windows[rows, cols], filled[rows, cols])
    assert windows[33, 9] == filled[33, 9]
    assert windowed.hash() == pickle.loads(pickle.dumps(windowed)).hash() == windowed.loaded().hash()
    stores = [
        _core.build(given, "multigrain", tmp_path / f"{k}.lod", BUILDS[3])
        for k, given in enumerate((windowed.loaded().core, windowed.core))
    ]
    assert stores[0].info()["content_hash"] == stores[1].info()["content_hash"]
    session = stores[1].session({})
    view = CameraPath.flyover(windowed, frames=3).view(1, size=(96, 64))
    cut = session.select(view, _core.Budget(pixel_error=4.0))
    whole, banded = (
        measure(_core.Instrument(given), session, cut, view) for given in (windowed.loaded().core, windowed.core)
    )
    assert whole["measured_samples"] == held.valid.sum()
    for metric in METRICS:
        assert banded[metric.name] == pytest.approx(whole[metric.name], rel=1e-6, abs=1e-6, nan_ok=True), metric.name


def test_marks_of_voids_that_a_windowed_raster_does_not_declare_are_asked_about(small, tmp_path):
    z = np.rint(_core.fractal(90, 70)).astype(np.int16)
    z[31, 7] = -32768
    path = write(tmp_path / "a.tif", z)
    with pytest.warns(UserWarning, match="does not declare"):
        _, windowed = small(str(path))
    with pytest.raises(InvalidInput, match="nodata=-32768 takes it as void"):
        windowed.hash()
    assert datasets.load(f"{path}:nodata=none").core.z_min == -32768.0
    assert datasets.load(f"{path}:nodata=-32768").void_samples == 1
    write(path, np.full_like(z, -32768), nodata=-32768)
    with pytest.raises(InvalidInput, match="all samples are void"):
        datasets.load(str(path)).hash()


def test_stores_of_windowed_sources_are_flown_and_measured(small, tmp_path):
    held, windowed = small("fractal:size=257")
    store = lod.build(windowed, "multigrain", tmp_path / "w.lod", progress=False)
    again = lod.open(tmp_path / "w.lod")
    assert again.source.windowed
    flight = {"frames": 3, "size": (96, 64), "progress": False}
    run = lod.fly(again, "flyover", {"pixel_error": 2.0}, out=tmp_path / "run", accuracy_frames=2, **flight)
    frames = run.frames[run.frames["accuracy"]]
    assert (frames["measured_px_max"] <= 2.0 + 0.05).all() and (frames["crack_edges"] == 0).all()
    assert frames["psnr_db"].isna().all()
    audit = lod.instrument.audit(store, progress=False)
    assert audit.nodes["holds"].all() and len(audit.nodes) > 0
    view = lod.CameraPath.flyover(windowed, frames=2).view(0, size=(96, 64))
    session = store.session()
    measured = _core.Instrument(windowed.core).examine(session.core, session.select(view, {"nodes": 50}).core, view)
    with pytest.raises(Unsupported, match="257 x 257 samples are read by windows"):
        measured.error_px()


def test_methods_that_need_the_source_in_memory_load_it(small, tmp_path):
    held, windowed = small("fractal:size=129")
    stores = [lod.build(f, "chunked", tmp_path / f"{f.windowed}.lod", progress=False) for f in (held, windowed)]
    assert stores[0].info()["content_hash"] == stores[1].info()["content_hash"]
    with pytest.raises(Unsupported, match="needs the source in memory"):
        _core.build(windowed.core, "full", tmp_path / "f.lod")


@pytest.mark.parametrize("spec", ["fractal:size=257", SPECS[2]])
def test_figures_by_bands_are_those_of_the_whole(tmp_path, spec):
    field = datasets.load(spec)
    session = _core.build(field.core, "multigrain", tmp_path / "a.lod").session({})
    instruments = [_core.Instrument(given) for given in (field.core, native(field, 20 * field.shape[1]))]
    views = [CameraPath.flyover(field, frames=3).view(f, size=(96, 64)) for f in range(3)]
    before = session.select(views[0], _core.Budget(pixel_error=30.0))
    cut = session.select(views[2], _core.Budget(pixel_error=4.0))
    whole, banded = (measure(i, session, cut, views[2], before=before) for i in instruments)
    assert whole["measured_px_max"] > 0 and whole["pop_px_max"] > 0
    for metric in METRICS:  # bands lie in frames of their own: rounding
        assert banded[metric.name] == pytest.approx(whole[metric.name], rel=1e-6, abs=1e-6, nan_ok=True), metric.name
    errors = [i.examine(session, cut, views[2], pictures=False).node_errors() for i in instruments]
    assert np.allclose(*(np.column_stack(found) for found in errors), rtol=1e-6)
    nodes = [i.examine(session, cut, views[2]).node_errors() for i in instruments]
    assert np.array_equal(nodes[0][0], nodes[1][0])
    assert np.allclose(nodes[0][1], nodes[1][1], rtol=1e-6, atol=1e-6)
    with pytest.raises(Unsupported, match="read by windows"):
        instruments[1].examine(session, cut, views[2]).error_px()


def test_the_limit_is_a_number(monkeypatch):
    monkeypatch.setenv("LODLAB_WINDOW_SAMPLES", "many")
    with pytest.raises(InvalidInput, match="many"):
        datasets.load("fractal:size=33")
