# SPDX-License-Identifier: MIT
"""chunked against the contract of all methods, and what is its own: morphs, skirts, streaming, colours."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import lodlab as lod
from lodlab import _core
from lodlab.instrument import measure
from tests.contract import FIELDS, MethodContract, over


class TestChunked(MethodContract):
    method = "chunked"
    build_options = {"leaf": 16, "chunk_triangles": 128}


@pytest.fixture(scope="module")
def terrain() -> lod.HeightField:
    return lod.datasets.load("jacksboro")


@pytest.fixture(scope="module")
def store(terrain: lod.HeightField, tmp_path_factory: pytest.TempPathFactory) -> lod.Store:
    return lod.build(terrain, "chunked", tmp_path_factory.mktemp("chunked") / "jacksboro.lod", progress=False)


@pytest.fixture(scope="module")
def instrument(terrain: lod.HeightField, tmp_path_factory: pytest.TempPathFactory) -> _core.Instrument:
    full = lod.build(terrain, "full", tmp_path_factory.mktemp("full") / "full.lod", progress=False)
    instrument = _core.Instrument(terrain.core, full.core.session({}))
    return instrument


def flyover_views(terrain: lod.HeightField, count: int = 6, size: tuple[int, int] = (640, 360)) -> list[_core.View]:
    path = lod.CameraPath.flyover(terrain, frames=count)
    return [path.view(f, size=size) for f in range(count)]


def largest_jump(store, terrain, instrument, **options: object) -> tuple[float, float]:
    """Screen jump in pixels and the quantum's own size in pixels, over splits along the flyover.

    The budget is set a hair above and below the projected error of a chunk that is about to split.
    """
    session = store.core.session({"stream": False, **options})
    worst, quantum_px = 0.0, 0.0
    nodes = store.nodes
    for view in flyover_views(terrain):
        cut = session.select(view, _core.Budget(pixel_error=2.0))
        split = splitting_budget(session, view, cut, 2.0)
        if split is None:
            continue
        above, below = split
        assert len(above.nodes) != len(below.nodes)
        worst = max(worst, instrument.examine(session, below, view, before=above).pop_px_max)
        nearest = min(distance(nodes[n], view.eye) for n in above.nodes["node"][above.nodes["visible"]])
        quantum_px = max(
            quantum_px, store.info()["quantum"] * 640 / 2 / np.tan(np.radians(30)) / max(nearest, view.near)
        )
    return worst, quantum_px


def distance(node: np.void, eye) -> float:
    gap = np.maximum(np.maximum(node["box_min"] - eye, np.asarray(eye) - node["box_max"]), 0.0)
    return float(np.linalg.norm(gap))


def splitting_budget(session, view, cut, start: float):
    """Two cuts whose budgets lie a millionth apart, between which a chunk splits."""
    high, low = start, start
    nodes = len(cut.nodes)
    for _ in range(60):
        low *= 0.93
        if len(session.select(view, _core.Budget(pixel_error=low)).nodes) != nodes:
            break
        high = low
    else:
        return None
    while high / low > 1 + 1e-7:
        middle = 0.5 * (high + low)
        if len(session.select(view, _core.Budget(pixel_error=middle)).nodes) == nodes:
            high = middle
        else:
            low = middle
    return (session.select(view, _core.Budget(pixel_error=high)), session.select(view, _core.Budget(pixel_error=low)))


def test_a_split_moves_nothing(store, terrain, instrument) -> None:
    jump, quantum_px = largest_jump(store, terrain, instrument)
    assert jump <= 0.05 + quantum_px


def test_without_morph_a_split_pops(store, terrain, instrument) -> None:
    assert largest_jump(store, terrain, instrument, morph="false")[0] > 0.3


def test_half_morphed_formula4_breaks_the_budget_openly(store, terrain) -> None:
    session = store.core.session({"stream": False, "morph": "formula4"})
    cuts = [session.select(view, _core.Budget(pixel_error=1.0)) for view in flyover_views(terrain)]
    assert not any(cut.promises_bound for cut in cuts)
    assert max(cut.predicted_px for cut in cuts) > 1.0


@pytest.mark.parametrize("projection", ["strict", "vertical", "paper"])
def test_projections(store, terrain, instrument, projection: str) -> None:
    session = store.core.session({"stream": False, "projection": projection})
    triangles = []
    for view in flyover_views(terrain):
        cut = session.select(view, _core.Budget(pixel_error=2.0))
        triangles.append(cut.triangles)
        assert cut.promises_bound == (projection != "paper")
        if cut.promises_bound:
            row = measure(instrument, session, cut, view, None, pictures=False)
            assert row["measured_px_max"] <= cut.predicted_px + 0.01
    strict = store.core.session({"stream": False})
    full = [strict.select(view, _core.Budget(pixel_error=2.0)).triangles for view in flyover_views(terrain)]
    assert sum(triangles) <= sum(full)


def test_skirts_hide_cracks_that_are_really_there(store, terrain, instrument) -> None:
    seen = {"skirt": 0, "none": 0}
    for cracks in seen:
        session = store.core.session({"stream": False, "cracks": cracks})
        for view in flyover_views(terrain, count=8):
            cut = session.select(view, _core.Budget(pixel_error=8.0))
            seen[cracks] += measure(instrument, session, cut, view, instrument.reference(view))["crack_pixels"]
            assert (cut.filler_triangles > 0) == (cracks == "skirt" and len(cut.nodes) > 1)
    assert seen["skirt"] == 0
    assert seen["none"] > 0


def test_skirts_are_no_dark_dots(store, terrain) -> None:
    view = lod.CameraPath.flyover(terrain, frames=120).view(65, size=(1280, 720))
    pictures = []
    for cracks in ("skirt", "none"):
        session = store.core.session({"stream": False, "cracks": cracks})
        pictures.append(
            session.draw(session.select(view, _core.Budget(pixel_error=1.0)), view).image[..., :3].astype(float)
        )
    filled = np.abs(pictures[0] - pictures[1]).max(axis=2) > 0
    assert filled.sum() > 20
    # Lit like level ground: on the average of the terrain, not a third of it as a wall in the shade.
    assert pictures[0][filled].mean() > 0.75 * pictures[0].mean()


@pytest.mark.parametrize("spec", ["earth", "fractal:size=1025"])
def test_triangles_fall_with_the_budget(spec: str, tmp_path: Path) -> None:
    field = lod.datasets.load(spec)
    session = lod.build(field, "chunked", tmp_path / "s.lod", progress=False).core.session({"stream": False})
    views = flyover_views(field, size=(1280, 720))
    counts = [sum(session.select(v, _core.Budget(pixel_error=p)).triangles for v in views) for p in (0.5, 1, 2, 4, 8)]
    assert counts == sorted(counts, reverse=True)
    assert len(set(counts)) == 5


def test_streaming_settles_on_the_cut_of_loaded_data(store, terrain) -> None:
    view = flyover_views(terrain)[2]
    budget = _core.Budget(pixel_error=1.0)
    wanted = store.core.session({"stream": False}).select(view, budget).nodes["node"]
    session = store.core.session({"stream": True, "cpu_cache_mb": 64, "gpu_cache_mb": 64})
    first, row = session.time_frame(view, budget)
    assert row["page_misses"] > 0 and first.missing_nodes > 0
    assert first.predicted_px > 1.0 and not first.budget_met
    for _ in range(200):
        session.settle()
        cut, row = session.time_frame(view, budget)
        if cut.missing_nodes == 0:
            break
    assert np.array_equal(cut.nodes["node"], wanted)
    assert row["resident_bytes"] <= 65 << 20


def test_slow_storage_never_delays_a_frame_nor_opens_a_crack(store, terrain, instrument) -> None:
    session = store.core.session({"stream": True, "fetch_delay_ms": 200})
    for view in flyover_views(terrain, count=4):
        cut, row = session.time_frame(view, _core.Budget(pixel_error=1.0, triangles=40_000))
        assert row["triangles"] <= 40_000
        assert cut.missing_nodes > 0, "a frame that waits for storage misses nothing"
        assert measure(instrument, session, cut, view, instrument.reference(view))["crack_pixels"] == 0


def test_small_gpu_cache_is_a_hard_limit(terrain, tmp_path: Path) -> None:
    field = lod.HeightField(_core.fractal(1025, 1025, 0, 0, seed=1, roughness=0.5))
    store = lod.build(field, "chunked", tmp_path / "f.lod", progress=False)
    with pytest.raises(lod.errors.InvalidInput, match="gpu_cache_mb of at least"):
        store.core.session({"stream": False, "gpu_cache_mb": 1})
    session = store.core.session({"stream": True, "gpu_cache_mb": 4, "cpu_cache_mb": 4})
    for view in flyover_views(field, count=5):
        for _ in range(12):
            session.settle()
            _, row = session.time_frame(view, _core.Budget(pixel_error=0.5))
            assert row["resident_bytes"] <= 4 << 20


def refused_for(store: lod.Store, option: str, **options: object) -> int:
    """The least that the refusal of a session names."""
    with pytest.raises(lod.errors.InvalidInput, match=rf"chunked: .* {option} of at least \d+, not 1$") as refusal:
        store.core.session({option: 1, **options})
    return int(str(refusal.value).split("at least ")[1].split(",")[0])


def drawn_bytes(store: lod.Store, view: _core.View, **options: object) -> tuple[int, float]:
    """What is resident at most until nothing is missing, and what the last frame predicts, pixels."""
    session, most = store.core.session(options), 0
    for _ in range(60):
        cut, row = session.time_frame(view, _core.Budget(pixel_error=1.0))
        most = max(most, row["resident_bytes"])
        if cut.missing_nodes == 0:
            return most, cut.predicted_px
        session.settle()
    raise AssertionError(f"{cut.missing_nodes} nodes are missing for ever")


@pytest.fixture(scope="module")
def large_chunks(tmp_path_factory: pytest.TempPathFactory) -> lod.Store:
    """A chunk alone takes more than a MiB, with voids and colours beside."""
    folder = tmp_path_factory.mktemp("large")
    heights = np.random.default_rng(0).normal(size=(320, 320)) * 30.0
    heights[:40, :40] = np.nan
    image = np.random.default_rng(1).integers(0, 256, (320, 320, 4)).astype(np.uint8)
    _core.write_image(str(folder / "a.png"), image)
    field = lod.HeightField(heights)
    options = {"leaf": 256, "chunk_triangles": 65536, "attribute": str(folder / "a.png"), "progress": False}
    return lod.build(field, "chunked", folder / "c.lod", **options)


def test_a_small_main_memory_is_refused_by_name_before_any_frame(large_chunks) -> None:
    least = refused_for(large_chunks, "cpu_cache_mb", stream=True)
    assert refused_for(large_chunks, "cpu_cache_mb", stream=False) <= least
    view = _core.View((100.0, -100.0, 150.0), (160.0, -160.0, 0.0), size=(64, 48))
    _, predicted = drawn_bytes(large_chunks, view, stream=True, cpu_cache_mb=least)
    assert predicted <= 1.0


def test_every_byte_counts_into_the_gpu_cache(large_chunks) -> None:
    view = _core.View((100.0, -100.0, 150.0), (160.0, -160.0, 0.0), size=(64, 48))
    for stream in (True, False):
        least = refused_for(large_chunks, "gpu_cache_mb", stream=stream)
        most, _ = drawn_bytes(large_chunks, view, stream=stream, gpu_cache_mb=least)
        assert 0 < most <= least << 20


def test_textured_frames_are_charged_for_instances_alone(large_chunks) -> None:
    session = large_chunks.core.session({"stream": False})
    view = _core.View((100.0, -100.0, 150.0), (160.0, -160.0, 0.0), size=(64, 48))
    session.time_frame(view, _core.Budget(pixel_error=1.0))
    _, row = session.time_frame(view, _core.Budget(pixel_error=1.0))
    assert row["draw_calls"] == row["nodes"] > 0
    assert row["upload_bytes"] == 24 * row["nodes"]


def test_a_cut_of_more_chunks_than_one_draw_has_room_for_is_drawn_in_rounds(tmp_path: Path) -> None:
    field = lod.HeightField(_core.fractal(513, 513, 0, 0, seed=1, roughness=0.5))
    store = lod.build(field, "chunked", tmp_path / "f.lod", progress=False, leaf=16)
    view = over(field)
    whole = store.core.session({"stream": False})
    cut = whole.select(view, _core.Budget(pixel_error=1e-6))
    wanted = whole.draw(cut, view, everything=True).image
    small = store.core.session({"stream": True, "gpu_cache_mb": 1})
    assert np.array_equal(small.draw(cut, view, everything=True).image, wanted)
    assert len(cut.nodes) > 64 and 0 < small.resident_bytes <= 1 << 20


def test_colours_follow_the_texel_rule(tmp_path: Path) -> None:
    rows, cols = 120, 150
    image = np.zeros((rows, cols, 4), np.uint8)
    image[..., 0] = np.linspace(0, 255, cols).astype(np.uint8)[None, :]
    image[..., 1] = np.linspace(0, 255, rows).astype(np.uint8)[:, None]
    image[..., 3] = 255
    _core.write_image(str(tmp_path / "colour.png"), image)
    field = lod.HeightField(_core.fractal(rows, cols, 0, 0, seed=4, roughness=0.5))
    attribute = str(tmp_path / "colour.png")
    store = lod.build(field, "chunked", tmp_path / "c.lod", progress=False, attribute=attribute, leaf=16)
    full = lod.build(field, "full", tmp_path / "full.lod", progress=False, attribute=attribute)
    view = over(field, height=0.5, size=(320, 200))
    session, reference = store.core.session({"stream": False}), full.core.session({})
    cut = session.select(view, _core.Budget(pixel_error=0.5))
    ours = session.draw(cut, view).image.astype(int)
    wanted = reference.draw(reference.select(view, _core.Budget(pixel_error=1.0)), view).image.astype(int)
    # Half a pixel of error moves edges of the hillshade; colours themselves must be the same raster.
    assert np.abs(ours - wanted).mean() < 3.0


def test_fields_of_any_shape_build(tmp_path: Path) -> None:
    for name, make in FIELDS.items():
        store = lod.build(lod.HeightField(make()), "chunked", tmp_path / f"{name}.lod", progress=False)
        assert store.info()["levels"][-1]["error_max"] <= store.info()["quantum"]


def test_leaf_must_be_a_power_of_two(tmp_path: Path) -> None:
    with pytest.raises(lod.errors.InvalidInput, match="leaf = 48"):
        lod.build(lod.HeightField(np.zeros((9, 9))), "chunked", tmp_path / "x.lod", progress=False, leaf=48)


def test_planets_are_refused(tmp_path: Path) -> None:
    planet = lod.HeightField(np.zeros((19, 36)), planet=True)
    with pytest.raises(lod.errors.Unsupported, match="planet"):
        lod.build(planet, "chunked", tmp_path / "p.lod", progress=False)


def test_bounds_hold_half_morphed_on_a_high_plateau(tmp_path: Path) -> None:
    """Heights near 9 km in quanta of 4 mm: floats round what lies between two of them by a quarter of a quantum."""
    heights = 8848.0 + 0.04 * _core.fractal(129, 128, 11, 7, seed=3, roughness=0.5).astype(float)
    field = lod.HeightField(heights, spacing=(1.0, 0.1))
    store = lod.build(field, "chunked", tmp_path / "s.lod", progress=False, leaf=4, chunk_triangles=32768)
    session, instrument = store.core.session({"stream": False}), _core.Instrument(field.core, None)
    eye = field.core.position([99], [115])[0] + [0.0, 0.0, 0.0024]
    morphed = 0
    for pixel_error in (0.01, 0.026, 0.1):
        view = _core.View(tuple(eye), tuple(eye - [0.0, 0.0, 0.0024]), fov=170.0, size=(96, 64))
        cut = session.select(view, _core.Budget(pixel_error=pixel_error))
        nodes, errors = instrument.examine(session, cut, view, pictures=False).node_errors()
        bounds = dict(zip(cut.nodes["node"], cut.nodes["error"], strict=True))
        morphed += ((cut.nodes["morph"] > 0) & (cut.nodes["morph"] < 1)).sum()
        assert all(e <= bounds[n] + instrument.slack(view) for n, e in zip(nodes, errors, strict=True))
    assert morphed > 0
