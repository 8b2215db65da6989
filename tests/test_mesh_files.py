# SPDX-License-Identifier: MIT
"""OBJ, STL, glTF and GLB; all formats against trimesh and plyfile; hundreds of damaged files."""

from __future__ import annotations

import base64
import gzip
import io
import json
import struct

import numpy as np
import pytest
import trimesh

from lodlab import Mesh, datasets
from lodlab.errors import InvalidInput
from lodlab.sources import gltf
from lodlab.sources.mesh_files import FORMATS


def save(path, data: str | bytes):
    path.write_bytes(data.encode() if isinstance(data, str) else data)
    return path


# ---- OBJ --------------------------------------------------------------------------------------------

OBJ = """# a square
o square
v 0 0 0
v 1 0 0 # behind
v 1 1 \\
 0
v 0 1 0
vt 0 0
vn 0 0 1
f 1/1/1 2/1/1 3/1/1 4/1/1
l 1 2
"""


def test_obj_has_comments_continued_lines_polygons_and_normals(tmp_path):
    mesh = Mesh.open(save(tmp_path / "a.obj", OBJ))
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3]] and mesh.positions[2].tolist() == [1, 1, 0]
    assert mesh.normals.tolist() == [[0, 0, 1]] * 4
    assert mesh.used == {"polygons": "1 faces of more than three corners, as 2 triangles"}


def test_obj_counts_backwards_from_where_the_face_stands(tmp_path):
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 1 1 0\nf -3 -1 -2\nf 1 -1 3\n"
    assert Mesh.open(save(tmp_path / "a.obj", text)).faces.tolist() == [[0, 1, 2], [1, 3, 2], [0, 3, 2]]


def test_obj_colours_and_normals_that_differ_at_a_vertex(tmp_path):
    text = "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 0.5\nvn 0 0 1\nvn 0 1 0\nf 1//1 2//1 3//1\nf 3//2 2//1 1//1\n"
    mesh = Mesh.open(save(tmp_path / "a.obj", text))
    assert mesh.colors.tolist() == [[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 128, 255]]
    assert mesh.normals is None and "normals" in mesh.used["ignored"]


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (("f 1/1/1 2/1/1 3/1/1 4/1/1", ""), "no triangles"),
        (("4/1/1", "5/1/1"), "face 0 names v 5 of 4"),
        (("4/1/1", "0/1/1"), "face 0 names v 0 of 4"),
        (("4/1/1", "-5/1/1"), "face 0 names v -5 of 4"),
        (("4/1/1", "4/1/9"), "face 0 names vn 9 of 1"),
        (("4/1/1", "4x/1/1"), "no number"),
        (("4/1/1", "4-1/1/1"), "no number"),
        (("v 0 1 0", "v 0 1"), "vertex 3 has fewer numbers than 3"),
        (("v 0 1 0", "v 0 nan 0"), "vertex 3 .* not finite"),
        (("v 0 1 0", "v"), "names v 4 of 3"),
    ],
)
def test_a_damaged_obj_says_why(tmp_path, change, reason):
    with pytest.raises(InvalidInput, match=rf"open .*a\.obj: .*{reason}"):
        Mesh.open(save(tmp_path / "a.obj", OBJ.replace(*change)))


# ---- STL --------------------------------------------------------------------------------------------


def stl(kind: str) -> bytes:
    box = trimesh.creation.icosphere(1)
    return (
        trimesh.exchange.stl.export_stl(box)
        if kind == "binary"
        else trimesh.exchange.stl.export_stl_ascii(box).encode()
    )


@pytest.mark.parametrize("kind", ["binary", "text", "shouted", "binary that says solid"])
def test_stl_corners_at_equal_places_are_one_vertex(tmp_path, kind):
    data = stl("binary" if "binary" in kind else "text")
    data = data.upper() if kind == "shouted" else b"solid" + data[5:] if "solid" in kind else data
    mesh = Mesh.open(save(tmp_path / "a.stl", data))
    assert mesh.samples == 42 and len(mesh.faces) == 80 and mesh.census["genus"] == 0
    assert mesh.used == {"merged": "240 corners into 42 vertices at equal places"}


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (stl("binary")[:-1], "claims 80 triangles and has the bytes of 79"),
        (stl("binary")[:80] + struct.pack("<I", 2**31), "claims 2147483648 triangles"),
        (stl("binary")[:50], "claims 0 triangles"),
        (stl("binary")[:80] + bytes(4), "no triangles"),
        (stl("binary")[:96] + struct.pack("<f", np.nan) + stl("binary")[100:], "triangle 0 has a corner at .*nan"),
        (stl("text")[:-20], "cut short"),
        (stl("text").replace(b"vertex", b"vertix", 1), "239 vertices, 717 numbers in 80 facets"),
        (b"solid a\nendsolid a\n", "no triangles"),
    ],
)
def test_a_damaged_stl_says_why(tmp_path, data, reason):
    with pytest.raises(InvalidInput, match=rf"open .*a\.stl: .*{reason}"):
        Mesh.open(save(tmp_path / "a.stl", data))


# ---- glTF -------------------------------------------------------------------------------------------


def square(**changes) -> dict:
    """A square of two triangles, four vertices with colours and normals, 16-bit indices."""
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], "<f4").tobytes()
    normals = np.array([[0, 0, 1]] * 4, "<f4").tobytes()
    colors = np.array([[255, 0, 0], [0, 255, 0], [0, 0, 255], [255, 255, 255]], "u1")
    data = points + normals + np.pad(colors, ((0, 0), (0, 1))).tobytes() + struct.pack("<6H", 0, 1, 2, 0, 2, 3)
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "NORMAL": 1, "COLOR_0": 2}, "indices": 3}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 0, "byteOffset": 48, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5121, "count": 4, "type": "VEC3", "normalized": True},
            {"bufferView": 2, "componentType": 5123, "count": 6, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": 96},
            {"buffer": 0, "byteOffset": 96, "byteLength": 16, "byteStride": 4},
            {"buffer": 0, "byteOffset": 112, "byteLength": 12},
        ],
        "buffers": [{"byteLength": 124, "uri": "data:a/b;base64," + base64.b64encode(data).decode()}],
    }
    return document | changes


def as_glb(document: dict) -> bytes:
    document = json.loads(json.dumps(document))
    data = base64.b64decode(document["buffers"][0].pop("uri").partition(",")[2])
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(data), 0x004E4942) + data
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def test_gltf_in_its_three_packings(tmp_path):
    document = square()
    inside = Mesh.open(save(tmp_path / "a.gltf", json.dumps(document)))
    assert inside.faces.tolist() == [[0, 1, 2], [0, 2, 3]] and inside.positions[2].tolist() == [1, 1, 0]
    assert inside.colors[1].tolist() == [0, 255, 0, 255] and inside.normals.tolist() == [[0, 0, 1]] * 4
    save(tmp_path / "b c.bin", base64.b64decode(document["buffers"][0]["uri"].partition(",")[2]))
    beside = square(buffers=[{"byteLength": 124, "uri": "b%20c.bin"}])
    for file in (save(tmp_path / "b.gltf", json.dumps(beside)), save(tmp_path / "c.glb", as_glb(document))):
        assert Mesh.open(file).hash() == inside.hash()


def test_gltf_transforms_are_applied_down_the_tree(tmp_path):
    half = float(np.sqrt(0.5))
    nodes = [
        {"children": [1, 2], "translation": [10, 0, 0]},
        {"mesh": 0, "rotation": [0, 0, half, half], "scale": [2, 1, 1]},
        {"mesh": 0, "matrix": [-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 5, 1]},
    ]
    mesh = Mesh.open(save(tmp_path / "a.gltf", json.dumps(square(nodes=nodes))))
    assert mesh.samples == 8 and len(mesh.faces) == 4
    turned = mesh.positions[np.isclose(mesh.positions[:, 2], 0)]
    assert np.allclose(turned[1], [10, 2, 0]) and np.allclose(turned[3], [9, 0, 0])
    corners = mesh.positions[mesh.faces]
    assert (np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2] > 0).all()  # mirrored: turned
    assert np.allclose(mesh.normals, [0, 0, 1])


def test_gltf_primitives_share_their_vertices_and_strips_and_fans_are_triangles(tmp_path):
    primitive = square()["meshes"][0]["primitives"][0]
    kinds = [{**primitive, "mode": mode} for mode in (4, 5, 6, 1)]
    mesh = Mesh.open(save(tmp_path / "a.gltf", json.dumps(square(meshes=[{"primitives": kinds}]))))
    assert mesh.samples == 4 and mesh.used == {"left_out": "1 primitives that are points or lines"}
    assert mesh.faces[:2].tolist() == [[0, 1, 2], [0, 2, 3]] and [0, 1, 2] in mesh.faces[2:].tolist()


def changed(path: str, value) -> dict:
    document = json.loads(json.dumps(square()))
    *way, last = path.split(".")
    at = document
    for step in way:
        at = at[int(step) if step.isdigit() else step]
    at[int(last) if last.isdigit() else last] = value
    return document


@pytest.mark.parametrize(
    ("document", "reason"),
    [
        (changed("buffers.0.uri", "none.bin"), "buffer 0 is missing: there is no file .*none.bin"),
        (changed("buffers.0.uri", "/dev/zero"), "buffer 0 is missing"),
        (changed("buffers.0", {"byteLength": 124}), "buffer 0 is missing"),
        (changed("buffers.0.byteLength", 10**12), "claims 1000000000000 bytes and has 124"),
        (changed("buffers.0.uri", "data:,!!!"), "damaged"),
        (changed("accessors.0.count", 10**12), "accessor 0 claims 1000000000000 elements"),
        (changed("accessors.0.count", -1), "accessor 0 has the number -1"),
        (changed("accessors.0.count", 1.5), "accessor 0 has the number 1.5"),
        (changed("accessors.0.componentType", 7), "damaged: KeyError"),
        (changed("accessors.0.type", "VEC2"), "VEC2"),
        (changed("accessors.0.bufferView", 9), "names item 9 of 3"),
        (changed("accessors.0.sparse", {}), "accessor 0 is sparse"),
        (changed("accessors.3.componentType", 5122), "no unsigned whole numbers"),
        (changed("accessors.3.byteOffset", 2), "accessor 3 claims 6 elements"),
        (changed("accessors.1.count", 3), "fewer normals"),
        (changed("accessors.0.count", 2), "names vertex 3 of 2|fewer normals"),
        (changed("bufferViews.0.byteOffset", 10**6), "to byte 1000096 of 124"),
        (changed("bufferViews.1.byteStride", 0), "every 0 bytes"),
        (changed("scenes.0.nodes", []), "no triangles"),
        (changed("scenes.0.nodes", [7]), "names item 7 of 1"),
        (changed("nodes.0.children", [0]), "node 0 is reached twice"),
        (changed("nodes.0.matrix", [1]), "damaged"),
        (changed("nodes.0.scale", [1, float("inf"), 1]), "not finite"),
        (changed("meshes.0.primitives.0.mode", 0), "no triangles"),
        (changed("meshes.0.primitives", 3), "damaged: TypeError"),
        (square(extensionsRequired=["KHR_draco_mesh_compression"]), "needs the extension KHR_draco"),
        ([], "damaged"),
        ({}, "no triangles"),
    ],
)
def test_a_damaged_gltf_says_why(tmp_path, document, reason):
    with pytest.raises(InvalidInput, match=rf"open .*a\.gltf: .*({reason})"):
        Mesh.open(save(tmp_path / "a.gltf", json.dumps(document)))


def test_a_gltf_that_places_a_mesh_a_million_times_is_refused_by_a_limit(tmp_path, monkeypatch):
    monkeypatch.setattr(gltf, "UNPACKED_ALWAYS", 10_000)
    nodes = [{"mesh": 0}] * 100
    file = save(tmp_path / "a.gltf", json.dumps(square(nodes=nodes, scenes=[{"nodes": list(range(len(nodes)))}])))
    with pytest.raises(InvalidInput, match="place more than 10000 bytes of vertices and indices, 64 times"):
        Mesh.open(file)


def test_a_damaged_glb_says_why(tmp_path):
    sound = as_glb(square())
    for data, reason in (
        (sound[:15], "cut short"),
        (sound[:-1], "bytes are there"),
        (sound[:4] + struct.pack("<I", 1) + sound[8:], "version 1"),
        (sound[:12] + struct.pack("<I", 10**9) + sound[16:], "a chunk claims 1000000000 bytes"),
        (sound[:16] + b"XXXX" + sound[20:], "no chunk of JSON"),
        (sound.replace(b'"nodes"', b'"n\xffdes"'), "damaged: UnicodeDecodeError"),
    ):
        with pytest.raises(InvalidInput, match=rf"open .*a\.glb: .*{reason}"):
            Mesh.open(save(tmp_path / "a.glb", data))


# ---- all formats ------------------------------------------------------------------------------------


def every_format(mesh: trimesh.Trimesh) -> dict[str, bytes]:
    """The mesh as trimesh writes it, and big-endian and with strips as plyfile does."""
    from plyfile import PlyData, PlyElement

    out = {
        "a.ply": mesh.export(file_type="ply"),
        "text.ply": mesh.export(file_type="ply", encoding="ascii"),
        "a.obj": mesh.export(file_type="obj").encode(),
        "a.stl": mesh.export(file_type="stl"),
        "text.stl": mesh.export(file_type="stl_ascii").encode(),
        "a.off": mesh.export(file_type="off").encode(),
        "a.glb": mesh.export(file_type="glb"),
        "a.gltf": json.dumps(square()).encode(),
    }
    vertices = np.array(
        [tuple(v) for v in mesh.vertices], [("x", "f4"), ("y", "f4"), ("z", "f4"), ("quality", "f8")][:3]
    )
    faces = np.empty(len(mesh.faces), [("vertex_indices", "O"), ("flags", "u1")])
    faces["vertex_indices"] = list(mesh.faces.astype("i4"))
    faces["flags"] = 1
    for name, order in (("big.ply", ">"), ("little.ply", "<")):
        written = io.BytesIO()
        PlyData([PlyElement.describe(vertices, "vertex"), PlyElement.describe(faces, "face")], byte_order=order).write(
            written
        )
        out[name] = written.getvalue()
    return out


@pytest.mark.parametrize("packed", [False, True])
def test_every_format_gives_what_trimesh_and_plyfile_wrote(tmp_path, packed):
    blob = datasets.load("blob:size=9,seed=3")
    files = every_format(trimesh.Trimesh(blob.positions, blob.faces, process=False))
    assert {"." + name.rpartition(".")[2] for name in files} == set(FORMATS)
    for name, data in files.items():
        file = save(tmp_path / (name + packed * ".gz"), gzip.compress(data) if packed else data)
        mesh = Mesh.open(file)
        if name == "a.gltf":
            continue  # a square of its own
        assert len(mesh.faces) == len(blob.faces) and mesh.census == blob.census
        assert np.abs(mesh.positions[mesh.faces] - blob.positions[blob.faces]).max() < 1e-7
        assert datasets.load(mesh.spec).hash() == mesh.hash()


def test_plyfile_reads_the_same_of_real_files(shared_data):
    from plyfile import PlyData

    for name in ("horse.ply", "bunny_stanford_holes.ply"):
        file = shared_data(f"mesh/{name}")
        mesh, other = Mesh.open(file), PlyData.read(file)
        assert np.array_equal(mesh.positions, np.stack([other["vertex"][k] for k in "xyz"], axis=1).astype(float))
        assert np.array_equal(mesh.faces, np.stack(list(other["face"]["vertex_indices"])))
        if mesh.colors is not None:
            assert np.array_equal(mesh.colors[:, 0], other["vertex"]["red"])


# ---- polygons ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "corners",
    [
        [(0, 0), (2, 0), (0.5, 0.5), (0, 2)],  # a dart, from each of its corners
        [(0, 0), (4, 0), (4, 4), (2, 1), (0, 4)],
        [(0, 0), (6, 0), (6, 3), (5, 3), (5, 1), (4, 1), (4, 3), (3, 3), (3, 1), (1, 1), (1, 3), (0, 3)],
        [(np.cos(a) * (2 + k % 2), np.sin(a) * (2 + k % 2)) for k, a in enumerate(np.arange(40) * np.pi / 20)],
    ],
)
@pytest.mark.parametrize("first", range(4))
def test_polygons_that_are_not_convex_keep_their_area(tmp_path, corners, first):
    points = np.roll(np.array([(x, y, 0.3 * x) for x, y in corners]), -first, axis=0)
    lines = "\n".join(" ".join(map(str, p)) for p in points.tolist())
    text = f"OFF\n{len(points)} 1 0\n{lines}\n{len(points)} {' '.join(map(str, range(len(points))))}\n"
    mesh = Mesh.open(save(tmp_path / "a.off", text))
    a, b, c = (mesh.positions[mesh.faces[:, k]][:, :2] for k in range(3))
    areas = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    x, y = points[:, 0], points[:, 1]
    assert areas.min() > 0 and areas.sum() == pytest.approx((x * np.roll(y, -1) - y * np.roll(x, -1)).sum())
    assert len(mesh.faces) == len(points) - 2


# ---- damage -----------------------------------------------------------------------------------------


def damaged_meshes(count: int):
    """(positions, faces), each with something deleted, doubled, turned, joined, or without area."""
    rng = np.random.default_rng(12)
    shapes = [datasets.load(text) for text in ("icosphere:level=1", "torus:rings=9,sides=6", "blob:size=5,seed=4")]
    for k in range(count):
        mesh = shapes[k % len(shapes)]
        points, faces = mesh.positions.copy(), mesh.faces.astype(np.int64)
        some = rng.integers(0, len(faces), rng.integers(1, 20))
        for damage in rng.permutation(6)[: rng.integers(1, 4)]:
            some = some[some < len(faces)]
            if damage == 0:
                faces = np.delete(faces, some, axis=0)
            elif damage == 1:
                faces = np.vstack([faces, faces[some]])
            elif damage == 2:
                faces[some] = faces[some][:, ::-1]
            elif damage == 3:
                faces[faces == rng.integers(len(points))] = rng.integers(len(points))
            elif damage == 4:
                faces[some, 1] = faces[some, 0]
            else:
                points[faces[some, 2]] = points[faces[some, 0]]
        yield points, faces


def damaged_files(count: int):
    """(name, data) of every format in turn: bytes changed, cut out, put in, the end cut off."""
    rng = np.random.default_rng(13)
    blob = datasets.load("blob:size=4,seed=3")
    files = list(every_format(trimesh.Trimesh(blob.positions, blob.faces, process=False)).items())
    for k in range(count):
        name, data = files[k % len(files)]
        data = bytearray(data)
        reach = 400 if k % 3 else len(data)  # headers more often than rows
        for _ in range(rng.integers(1, 6)):
            at = int(rng.integers(0, max(1, min(reach, len(data)))))
            match rng.integers(0, 5):
                case 0:
                    data[at : at + 1] = bytes([rng.integers(256)])
                case 1:
                    del data[at : at + int(rng.integers(1, 9))]
                case 2:
                    data[at:at] = rng.bytes(int(rng.integers(1, 9)))
                case 3:
                    data[at : at + 1] = bytes([rng.choice(list(b"0123456789-. \\n"))])
                case _:
                    del data[len(data) - at :]
        packed = k % 5 == 4
        yield (
            name + packed * ".gz",
            gzip.compress(bytes(data))[: -1 if k % 10 == 9 else None] if packed else bytes(data),
        )


def test_damaged_meshes_are_counted_and_mended():
    for points, faces in damaged_meshes(250):
        mesh = Mesh(points, faces)
        assert mesh.thumbnail(16).shape == (16, 16, 3)
        mended = mesh.repaired("all").census
        for name in ("nonmanifold_edges", "nonmanifold_vertices", "degenerate_triangles", "unused_vertices"):
            assert mended[name] == 0, name


def test_damaged_files_are_read_or_refused_with_a_reason(tmp_path):
    read = refused = 0
    for name, data in damaged_files(250):
        file = save(tmp_path / name, data)
        try:
            mesh = Mesh.open(file)
        except InvalidInput as error:
            assert str(error).startswith(f"open {file}: ") and len(str(error)) > len(f"open {file}: ") + 10
            refused += 1
        else:
            assert mesh.faces.max() < mesh.samples and mesh.census["components"] >= 0
            read += 1
    assert read > 20 and refused > 100
