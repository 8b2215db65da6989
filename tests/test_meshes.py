# SPDX-License-Identifier: MIT
"""Meshes from arrays, trimesh objects, files and generators."""

from __future__ import annotations

import gzip
import pickle
import struct

import numpy as np
import pytest
import trimesh

from lodlab import Mesh, datasets
from lodlab.errors import InvalidInput
from lodlab.sources import as_source

TETRAHEDRON = (
    np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], np.float64),
    np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]),
)


def volume(mesh: Mesh) -> float:
    a, b, c = (mesh.positions[mesh.faces[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0)


def same(mesh: Mesh, positions, faces) -> None:
    assert np.array_equal(mesh.positions, positions) and np.array_equal(mesh.faces, faces)


# ---- arrays -----------------------------------------------------------------------------------------


def test_arrays_are_held_as_they_are_and_read_only():
    positions, faces = TETRAHEDRON
    mesh = Mesh(positions, faces, colors=np.eye(4, 3), normals=np.ones((4, 3)))
    same(mesh, positions, faces)
    assert mesh.kind == "mesh" and mesh.samples == 4 and mesh.spec == ""
    assert mesh.positions.dtype == np.float64 and mesh.faces.dtype == np.uint32
    assert mesh.colors.tolist()[0] == [255, 0, 0, 255] and mesh.normals.dtype == np.float32
    assert mesh.bounds.tolist() == [[0, 0, 0], [1, 1, 1]] and mesh.extent == pytest.approx(3**0.5)
    positions[0] = 9.0
    assert mesh.positions[0, 0] == 0.0
    positions[0] = 0.0
    with pytest.raises(ValueError):
        mesh.positions[0, 0] = 1


def test_equal_meshes_have_equal_hashes_and_every_array_counts():
    positions, faces = TETRAHEDRON
    hashes = {
        Mesh(positions, faces).hash(),
        Mesh(positions + 0.5, faces).hash(),
        Mesh(positions, faces[::-1]).hash(),
        Mesh(positions, faces, colors=np.zeros((4, 3))).hash(),
        Mesh(positions, faces, normals=np.ones((4, 3))).hash(),
    }
    assert len(hashes) == 5 and Mesh(positions.astype(np.float32), faces).hash() in hashes


def test_a_worker_gets_the_same_mesh():
    mesh = Mesh(*TETRAHEDRON, colors=np.eye(4))
    again = pickle.loads(pickle.dumps(mesh))
    assert again.hash() == mesh.hash() and again.name == mesh.name


def test_a_trimesh_object_is_a_mesh():
    box = trimesh.creation.box()
    box.visual.vertex_colors = np.arange(32, dtype=np.uint8).reshape(8, 4)
    mesh = as_source(box)
    same(mesh, box.vertices, box.faces)
    assert np.array_equal(mesh.colors, box.visual.vertex_colors)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"faces": np.zeros((0, 3), int)}, "no triangles"),
        ({"faces": [[0, 1, 4]]}, "triangle 0 of arrays names vertex 4 of 4"),
        ({"faces": [[0, 1, -1]]}, "triangle 0 of arrays names vertex -1 of 4"),
        ({"faces": [[0, 1, 2**31]]}, "names vertex 2147483648 of 4"),
        ({"faces": [[0, 1, 2**40]]}, "names vertex 1099511627776 of 4"),
        ({"faces": np.broadcast_to(np.int64(0), (2**31 // 3 + 1, 3))}, r"715827883 triangles; .* \(2\^31 indices\)"),
        ({"positions": np.broadcast_to(0.0, (2**32 + 1, 3))}, "4294967297 vertices"),
        ({"faces": [[0.0, 1.0, 2.0]]}, "whole numbers"),
        ({"faces": [[0, 1, 2, 3]]}, r"\(N, 3\)"),
        ({"positions": [[0, 0, np.nan]] * 4}, "vertex 0 .* not finite"),
        ({"positions": [[0, 0, np.inf]] * 4}, "vertex 0 .* not finite"),
        ({"positions": [[0, 0, 1e31]] * 4}, "within 1e"),
        ({"positions": [[0, 0], [1, 1]]}, r"\(N, 3\)"),
        ({"positions": [["a", "b", "c"]]}, "real numbers"),
        ({"colors": [[0, 0, 0]]}, "1 colours for 4 vertices"),
        ({"colors": [[0, 0, 2.0]] * 4}, "outside 0 to 1"),
        ({"colors": [[0, 0, 256]] * 4}, "outside 0 to 255"),
        ({"normals": [[0, 0, 1]]}, "1 normals for 4 vertices"),
    ],
)
def test_arrays_that_are_no_mesh(change, reason):
    positions, faces = TETRAHEDRON
    given = {"positions": positions, "faces": faces} | change
    with pytest.raises(InvalidInput, match=reason):
        Mesh(**given)


# ---- generators -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "triangles", "characteristic"),
    [
        ("icosphere:level=3", 1280, 2),
        ("torus:rings=20,sides=9", 360, 0),
        ("blob:size=33,seed=7", 12 * 32**2, 2),
        ("earth-globe:size=33", 12 * 32**2, 2),
        ("blob:size=2", 12, 2),
    ],
)
def test_generated_meshes_close_and_face_outwards(text, triangles, characteristic):
    mesh = datasets.load(text)
    assert len(mesh.faces) == triangles
    made = trimesh.Trimesh(mesh.positions, mesh.faces, process=False)
    assert made.is_watertight and made.is_winding_consistent and made.volume > 0
    assert made.euler_number == characteristic
    assert np.array_equal(mesh.positions, mesh.positions.astype(np.float32))
    assert datasets.load(mesh.spec).hash() == mesh.hash()


def test_the_globe_stands_at_the_heights_of_the_earth():
    globe = datasets.load("earth-globe:size=65,vertical_scale=3")
    earth = datasets.load("earth:planet=true")
    top = np.linalg.norm(globe.positions, axis=1)
    direction = globe.positions / top[:, None]
    west_east = np.degrees(np.arctan2(direction[:, 1], direction[:, 0])) % 360.0
    row = np.rint((90.0 - np.degrees(np.arcsin(direction[:, 2]))) * 12.0).astype(int)
    col = np.rint((west_east - earth.frame["lon0"]) * 12.0).astype(int) % 4320
    heights = earth.grid[row, col]
    assert np.median(np.abs((top - 6371000.0) / 3.0 - heights)) < 30.0  # nearest sample against bilinear
    everest = globe.positions[np.argmax(top)]
    assert 25 < np.degrees(np.arcsin(everest[2] / np.linalg.norm(everest))) < 40


def test_no_triangle_of_a_cube_sphere_is_a_sliver():
    mesh = datasets.load("earth-globe:size=129,vertical_scale=0")
    angles = trimesh.Trimesh(mesh.positions, mesh.faces, process=False).face_angles
    assert np.degrees(angles.min()) > 30


def test_a_blobs_coarse_shape_is_its_seeds_alone():
    coarse, fine, other = (datasets.load(f"blob:{keys}") for keys in ("size=65", "size=129", "size=65,seed=2"))
    assert volume(coarse) == pytest.approx(volume(fine), rel=0.02)
    assert abs(volume(coarse) / volume(other) - 1.0) > 0.001


@pytest.mark.parametrize(
    "text",
    ["icosphere:level=10", "torus:tube=1", "torus:rings=2", "blob:size=1", "blob:size=7001", "earth-globe:size=0"],
)
def test_generators_name_their_limits(text):
    with pytest.raises(InvalidInput, match="not (within|between)"):
        datasets.load(text)


# ---- PLY --------------------------------------------------------------------------------------------

QUAD = (
    "ply\nformat ascii 1.0\nelement vertex 4\n{}element face {}\nproperty list uchar int vertex_indices\nend_header\n"
)
XYZ = "property float x\nproperty float y\nproperty float z\n"
SQUARE = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n"


def save(path, data: str | bytes):
    path.write_bytes(data.encode() if isinstance(data, str) else data)
    return path


def test_text_is_rounded_to_the_type_that_it_declares(tmp_path):
    file = save(tmp_path / "a.ply", QUAD.format(XYZ, 1) + SQUARE.replace("0 1 0", "0 1 0.1") + "3 0 1 3\n")
    mesh = Mesh.open(file)
    assert mesh.positions[3, 2] == np.float32(0.1)
    double = save(tmp_path / "b.ply", file.read_text().replace("float z", "double z"))
    assert Mesh.open(double).positions[3, 2] == 0.1


@pytest.mark.parametrize("order", ["<", ">"])
def test_binary_of_both_orders_with_properties_between_and_mixed_faces(tmp_path, order):
    name = "little" if order == "<" else "big"
    head = (
        f"ply\r\nformat binary_{name}_endian 1.0\r\ncomment a\r\nelement vertex 5\r\nproperty uchar red\r\n"
        "property double x\r\nproperty float quality\r\nproperty double y\r\nproperty double z\r\n"
        "property uchar green\r\nproperty uchar blue\r\nelement face 2\r\nproperty uchar flags\r\n"
        "property list ushort uint vertex_index\r\nproperty list uchar float uv\r\nelement edge 1\r\n"
        "property int a\r\nend_header\r\n"
    )
    points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0.5, 0.5, 1)]
    body = b"".join(struct.pack(order + "BdfddBB", i, x, 7.0, y, z, 2, 3) for i, (x, y, z) in enumerate(points))
    body += struct.pack(order + "BH4IB2f", 1, 4, 0, 3, 2, 1, 2, 0.5, 0.5)
    body += struct.pack(order + "BH3IB", 1, 3, 0, 1, 4, 0) + struct.pack(order + "i", 3)
    mesh = Mesh.open(save(tmp_path / "a.ply", head.encode() + body))
    same(mesh, points, [[0, 3, 2], [0, 2, 1], [0, 1, 4]])
    assert mesh.colors.tolist() == [[i, 2, 3, 255] for i in range(5)]
    assert mesh.used == {
        "ignored": "of vertices quality",
        "polygons": "1 faces of more than three corners, as 2 triangles",
    }


def test_strips_restart_turn_and_join(tmp_path):
    text = QUAD.replace("vertex 4", "vertex 6").replace("element face", "element tristrips").format(XYZ, 1)
    points = "0 0 0\n0 1 0\n1 0 0\n1 1 0\n2 0 0\n2 1 0\n"
    mesh = Mesh.open(save(tmp_path / "a.ply", text + points + "13 0 1 2 3 3 2 2 4 -1 2 3 4 5\n"))
    assert mesh.faces.tolist() == [[0, 1, 2], [2, 1, 3], [2, 3, 4], [4, 3, 5]]


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (("vertex 4", "vertex 1000000000000"), "claims 1000000000000 rows of element vertex"),
        (("face 1", "face 1000000000000"), "claims 1000000000000 rows of element face"),
        (("format ascii 1.0", "format ascii 2.0"), "line 'format ascii 2.0'"),
        (("format ascii 1.0\n", ""), "declares no format"),
        (("ply\n", "plx\n"), "begin with the word ply"),
        (("end_header\n", ""), "header does not end"),
        (("property float z\n", ""), "no property z"),
        (("vertex_indices", "v"), "no list vertex_indices"),
        (("float y", "float x"), "two properties of one name"),
        (("float y", "half y"), "line 'property half y'"),
        (("4 0 1 2 3", "4 0 1 2 4"), "names vertex 4 of 4"),
        (("4 0 1 2 3", "4 0 1 2 -1"), "names vertex -1 of 4"),
        (("4 0 1 2 3", "4 0 1 2.5 3"), "names vertex 2.5"),
        (("4 0 1 2 3", "4 0 1 2"), "row 0 of 1 of its element face is damaged"),
        (("4 0 1 2 3", "-4 0 1 2 3"), "row 0 of 1 of its element face is damaged"),
        (("4 0 1 2 3", "4 0 1 2 x"), "no number"),
        (("4 0 1 2 3", "2 0 1"), "no triangles"),
        (("1 1 0", "1 nan 0"), "vertex 2 .* not finite"),
        (("1 1 0", "1 1e39 0"), "vertex 2 .* not finite"),
    ],
)
def test_a_damaged_ply_says_why(tmp_path, change, reason):
    sound = QUAD.format(XYZ, 1) + SQUARE + "4 0 1 2 3\n"
    assert len(Mesh.open(save(tmp_path / "sound.ply", sound)).faces) == 2
    file = save(tmp_path / "a.ply", sound.replace(*change))
    with pytest.raises(InvalidInput, match=rf"open .*a\.ply: .*{reason}"):
        Mesh.open(file)


# ---- OFF --------------------------------------------------------------------------------------------

OFF = "OFF # a word\n4 1 0\n# a line\n" + SQUARE + "\n4 0 1 2 3 255 0 0\n"


def test_off_has_comments_colours_and_polygons(tmp_path):
    mesh = Mesh.open(save(tmp_path / "a.off", OFF))
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3]] and mesh.used["ignored"] == "of faces their colours"
    text = "COFF 3 1 0\n0 0 0 1 0 0 1\n1 0 0 0 1 0 1\n0 1 0 0 0 0.5 1\n3 0 1 2\n"
    assert Mesh.open(save(tmp_path / "c.off", text)).colors.tolist()[2] == [0, 0, 128, 255]
    text = "NOFF\n3 1 0\n0 0 0 0 0 1\n1 0 0 0 0 1\n0 1 0 0 0 1\n3 0 1 2\n"
    assert Mesh.open(save(tmp_path / "n.off", text)).normals.tolist() == [[0, 0, 1]] * 3


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (("OFF", "OF"), "word OFF"),
        (("OFF", "4OFF"), "word OFF|is not read"),
        (("4 1 0", "4 x 0"), "numbers of its vertices"),
        (("4 1 0", "1000000000000 1 0"), "claims 1000000000000 vertices"),
        (("4 1 0", "4 2 0"), "claims 4 vertices and 2 faces"),
        (("1 1 0", "1 1"), "vertex 2 has 2 numbers"),
        (("4 0 1 2 3 255 0 0", "9 0 1 2 3"), "face 0 claims 9 corners"),
        (("4 0 1 2 3 255", "4 0 1 2 4 255"), "names vertex 4 of 4"),
        (("4 1 0", "4 0 0"), "no triangles"),
    ],
)
def test_a_damaged_off_says_why(tmp_path, change, reason):
    with pytest.raises(InvalidInput, match=rf"open .*a\.off: .*({reason})"):
        Mesh.open(save(tmp_path / "a.off", OFF.replace(*change)))


# ---- gzip -------------------------------------------------------------------------------------------


def test_packed_files_are_read_whatever_their_name_says(tmp_path):
    assert len(Mesh.open(save(tmp_path / "a.off.gz", gzip.compress(OFF.encode()))).faces) == 2
    assert Mesh.open(save(tmp_path / "b.off", gzip.compress(OFF.encode()))).name == "b"


def test_a_bomb_is_refused_by_a_limit_that_it_names(tmp_path):
    file = save(tmp_path / "a.off.gz", gzip.compress(bytes(100_000_000), 6))
    with pytest.raises(InvalidInput, match="unpacks to more than 67108864 bytes, 64 times"):
        Mesh.open(file)


def test_a_packed_file_that_is_cut_short(tmp_path):
    packed = gzip.compress(OFF.encode())
    for cut in (1, 2, 5, 12, len(packed) - 9, len(packed) - 1):
        with pytest.raises(InvalidInput, match=r"a\.off\.gz"):
            Mesh.open(save(tmp_path / "a.off.gz", packed[:cut]))


def test_files_that_are_not_there(tmp_path):
    with pytest.raises(InvalidInput, match="No such file"):
        Mesh.open(tmp_path / "none.ply")
    (tmp_path / "folder.ply").mkdir()
    with pytest.raises(InvalidInput, match="directory"):
        Mesh.open(tmp_path / "folder.ply")
    with pytest.raises(InvalidInput, match="ends in none of"):
        Mesh.open(save(tmp_path / "a.txt", OFF))
