# SPDX-License-Identifier: MIT
"""What kind of surface a mesh is, counted; and what repairs make of it. Cases that are counted by hand, and trimesh's
figures where it means the same."""

from __future__ import annotations

import json

import numpy as np
import pytest
import trimesh

from lodlab import HeightField, Mesh, cli, datasets
from lodlab.errors import InvalidInput, StoreError
from lodlab.runs import identity
from lodlab.sources.mesh import REPAIRS

POINTS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1], [2, 0, 0], [0, 0, 0]], np.float64)
TETRAHEDRON = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]


def mobius(n: int = 9) -> Mesh:
    """A band of one side, one hole."""
    t = np.repeat(np.arange(n) * (2 * np.pi / n), 2)
    w = np.tile([-0.3, 0.3], n)
    reach = 1.0 + w * np.cos(t / 2)
    points = np.stack([reach * np.cos(t), reach * np.sin(t), w * np.sin(t / 2)], axis=1)
    faces = []
    for i in range(n):
        a, b, c, d = 2 * i, 2 * i + 1, 2 * i + 2, 2 * i + 3
        if i == n - 1:
            c, d = 1, 0
        faces += [[a, c, b], [b, c, d]]
    return Mesh(points, faces)


def census(faces, points=POINTS) -> dict:
    return Mesh(points, faces).census


#: faces over POINTS, and what differs from a sound closed component of all that they name
CASES = {
    "tetrahedron": (TETRAHEDRON, {"genus": 0, "unused_vertices": 3}),
    "one triangle": ([[0, 1, 2]], {"boundary_edges": 3, "genus": 0, "unused_vertices": 4}),
    "two triangles": ([[0, 1, 2], [2, 1, 4]], {"boundary_edges": 4, "genus": 0, "unused_vertices": 3}),
    "unlike senses": (
        [[0, 1, 2], [1, 2, 4]],
        {"boundary_edges": 4, "genus": 0, "unused_vertices": 3, "oriented": False},
    ),
    "apart": ([[0, 1, 2], [3, 4, 5]], {"components": 2, "boundary_edges": 6, "genus": 0, "unused_vertices": 1}),
    "at one vertex": ([[0, 1, 2], [0, 3, 4]], {"boundary_edges": 6, "nonmanifold_vertices": 1, "unused_vertices": 2}),
    "a book": (
        [[0, 1, 2], [1, 0, 3], [0, 1, 4]],
        {"boundary_edges": 6, "nonmanifold_edges": 1, "unused_vertices": 2, "oriented": False},
    ),
    "twice": (
        [*TETRAHEDRON, [0, 2, 1]],
        {"duplicate_triangles": 1, "nonmanifold_edges": 3, "unused_vertices": 3, "oriented": False},
    ),
    "both senses": ([[0, 1, 2], [2, 1, 0]], {"duplicate_triangles": 1, "genus": 0, "unused_vertices": 4}),
    "a vertex twice": ([*TETRAHEDRON, [0, 0, 4]], {"degenerate_triangles": 1, "genus": 0, "unused_vertices": 2}),
    "no area": (
        [*TETRAHEDRON, [0, 1, 5]],
        {
            "degenerate_triangles": 1,
            "nonmanifold_edges": 1,
            "boundary_edges": 2,
            "unused_vertices": 2,
            "oriented": False,
        },
    ),
    "equal places": ([[0, 1, 6]], {"degenerate_triangles": 1, "boundary_edges": 3, "genus": 0, "unused_vertices": 4}),
}


@pytest.mark.parametrize("name", CASES)
def test_small_meshes_as_counted_by_hand(name):
    faces, differs = CASES[name]
    sound = {
        "components": 1,
        "boundary_edges": 0,
        "nonmanifold_edges": 0,
        "nonmanifold_vertices": 0,
        "genus": None,
        "duplicate_triangles": 0,
        "degenerate_triangles": 0,
        "unused_vertices": 0,
        "oriented": True,
    }
    assert census(faces) == sound | differs


def test_genus_closes_holes_and_adds_up_over_components():
    torus = datasets.load("torus:rings=12,sides=7")
    assert torus.census["genus"] == 1
    holes = Mesh(torus.positions, np.delete(torus.faces, [0, 90], axis=0)).census
    assert (holes["genus"], holes["boundary_edges"]) == (1, 6)
    two = Mesh(np.vstack([torus.positions, torus.positions + 9]), np.vstack([torus.faces, torus.faces + torus.samples]))
    assert (two.census["genus"], two.census["components"]) == (2, 2)


def test_a_band_of_one_side_has_no_genus_and_stays_so():
    band = mobius()
    assert band.census["genus"] is None and not band.census["oriented"] and band.census["boundary_edges"] == 18
    mended = band.repaired("orient")
    assert "one side only" in mended.used["repaired"] and not mended.census["oriented"]


@pytest.mark.parametrize("seed", range(4))
def test_counts_agree_with_trimesh_on_ragged_meshes(seed):
    rng = np.random.default_rng(seed)
    sphere = datasets.load("icosphere:level=3")
    faces = sphere.faces[rng.random(len(sphere.faces)) > 0.15 * seed].astype(np.int64)
    faces = np.vstack([faces, faces[: 10 * seed], rng.integers(0, sphere.samples, (5 * seed, 3))])
    turned = rng.random(len(faces)) < 0.1 * seed
    faces[turned] = faces[turned][:, ::-1]
    mesh = Mesh(sphere.positions, faces)
    keep = [len(set(f)) == 3 for f in faces.tolist()]
    other = trimesh.Trimesh(sphere.positions, faces[keep], process=False)
    found = mesh.census
    times = np.bincount(other.edges_unique_inverse)
    assert found["boundary_edges"] == (times == 1).sum() and found["nonmanifold_edges"] == (times > 2).sum()
    joined = trimesh.graph.connected_components(other.edges_unique, nodes=np.unique(other.faces))
    assert found["components"] == len(joined)
    assert found["duplicate_triangles"] == len(faces) - len(np.unique(np.sort(faces, axis=1), axis=0))
    assert found["unused_vertices"] == sphere.samples - len(np.unique(faces))
    if found["genus"] is not None and other.is_watertight:
        assert 2 - 2 * found["genus"] == other.euler_number


@pytest.mark.parametrize(
    ("name", "counts"),
    [
        ("armadillo.off", {"genus": 0, "components": 1}),
        ("elephant_genus3.off", {"genus": 3, "components": 1}),
        ("igea_tristrips.ply", {"genus": 0, "components": 1}),
        ("bunny_stanford_holes.ply", {"boundary_edges": 223, "unused_vertices": 1113}),
        ("dragon_vrip.ply.gz", {"components": 151, "boundary_edges": 4270, "nonmanifold_edges": 0}),
    ],
)
def test_scans_are_what_is_known_of_them(shared_data, name, counts):
    found = Mesh.open(shared_data(f"mesh/{name}")).census
    assert {key: found[key] for key in counts} == counts


# ---- repairs ----------------------------------------------------------------------------------------


def test_welding_joins_equal_places_and_nothing_else():
    soup = datasets.load("icosphere:level=1")
    torn = Mesh(soup.positions[soup.faces].reshape(-1, 3) * [1, 1, -1] * [1, 1, -1], np.arange(240).reshape(-1, 3))
    assert torn.census["components"] == 80
    mended = torn.repaired("weld")
    assert mended.samples == 42 and mended.census["genus"] == 0 and mended.used["repaired"] == "welded 198 vertices"
    assert np.array_equal(mended.positions[mended.faces], torn.positions[torn.faces])


def test_minus_zero_is_zero():
    points = [[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [-0.0, 0, 0]]
    assert Mesh(points, [[0, 1, 2], [3, 2, 1]]).repaired("weld").samples == 3


def test_attributes_stay_with_their_vertices():
    mesh = Mesh(POINTS, TETRAHEDRON, colors=np.arange(21).reshape(7, 3), normals=np.arange(21).reshape(7, 3))
    mended = mesh.repaired("unused,split,weld")
    assert mended.samples == 4
    for k, p in enumerate(mended.positions):
        first = int(np.flatnonzero((POINTS == p).all(axis=1))[0])
        assert mended.colors[k].tolist() == [3 * first, 3 * first + 1, 3 * first + 2, 255]
        assert mended.normals[k].tolist() == [3 * first, 3 * first + 1, 3 * first + 2]


def test_orient_follows_the_most_of_each_component_then_faces_out():
    sphere = datasets.load("icosphere:level=2")
    faces = sphere.faces.copy()
    faces[:40] = faces[:40, ::-1]
    mended = Mesh(sphere.positions, faces).repaired("orient")
    assert mended.used["repaired"] == "turned 40 triangles"
    inside = Mesh(sphere.positions, sphere.faces[:, ::-1]).repaired("orient")
    assert "inside out" in inside.used["repaired"]
    for done in (mended, inside):
        a, b, c = (done.positions[done.faces[:, k]] for k in range(3))
        assert np.einsum("ij,ij->i", a, np.cross(b, c)).min() > 0
    sheet = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0.1], [0, 1, 0]], [[0, 2, 1], [0, 3, 2]]).repaired("orient")
    assert "inside out" not in sheet.used["repaired"]  # an open sheet has no inside


@pytest.mark.parametrize("name", CASES)
def test_split_makes_every_case_manifold(name):
    mesh = Mesh(POINTS, CASES[name][0])
    mended = mesh.repaired("split")
    found = mended.census
    assert found["nonmanifold_edges"] == found["nonmanifold_vertices"] == 0
    assert len(mended.faces) == len(mesh.faces)
    assert np.array_equal(mended.positions[mended.faces], mesh.positions[mesh.faces])


@pytest.mark.parametrize("seed", range(6))
def test_all_repairs_of_random_triangles_leave_a_sound_mesh(seed):
    rng = np.random.default_rng(seed)
    points = rng.integers(0, 3, (30, 3)).astype(float)
    mended = Mesh(points, rng.integers(0, 30, (40 + 60 * seed, 3))).repaired("all")
    counted = (
        "nonmanifold_edges",
        "nonmanifold_vertices",
        "duplicate_triangles",
        "degenerate_triangles",
        "unused_vertices",
    )
    assert all(mended.census[name] == 0 for name in counted)


def test_repairs_are_named_and_listed_in_the_order_in_which_they_are_done():
    mesh = Mesh(POINTS, [*TETRAHEDRON, [0, 2, 1], [6, 6, 1]])
    assert "repaired" not in mesh.used
    said = mesh.repaired(["unused", "duplicates", "degenerate"]).used["repaired"]
    assert said == ("left out 1 degenerate triangles, left out 1 duplicate triangles, left out 3 unused vertices")
    assert len(mesh.repaired("all").used["repaired"].split(", ")) == len(REPAIRS)
    assert mesh.repaired("weld").repaired("split").used["repaired"] == "welded 1 vertices, split off 6 vertices"
    with pytest.raises(InvalidInput, match="repair is 'wield'.*close to it: weld"):
        mesh.repaired("wield")


def test_a_repaired_mesh_never_names_what_it_was_made_of(tmp_path):
    file = tmp_path / "a.off"
    file.write_text("OFF 4 1 0\n0 0 0\n1 0 0\n0 1 0\n9 9 9\n3 0 1 2\n")
    mended = Mesh.open(file).repaired("unused")
    assert mended.spec == f"{file}:repair=unused" and datasets.load(mended.spec).hash() == mended.hash()
    assert mended.repaired("weld").spec == "" and datasets.load("torus").repaired("weld").spec == ""


def test_info_says_what_was_counted_and_repaired(tmp_path, capsys):
    file = tmp_path / "a.off"
    file.write_text("OFF 7 5 0\n" + "\n".join(" ".join(map(str, p)) for p in POINTS.tolist()) + "\n"
                    + "\n".join("3 " + " ".join(map(str, f)) for f in [*TETRAHEDRON, [0, 2, 1]]))  # fmt: skip
    assert cli.run(["info", f"{file}:repair=weld,duplicates,unused", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["source"] == f"{file}:repair=weld,duplicates,unused"
    assert found["repaired"].startswith("welded 1 vertices, left out 1 duplicate triangles")
    assert (found["vertices"], found["triangles"], found["genus"]) == (4, 4, 0)
    assert list(found)[-10:-1] == [
        "components", "boundary_edges", "nonmanifold_edges", "nonmanifold_vertices", "genus", "duplicate_triangles",
        "degenerate_triangles", "unused_vertices", "oriented",
    ]  # fmt: skip
    assert datasets.load(found["source"]).hash() == found["source_hash"]
    assert cli.run(["info", f"{file}:repair=wield"]) == 2
    assert cli.run(["info", str(file)]) == 0 and "nonmanifold_edges     3" in capsys.readouterr().out


def test_a_run_directory_keeps_a_mesh_of_arrays(tmp_path):
    mesh = Mesh(POINTS, TETRAHEDRON, colors=np.eye(7, 3))
    identity.keep_array(tmp_path, "array:1", mesh, 1)
    again = identity.source_in(tmp_path, "array:1")
    assert isinstance(again, Mesh) and again.hash() == mesh.hash() and again.name == mesh.name
    identity.keep_array(tmp_path, "array:1", HeightField(np.zeros((3, 3))), 1)
    assert identity.source_in(tmp_path, "array:1").kind == "heightfield"
    identity.keep_array(tmp_path, "large", Mesh(POINTS, TETRAHEDRON), 1e-6)
    assert identity.kept_array(tmp_path, "large") is None


def test_a_kept_mesh_that_was_damaged_is_refused(tmp_path):
    identity.keep_array(tmp_path, "m", Mesh(POINTS, TETRAHEDRON), 1)
    file = tmp_path / "sources" / "m.npz"
    data = file.read_bytes()
    for damaged in (data[:-40], data[:30] + bytes(100) + data[130:], b""):
        file.write_bytes(damaged)
        with pytest.raises(StoreError, match="m.npz is damaged"):
            identity.kept_array(tmp_path, "m")
