# SPDX-License-Identifier: MIT
"""discrete: levels that are made and brought, of meshes and of terrain; bounds that are measured; the best choice."""

from __future__ import annotations

import itertools
import json
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import lodlab as lod
from lodlab import _core
from lodlab.instrument.audit import audit
from lodlab.stability import trials


def _build(source: object, folder: Path, **options: object) -> lod.Store:
    return lod.build(source, "discrete", folder / "discrete.lod", mode="force", progress=False, **options)


def _spheres(gap: float = 3.0) -> lod.Mesh:
    """Two components of 1,280 triangles and one of 20."""
    big, small = lod.datasets.load("icosphere:level=3"), lod.datasets.load("icosphere:level=0")
    parts = [(big.positions, big.faces), (big.positions + gap, big.faces), (small.positions - gap, small.faces)]
    offsets = np.cumsum([0] + [len(p) for p, _ in parts[:-1]])
    return lod.Mesh(
        np.vstack([p for p, _ in parts]), np.vstack([f + o for (_, f), o in zip(parts, offsets, strict=True)])
    )


@pytest.mark.parametrize(
    "spec", ["icosphere:level=4", "torus:rings=64,sides=32", "blob:size=24", "earth-globe:size=24,vertical_scale=20"]
)
def test_every_level_keeps_a_bound_that_is_tight(spec: str, tmp_path: Path) -> None:
    mesh = lod.datasets.load(spec)
    store = _build(mesh, tmp_path)
    nodes = store.nodes
    assert nodes["triangles"][-1] == len(mesh.faces) and nodes["error"][-1] < 1e-12 * mesh.extent
    assert (np.diff(nodes["error"]) <= 0).all() and (np.diff(nodes["triangles"]) > 0).all()
    assert 256 <= nodes["triangles"][0] < 600
    found = audit(store, progress=False)
    assert len(found.broken) == 0 and found.tightness < 1.01


def test_bounds_of_an_open_mesh_are_small_where_its_border_stays(tmp_path: Path) -> None:
    ball = lod.datasets.load("icosphere:level=4")
    bowl = lod.Mesh(ball.positions, ball.faces[ball.positions[ball.faces].mean(axis=1)[:, 2] < 0.3])
    store = _build(bowl, tmp_path)
    assert bowl.census["boundary_edges"] > 0 and (store.nodes["error"] < 0.05 * bowl.extent).all()
    assert len(audit(store, progress=False).broken) == 0


def test_where_a_scan_is_pinched_no_fin_is_left(tmp_path: Path, shared_data: Callable[[str], Path]) -> None:
    """Two triangles back to back: the edge at their root has four, which is a border far from the scan's own."""
    store = _build(str(shared_data("mesh/bunny_stanford_holes.ply")), tmp_path)
    assert (store.nodes["error"] < 0.05 * store.source.extent).all()
    for level in store.nodes["id"][:-1]:
        made = lod.Mesh(store.cut([int(level)]).to_trimesh(lod.View((0, 0, 1), (0, 0.1, 0))))
        assert (made.census["nonmanifold_edges"], made.census["duplicate_triangles"]) == (0, 0)


def test_components_have_chains_of_their_own_and_small_ones_share_one(tmp_path: Path) -> None:
    mesh = _spheres()
    store = _build(mesh, tmp_path)
    roots = store.nodes[store.nodes["parent"] == -1]
    assert len(roots) == 3 and sorted(roots["triangles"]) == [20, *sorted(roots["triangles"])[1:]]
    near = lod.View([3.0, 3.0 - 2.5, 3.0], [3.0, 3.0, 3.0], size=(320, 240))
    cut = store.select(near, {"pixel_error": 2.0})
    levels = store.nodes[cut.nodes["node"]]["level"] if "node" in cut.nodes.dtype.names else None
    assert levels is None or len(levels) == 3
    hidden = lod.View([3.0, 3.0 - 2.5, 3.0], [3.0, 3.0 - 5.0, 3.0], size=(320, 240))  # looks away from all
    assert store.select(hidden, {"pixel_error": 2.0}).triangles == 0
    assert len(audit(store, cuts=4, progress=False).broken) == 0


def test_a_triangle_budget_is_spent_as_well_as_levels_allow(tmp_path: Path) -> None:
    store = _build(_spheres(), tmp_path)
    nodes, view = store.nodes, lod.View([3.0, -4.0, 5.0], [1.0, 1.0, 1.0], size=(640, 480))
    session = store.session(projection="paper")
    gap = np.maximum(np.maximum(nodes["box_min"] - view.eye, view.eye - nodes["box_max"]), 0.0)
    px = nodes["error"] * 320.0 / np.tan(np.radians(30.0)) / np.linalg.norm(gap, axis=1)
    chains = np.split(np.arange(len(nodes)), np.flatnonzero(nodes["parent"] == -1)[1:])
    cuts = [[int(i) for i in ids] for ids in itertools.product(*chains)]  # all that there are
    for most in (700, 1500, 3000):
        cut = session.select(view, {"triangles": most})
        within = [ids for ids in cuts if nodes["triangles"][ids].sum() <= most]
        assert cut.triangles <= most
        assert cut.predicted_px == pytest.approx(min(px[ids].max() for ids in within), rel=1e-9)


def test_levels_that_are_brought_are_measured(tmp_path: Path) -> None:
    """Icospheres inscribed in the sphere that a finer one nearly is: the sagitta of their faces."""
    sphere = lod.datasets.load("icosphere:level=5")
    levels = [lod.datasets.load(f"icosphere:level={k}") for k in (3, 1, 2)]
    store = _build(sphere, tmp_path, levels=levels)
    assert store.nodes["triangles"].tolist() == [80, 320, 1280]
    for row, mesh in zip(store.nodes, (levels[1], levels[2], levels[0]), strict=True):
        middle = np.linalg.norm(mesh.positions[mesh.faces].mean(axis=1), axis=1).min()
        assert row["error"] == pytest.approx(1.0 - middle, abs=3e-4)  # less the finer one's own
    assert store.options["levels"] == "icosphere:level=3;icosphere:level=1;icosphere:level=2"
    assert len(audit(store, progress=False).broken) == 0
    same = _build("icosphere:level=5", tmp_path, levels="icosphere:level=1;icosphere:level=2;icosphere:level=3")
    assert same.info()["content_hash"] == store.info()["content_hash"]
    by_arrays = _build(sphere, tmp_path, levels=[(levels[1].positions, levels[1].faces)])
    assert by_arrays.nodes["triangles"].tolist() == [80] and by_arrays.options["levels"].startswith("mesh:")


def test_files_that_are_brought_are_told_apart_by_their_bytes(tmp_path: Path) -> None:
    file = tmp_path / "level.obj"
    for level in (1, 2):
        mesh = lod.datasets.load(f"icosphere:level={level}")
        lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in mesh.positions.tolist()]
        lines += [f"f {a} {b} {c}" for a, b, c in (mesh.faces + 1).tolist()]
        file.write_text("\n".join(lines))
        table = lod.compare(
            "icosphere:level=3", methods=["discrete"], options={"discrete": {"levels": str(file)}}, frames=2,
            pixel_errors=[1.0], size=(64, 48), out=tmp_path / f"run{level}", stores=tmp_path, progress=False,
        )  # fmt: skip
        drawn = table.frames[table.frames["method"] == "discrete"]["drawn_triangles"]
        assert set(drawn) == {20 * 4**level}


def test_a_gltf_brings_its_levels(tmp_path: Path) -> None:
    levels = [lod.datasets.load(f"icosphere:level={k}") for k in (2, 1, 0)]
    buffer, views, accessors, meshes, nodes = b"", [], [], [], []
    for k, mesh in enumerate(levels):
        for data, code, shape in (
            (mesh.positions.astype("<f4"), 5126, "VEC3"),
            (mesh.faces.astype("<u4"), 5125, "SCALAR"),
        ):
            views.append({"buffer": 0, "byteOffset": len(buffer), "byteLength": data.nbytes})
            count = len(data) if shape == "VEC3" else data.size
            accessors.append({"bufferView": len(views) - 1, "componentType": code, "count": count, "type": shape})
            buffer += data.tobytes()
        meshes.append({"primitives": [{"attributes": {"POSITION": 2 * k}, "indices": 2 * k + 1}]})
        nodes.append({"mesh": k})
    nodes[0]["extensions"] = {"MSFT_lod": {"ids": [1, 2]}}
    document = {
        "asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": nodes, "meshes": meshes,
        "accessors": accessors, "bufferViews": views, "buffers": [{"byteLength": len(buffer)}],
    }  # fmt: skip
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    file = tmp_path / "levels.glb"
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(buffer), 0x004E4942) + buffer
    file.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)
    store = _build(file, tmp_path, levels=file)
    assert store.nodes["triangles"].tolist() == [20, 80, 320]


def test_terrain_is_covered_upright_and_bounded(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    heights = rng.normal(0.0, 40.0, (70, 93)).cumsum(axis=0).cumsum(axis=1) / 9.0
    heights[20:30, 30:50] = np.nan
    field = lod.HeightField(heights, spacing=(10.0, 7.0))
    store = _build(field, tmp_path)
    assert len(store.nodes) > 3
    view = lod.View([400.0, -800.0, 900.0], [450.0, -250.0, 0.0], size=(160, 120))
    x0, y0 = field.origin
    for node in store.nodes["id"]:
        captured = store.capture(store.cut([int(node)]), view)
        corners = captured.triangles[..., :2]
        a, b, c = np.moveaxis(np.rint((corners - [x0, y0]) / [10.0, 7.0]), 1, 0)
        area = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
        assert (area > 0).all() and area.sum() == 2 * 69 * 92  # upright, and no place twice
    assert len(audit(store, progress=False).broken) == 0


STEPS = {
    "rows": 129,
    "cols": 91,
    "shape": "cliff",
    "seed": 1,
    "height": 0.017772379289860876,
    "base": -400.0,
    "voids": None,
}
NOISE = {"rows": 53, "cols": 48, "shape": "noise", "seed": 434666821, "height": 1.0, "base": 0.0, "voids": "islands"}


@pytest.mark.parametrize("recipe", [STEPS, NOISE])
def test_where_sheets_touch_and_where_a_corner_is_void_terrain_has_no_crack(recipe: dict, tmp_path: Path) -> None:
    field = trials.make_source(recipe | {"spacing": [100.0, 100.0], "origin": [0.0, 0.0]})
    store = _build(field, tmp_path)
    session, instrument = store.default_session.core, _core.Instrument(field.core, None)
    view = lod.View([0.0, -900.0, 9000.0], [500.0, -1000.0, 0.0], size=(64, 64))
    for cut in session.audit_cuts():
        found = instrument.examine(session, cut, view, pictures=False)
        assert (found.crack_edges, found.hole_samples, found.inverted_triangles) == (0, 0, 0)


def test_a_cliff_far_from_the_origin_keeps_its_bound(tmp_path: Path) -> None:
    """What two floats leave of 6.4e6 m is 11 nm: times a slope of 190,000 it is 2 mm."""
    recipe = STEPS | {"rows": 32, "cols": 20, "height": 1.0, "base": 0.0}
    field = trials.make_source(recipe | {"spacing": [0.048, 0.0048], "origin": [-7e5, 6.4e6]})
    assert len(audit(_build(field, tmp_path), progress=False).broken) == 0


def test_levels_go_all_the_way_down_on_large_terrain(tmp_path: Path) -> None:
    store = _build(lod.datasets.load("fractal:size=1025,seed=9"), tmp_path)
    counts = np.sort(store.nodes["triangles"])
    assert counts[0] < 600 and (counts[1:] < 2.1 * counts[:-1]).all()


def test_a_tin_flies_over_terrain_and_one_that_leaves_a_sample_out_is_refused(tmp_path: Path) -> None:
    heights = np.arange(30.0).reshape(5, 6)
    heights[2, 2] += 4.0
    field = lod.HeightField(heights, spacing=2.0)
    corners = np.array([[0, 0, 0], [10, 0, 5], [0, -8, 24], [10, -8, 29]], float)
    store = _build(field, tmp_path, levels=[(corners, np.array([[0, 2, 1], [1, 2, 3]]))])
    assert store.nodes["error"].tolist() == pytest.approx([4.0])
    short = corners * [0.9, 1.0, 1.0]
    with pytest.raises(
        lod.errors.InvalidInput, match=r"leaves 5 samples uncovered \(limit: 0\), the first at row 0, column 5"
    ):
        _build(field, tmp_path, levels=[(short, np.array([[0, 2, 1], [1, 2, 3]]))])


def test_what_cannot_be(tmp_path: Path) -> None:
    mesh = lod.datasets.load("icosphere:level=2")
    for levels, message in (
        ("jacksboro", "jacksboro is a heightfield; it takes meshes"),
        ("no-such.ply", "no-such.ply"),
        ("mesh:0123", "mesh:0123"),
        ([], "no mesh is named"),
    ):
        with pytest.raises(lod.errors.InvalidInput, match=message):
            _build(mesh, tmp_path, levels=levels)
    with pytest.raises(lod.errors.Unsupported, match="does not accept a planet"):
        _build("earth:planet=true", tmp_path)
    store = _build(_spheres(), tmp_path)
    for ids, message in (([0], "gap"), ([0, 1], "overlap"), ([0, 0], "twice"), ([10**6], "not within")):
        with pytest.raises(lod.errors.InvalidInput, match=message):
            store.cut(ids)
    with pytest.raises(lod.errors.Unsupported, match="z for up"):
        store.session(projection="vertical")


def test_finest_error_leaves_out_what_is_finer(tmp_path: Path) -> None:
    mesh = lod.datasets.load("blob:size=24")
    all_levels = _build(mesh, tmp_path).nodes
    wanted = float(all_levels["error"][-3])
    kept = _build(mesh, tmp_path, finest_error=wanted).nodes
    assert kept["error"].tolist() == all_levels["error"][:-2].tolist()
