# SPDX-License-Identifier: MIT
"""The command line: what it prints, its exit status, and one clear line for each mistake."""

from __future__ import annotations

import json
import os
import shlex
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import rasterio
import trimesh

import lodlab as lod
from lodlab import cli, pictures

SOURCE = "fractal:size=65,seed=3"
COMMANDS = (
    "doctor", "devices", "methods", "datasets", "build", "info", "fly", "compare", "sweep", "report", "render",
    "export", "bench", "calibrate", "stability", "fit", "check",
)  # fmt: skip
SMALL = ["--frames", "4", "--size", "96x64", "--accuracy-frames", "2"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("cli")


@pytest.fixture(scope="module")
def store(folder):
    assert cli.run(["build", SOURCE, "chunked", str(folder / "a.lod"), "-o", "finest_error=0.5"]) == 0
    return str(folder / "a.lod")


@pytest.fixture
def say(capsys):
    """Runs a command: (status, standard output, standard error)."""

    def run(*words):
        status = cli.run([str(w) for w in words])
        out = capsys.readouterr()
        return status, out.out, out.err

    return run


def fails(result, status, *texts):
    """One line on standard error that holds the texts."""
    assert result[0] == status, result
    lines = result[2].strip().splitlines()
    assert len(lines) == 1 and lines[0].startswith("error: "), result[2]
    for text in texts:
        assert text in lines[0]


@pytest.mark.parametrize("command", COMMANDS)
def test_every_help_shows_an_example(say, command):
    status, out, _ = say(command, "--help")
    assert status == 0
    assert f"Example: lodlab {command}" in out


def test_help_lists_every_command(say):
    status, out, _ = say("--help")
    assert status == 0
    for command in COMMANDS:
        assert f"\n  {command} " in out


def test_doctor_draws_a_triangle(say):
    status, out, _ = say("doctor")
    assert status == 0, out
    assert "a triangle: drawn and read back" in out and "NO " not in out
    for library in ("numpy", "trimesh", "sqlite", "tbb", "OpenGL"):
        assert f"\nok  {library}: " in out


def test_doctor_names_what_is_missing_and_its_cure(say, monkeypatch, tmp_path):
    monkeypatch.setattr("lodlab.cli.doctor.PACKAGES", ("numpy", "no-such-package"))
    status, out, err = say("doctor")
    assert status == 1
    assert "NO  no-such-package: missing" in out and "cure: pip install no-such-package" in out
    assert err == "error: doctor: missing: no-such-package\n"


def test_lists_in_words_and_json(say):
    for command, keys in (
        ("devices", {"index", "name", "software"}),
        ("methods", {"name", "summary", "accepts", "budgets", "reproduces_source", "options"}),
        ("datasets", {"name", "rows", "cols", "spacing", "description"}),
    ):
        status, out, _ = say(command, "--json")
        assert status == 0
        records = json.loads(out)
        assert records and keys <= set(records[0])
        status, out, _ = say(command)
        assert status == 0 and records[0]["name"] in out
    methods = json.loads(say("methods", "--json")[1])
    assert [m["name"] for m in methods][:2] == ["full", "chunked"]
    for option in methods[1]["options"]:
        assert {"name", "type", "default", "unit", "help", "stage"} <= set(option)


def test_build_ends_with_sizes_and_bounds(say, folder):
    status, out, _ = say("build", SOURCE, "chunked", folder / "b.lod")
    assert status == 0
    assert "error bound" in out and "bytes per sample" in out and "MB in" in out


def test_build_refuses_what_stands_in_the_way(say, store, folder):
    fails(say("build", SOURCE, "chunked", store), 2, "there already", "--force")
    assert say("build", SOURCE, "chunked", store, "--force", "-o", "finest_error=0.5")[0] == 0
    fails(say("build", SOURCE, "chunked", folder / "c.lod", "--force", "--resume"), 2, "exclude")
    assert not (folder / "c.lod").exists()


def test_info_of_a_store(say, store):
    status, out, _ = say("info", store, "--json", "--verify")
    found = json.loads(out)
    assert status == 0
    keys = "format_version complete method options source_hash content_hash quantum bytes bytes_per_sample".split()
    assert set(keys) | {"bytes_per_vertex", "levels", "verified"} <= set(found)
    assert set(found["levels"][0]) == {"level", "nodes", "triangles", "error_max"}
    assert found["method"] == "chunked" and found["options"]["finest_error"] == 0.5
    assert "verified" in say("info", store, "--verify")[1]


def test_info_of_a_source(say):
    status, out, _ = say("info", SOURCE, "--json")
    found = json.loads(out)
    assert status == 0 and found["rows"] == 65 and found["void_samples"] == 0 and len(found["source_hash"]) == 32
    fails(say("info", SOURCE, "--verify"), 2, "--verify is for stores")


def test_audit_of_a_store(say, store):
    status, out, _ = say("info", store, "--audit", "--cuts", "5")
    assert status == 0
    assert "every bound holds" in out and "5 random cuts" in out
    chart = Path(f"{store}.audit.png")
    assert chart.stat().st_size > 0
    found = json.loads(say("info", store, "--audit", "--json", "-o", "morph=false")[1])["audit"]
    assert found["broken"] == [] and found["nodes"] == len(lod.open(store).nodes)
    assert 1.0 <= found["median_bound_over_measured"] < 4.0
    fails(say("info", SOURCE, "--audit"), 2, "--audit is for stores")
    fails(say("info", store, "--cuts", "5"), 2, "for --audit")
    fails(say("info", store, "--audit", "--cuts", "-1"), 2, "cuts is -1")


def test_a_broken_bound_ends_with_status_1(say, store, monkeypatch):
    whole = lod.instrument.audit

    def halved(*args, **kwargs):
        audit = whole(*args, **kwargs)
        audit.nodes["holds"] &= audit.nodes["measured"] <= 0.5 * audit.nodes["bound"] + audit.slack
        return audit

    monkeypatch.setattr(lod.instrument, "audit", halved)
    fails(say("info", store, "--audit"), 1, "node", "bound")


def test_fit_finds_a_store(say, folder, monkeypatch):
    monkeypatch.setattr(lod.report, "write", lambda run: None)  # seconds of charts
    out = folder / "fit.lod"
    common = ["--frames", "3", "--size", "160x90"]
    status, text, _ = say("fit", "fractal:size=129", "chunked", out, "--pixel-error", "1", *common)
    assert status == 0
    assert "chosen: finest_error" in text and "coarser: " in text and "looser: " in text
    fly, check = (shlex.split(line)[1:] for line in text.splitlines() if line.startswith("lodlab "))
    assert str(folder / "fit.run") in fly and check[:2] == ["check", str(folder / "fit.run")]
    fails(say("fit", "fractal:size=129", "chunked", out, "--pixel-error", "1", *common), 2, "already")
    run = folder / "fit out"  # a name that the lines must quote
    asked = ["--force", "--json", "--out", run, *common]
    found = json.loads(say("fit", "fractal:size=129", "chunked", out, "--pixel-error", "1", *asked)[1])
    table = (run / "frames.csv").read_bytes()
    rows = lod.runs.load(run).frames
    assert len(rows) == 3 and rows["accuracy"].all() and rows["measured_px_max"].max() <= found["worst_px"]
    assert (~rows["budget_met"]).sum() == found["unmet_frames"]
    fly, check = (shlex.split(line)[1:] for line in found["commands"])
    assert say(*fly)[0] == 0 and (run / "frames.csv").read_bytes() == table, "the line is not what fit flew"
    assert say(*check)[0] == 0
    assert say("check", run, "--max", f"measured_px_max={rows['measured_px_max'].max() / 2}")[0] == 1
    assert found["reached"] and found["worst_px"] <= 1.0
    assert found["coarser"]["worst_px"] > 1.0 and found["looser"]["worst_px"] > 1.0
    fails(say("fit", "fractal:size=129", "chunked", folder / "f.lod", "--pixel-error", "0"), 2, "pixel_error", "0")


def test_check_is_a_gate(say, store, folder):
    out = folder / "gate"
    assert say("fly", store, "--out", out, "--pixel-error", "4", *SMALL)[0] == 0
    limits = ["--max", "measured_px_max=1.01", "--max", "hole_samples=0", "--max", "pop_px_max=5"]
    status, text, _ = say("check", out, *limits, "--min", "psnr_db=10", "--min", "budget_met=1")
    assert status == 0 and "5 limits hold" in text
    fails(say("check", out, "--max", "triangles_median=1"), 1, "chunked-px4", "triangles_median", "at most 1")
    status, _, errors = say("check", out, "--max", "measured_px_max=0")
    assert status == 1 and len(errors.splitlines()) == 2  # the measured frames, first and last
    assert "run chunked-px4, frame 3: measured_px_max is" in errors
    fails(say("check", out, "--max", "no_such=0"), 2, "no_such", "measured_px_max")
    fails(say("check", out, "--max", "flip=much"), 2, "much", "no number")
    fails(say("check", out), 2, "limit")
    fails(say("check", folder, "--max", "flip=1"), 2)


def test_calibrate_ends_with_status_1_when_a_case_is_off(say, monkeypatch):
    def rows(wrong):
        row = {"metric": "flip", "case": "none", "expected": 1.0, "returned": 1.0 + wrong, "deviation": wrong}
        return pd.DataFrame([{**row, "tolerance": 0.001, "pass": wrong == 0.0}])

    monkeypatch.setattr(lod.instrument, "calibrate", lambda: rows(0.0))
    assert say("calibrate")[0] == 0
    assert json.loads(say("calibrate", "--json")[1])[0]["pass"] is True
    monkeypatch.setattr(lod.instrument, "calibrate", lambda: rows(0.5))
    fails(say("calibrate"), 1, "flip, none: 1.5 instead of 1")


def test_info_of_a_damaged_store(say, store, folder):
    whole = Path(store).read_bytes()
    damaged = folder / "damaged.lod"
    damaged.write_bytes(whole[: len(whole) // 2])
    fails(say("info", damaged), 1, "damaged.lod")
    damaged.write_bytes(b"no store at all" * 100)
    fails(say("info", damaged), 1, "damaged.lod")


def test_render_films_a_path(say, store, folder):
    film = ("--video", folder / "a.gif", "--frames", "3", "--fps", "10")
    status, text, _ = say("render", store, *film, "--size", "64x36", "--show", "error")
    assert status == 0 and "3 frames, 0.3 s" in text
    assert (folder / "a.gif").read_bytes().startswith(b"GIF89a")
    fails(say("render", store), 2, "OUT.png", "--video")
    fails(say("render", store, folder / "a.png", "--video", folder / "a.gif"), 2, "one of both")
    fails(say("render", store, "--video", folder / "a.avi"), 2, "ends in none of .mp4, .gif")
    fails(say("render", store, "--video", folder / "a.gif", "--fps", "0"), 2, "1 to 100")


def test_fly_leaves_a_run_directory(say, store, folder):
    out = folder / "run"
    status, text, _ = say("fly", store, "--out", out, "--pixel-error", "1", *SMALL)
    assert status == 0
    assert "chunked-px1" in text and f"report: {out / 'report.html'}" in text
    for name in ("config.toml", "provenance.json", "frames.csv", "summary.csv", "report.html", "pareto.png",
                 "pareto.svg"):  # fmt: skip
        assert (out / name).stat().st_size > 0
    assert list((out / "images" / "chunked-px1.worst").glob("*-difference-x*.png"))


def test_compare_ends_with_the_report(say, folder):
    out = folder / "compare"
    status, text, _ = say(
        "compare",
        SOURCE,
        "--out",
        out,
        "--methods",
        "chunked",
        "--pixel-errors",
        "1,4",
        "-o",
        "chunked.finest_error=0.5",
        *SMALL,
    )
    assert status == 0
    assert text.strip().splitlines()[-1] == f"report: {out / 'report.html'}"
    frames = lod.Sweep.load(out).frames
    assert set(frames["run"]) == {"full", "chunked-px1", "chunked-px4"}
    assert frames[frames["method"] == "chunked"]["options"].str.contains('"finest_error":0.5').all()
    again = folder / "again"
    assert say("sweep", out / "config.toml", "--out", again)[0] == 0
    assert lod.Sweep.load(again).runs == lod.Sweep.load(out).runs
    (out / "report.html").unlink()
    status, text, _ = say("report", out)
    assert status == 0 and (out / "report.html").exists()


def test_render_shows_what_was_asked(say, store, folder):
    seen = {}
    for show in ("shade", "level", "wire", "normal", "error"):
        out = folder / f"{show}.png"
        assert say("render", store, out, "--show", show, "--size", "240x160", "--at", "0.25")[0] == 0
        seen[show] = pictures.load(out)
        assert seen[show].shape[1] == 240 and (seen[show].shape[0] == 160 or show == "error")
    assert seen["error"].shape[0] > 160  # its scale below
    assert all(np.any(seen["shade"] != seen[other][:160]) for other in ("level", "wire", "normal", "error"))
    fails(say("render", store, folder / "e.png", "--show", "depth"), 2, "shade, normal, level, wire")
    fails(say("render", store, folder / "e.gif"), 2, ".gif", ".png")
    fails(say("render", store, folder / "none" / "e.png"), 2, "no directory")


@pytest.mark.parametrize("kind", [".ply", ".glb", ".obj"])
def test_export_writes_the_surface_in_source_coordinates(say, folder, kind):
    store = folder / "full.lod"
    if not store.exists():
        assert say("build", SOURCE, "full", store)[0] == 0
    out = folder / f"mesh{kind}"
    assert say("export", store, out, "--size", "96x64")[0] == 0
    mesh = opened_mesh(out)
    field = lod.datasets.load(SOURCE)
    rows, cols = field.shape
    grid = field.core.position(*np.divmod(np.arange(rows * cols), cols))
    assert len(mesh.faces) == 2 * (rows - 1) * (cols - 1)
    assert len(mesh.vertices) == rows * cols
    # float steps at the distance to the eye, which is a few times the size of the field
    assert np.abs(mesh.bounds - [grid.min(axis=0), grid.max(axis=0)]).max() < 0.01
    assert (mesh.vertex_normals[:, 2] > 0.1).all(), "normals point out of the ground"
    slope = mesh.face_normals[mesh.vertex_faces[:, 0]]
    assert (np.einsum("ij,ij->i", slope, mesh.vertex_normals) > 0.0).all(), "a normal is not of its faces"


def opened_mesh(file: Path) -> trimesh.Trimesh:
    """A mesh file as others read it, in source coordinates: glTF's x east, y up, z south turned back."""
    mesh = trimesh.load(file, process=False)
    if isinstance(mesh, trimesh.Scene):
        mesh = mesh.to_geometry()
        mesh.apply_transform([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
    return mesh


def gltf_tree(file: Path) -> dict:
    """The JSON of a .glb file."""
    data = file.read_bytes()
    return json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")])


def gltf_bytes(file: Path, attribute: str) -> np.ndarray:
    """(V, 4) uint8: an attribute of the one mesh of a .glb file."""
    tree, data = gltf_tree(file), file.read_bytes()
    accessor = tree["accessors"][tree["meshes"][0]["primitives"][0]["attributes"][attribute]]
    assert (accessor["componentType"], accessor["type"], accessor["normalized"]) == (5121, "VEC4", True)
    start = 28 + int.from_bytes(data[12:16], "little") + tree["bufferViews"][accessor["bufferView"]]["byteOffset"]
    return np.frombuffer(data, np.uint8, 4 * accessor["count"], start).reshape(-1, 4)


def test_glb_has_y_up_and_says_what_it_is_of(say, folder, tmp_path):
    place = rasterio.Affine(30.0, 0.0, 500000.0, 0.0, -30.0, 5200000.0)
    dem = tmp_path / "dem.tif"
    with rasterio.open(dem, "w", "GTiff", 9, 7, 1, "EPSG:32611", place, "float32") as file:
        file.write(np.full((7, 9), 1500.0, np.float32), 1)
    assert say("build", dem, "full", tmp_path / "s.lod")[0] == 0
    assert say("export", tmp_path / "s.lod", tmp_path / "m.glb", "--triangles", "50", "--at", "0")[0] == 0
    mesh = trimesh.load(tmp_path / "m.glb", process=False).to_geometry()
    assert mesh.bounds[:, 1] == pytest.approx([1500.0, 1500.0]), "y is not up"
    assert mesh.bounds[:, 0] == pytest.approx([500015.0, 500255.0])
    assert mesh.bounds[:, 2] == pytest.approx([-5199985.0, -5199805.0]), "z is not south"
    tree = gltf_tree(tmp_path / "m.glb")
    (node,) = (node for node in tree["nodes"] if "mesh" in node)
    extras = node["extras"]
    assert extras["crs"] == "WGS 84 / UTM zone 11N" and extras["budget"] == {"triangles": 50}
    assert extras["view"]["size"] == [1280, 720] and len(extras["view"]["eye"]) == 3
    assert {"POSITION", "NORMAL"} == set(tree["meshes"][0]["primitives"][0]["attributes"])


@pytest.mark.parametrize("kind", [".ply", ".glb", ".obj"])
def test_a_mesh_is_exported_where_it_lies_with_its_colours(say, tmp_path, kind):
    ball = lod.datasets.load("icosphere:level=3")
    shades = np.clip(128.0 + 127.0 * ball.positions, 0, 255).astype(np.uint8)
    mesh = lod.Mesh(ball.positions * [1.0, 2.0, 3.0] + 7.0, ball.faces, colors=shades)
    assert say("build", written(mesh, tmp_path / "ball.ply"), "full", tmp_path / "s.lod")[0] == 0
    assert say("export", tmp_path / "s.lod", tmp_path / f"m{kind}")[0] == 0
    again = lod.Mesh.open(tmp_path / f"m{kind}")
    assert again.census == mesh.census and np.abs(again.bounds - mesh.bounds).max() < 1e-5
    order, wanted = (np.lexsort(np.round(m.positions, 3).T) for m in (again, mesh))
    assert np.abs(again.colors[order].astype(int) - mesh.colors[wanted]).max() <= (
        13 if kind == ".glb" else 1  # .glb has 8 bits of linear light: few shades where it is dark
    )


def written(mesh: lod.Mesh, file: Path) -> Path:
    """A mesh as a PLY file with colours."""
    trimesh.Trimesh(mesh.positions, mesh.faces, vertex_colors=mesh.colors, process=False).export(file)
    return file


@pytest.mark.parametrize("kind", [".ply", ".glb", ".obj"])
def test_export_carries_the_colours_of_a_map(say, folder, tmp_path, kind):
    columns, rows = np.meshgrid(np.arange(65) * 3, np.arange(65) * 3)
    raster = np.dstack([columns, rows, np.full_like(rows, 50), np.full_like(rows, 255)]).astype(np.uint8)
    pictures.save(tmp_path / "map.png", raster)
    store, out = tmp_path / "s.lod", tmp_path / f"m{kind}"
    options = ("-o", f"attribute={tmp_path / 'map.png'}", "-o", "leaf=16", "-o", "chunk_triangles=128")
    assert say("build", SOURCE, "chunked", store, *options)[0] == 0
    assert say("export", store, out, "--size", "96x64")[0] == 0
    mesh = opened_mesh(out)
    spacing = lod.datasets.load(SOURCE).spacing
    east, south = mesh.vertices[:, 0] / spacing[0], -mesh.vertices[:, 1] / spacing[1]
    wanted = np.column_stack([3.0 * east, 3.0 * south, np.full(len(east), 50.0)])
    found = gltf_bytes(out, "COLOR_0") if kind == ".glb" else mesh.visual.vertex_colors
    shades = found[:, :3].astype(float)
    if kind == ".glb":  # linear by its standard
        share = wanted / 255.0
        wanted = 255.0 * np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    assert np.abs(shades - wanted).max() <= 1.0 + 3.0 * 0.01  # a step, and how far floats move a vertex
    (tmp_path / "map.png").unlink()
    fails(say("export", store, tmp_path / f"n{kind}", "--size", "96x64"), 1, "map.png", "colours")
    assert not (tmp_path / f"n{kind}").exists()


def test_export_refuses_other_kinds(say, store, folder):
    fails(say("export", store, folder / "mesh.stl"), 2, ".stl", ".ply, .glb, .obj")


@pytest.mark.parametrize(
    ("words", "texts"),
    [
        ([], ()),
        (["nope"], ("nope",)),
        (["fly"], ("STORE",)),
        (["build", SOURCE, "chunky", "{out}"], ("chunky", "full, chunked")),
        (["build", SOURCE, "chunked", "{out}", "-o", "no_such=1"], ("no_such", "finest_error")),
        (["build", SOURCE, "chunked", "{out}", "-o", "finest_error"], ("NAME=VALUE",)),
        (["build", SOURCE, "chunked", "{out}", "-o", "finest_error=-1"], ("finest_error", "-1")),
        (["build", SOURCE, "chunked", "{out}", "-o", "finest_error=1", "-o", "finest_error=2"], ("twice",)),
        (["build", SOURCE, "chunked", "{out}/no/x.lod"], ("no directory",)),
        (["build", SOURCE, "chunked", "."], ("is a directory",)),
        (["build", "x" * 300, "chunked", "{out}"], ("x" * 300,)),
        (["build", SOURCE, "chunked", "x" * 300 + ".lod"], ("too long",)),
        (["build", "nowhere.tif", "chunked", "{out}"], ("nowhere.tif", "jacksboro")),
        (["build", "fractal:sise=65", "chunked", "{out}"], ("sise", "size")),
        (["fly", "{store}", "--out", "{out}"], ("none set", "--pixel-error, --triangles, --nodes")),
        (["fly", "{store}", "--out", "{out}", "--pixel-error", "0"], ("pixel_error",)),
        (["fly", "{store}", "--out", "{out}", "--pixel-error", "nan"], ("pixel_error",)),
        (["fly", "{store}", "--out", "{out}", "--pixel-error", "x"], ("pixel-error",)),
        (["fly", "{store}", "--out", "{out}", "--triangles", "-5"], ("triangles", "-5")),
        (["fly", "{store}", "--out", "{out}", "--pixel-error", "1", "--size", "96"], ("96", "1280x720")),
        (["fly", "{store}", "--out", "{out}", "--pixel-error", "1", "--size", "0x720"], ("size", "16384")),
        (["fly", "{store}", "--out", "{out}", "--pixel-error", "1", "--size", "100000x9"], ("size", "16384")),
        (["fly", "{store}", "--out", "{out}", "--pixel-error", "1", "--fov", "180"], ("fov", "170")),
        (["fly", "{store}", "--out", "{out}", "--pixel-error", "1", "--frames", "0"], ("frames", "0")),
        (["fly", "{store}", "--out", "{out}", "--pixel-error", "1", "--path", "loop"], ("loop", "flyover")),
        (["fly", "{store}", "--out", "{out}", "--pixel-error", "1", "-o", "finest_error=1"], ("finest_error",)),
        (["fly", "no.lod", "--out", "{out}", "--pixel-error", "1"], ("no.lod",)),
        (["compare", SOURCE, "--out", "{out}", "--pixel-errors", "1,x"], ("pixel-errors", "1,x")),
        (["compare", SOURCE, "--out", "{out}", "--methods", "chunky"], ("chunky", "full, chunked")),
        (["compare", SOURCE, "--out", "{out}", "-o", "finest_error=1"], ("METHOD.NAME=VALUE",)),
        (["compare", SOURCE, "--out", "{out}", "-o", "nope.finest_error=1"], ("nope", "chunked")),
        (["compare", SOURCE, "--out", "{store}"], ("is a file",)),
        (["sweep", "no.toml", "--out", "{out}"], ("no.toml",)),
        (["report", "{out}"], ("no directory",)),
        (["info", "nowhere.tif"], ("nowhere.tif",)),
        (["info", "gone.lod"], ("gone.lod",)),
        (["render", "{store}", "a.png", "--at", "2"], ("at: 2",)),
        (["bench", "no_such"], ("no_such", "draw")),
    ],
)
def test_mistakes_are_one_clear_line_and_status_2(say, store, tmp_path, words, texts):
    words = [w.format(out=tmp_path / "out", store=store) for w in words]
    if words:
        fails(say(*words), 2, *texts)
    else:
        assert say()[0] in (0, 2)
    assert not (tmp_path / "out" / "frames.csv").exists()
    assert not list(tmp_path.glob("out*.lod*")) and not (tmp_path / "out").is_file()


def test_unwritable_directory_is_a_mistake(say, store, tmp_path):
    if os.geteuid() == 0:
        target = "/proc/no-such-run"  # not even root writes there
    else:
        (tmp_path / "locked").mkdir(mode=0o500)
        target = str(tmp_path / "locked" / "run")
    fails(say("fly", store, "--out", target, "--pixel-error", "1", *SMALL), 2, target.rpartition("/")[2])


def test_an_interrupted_build_is_incomplete_by_either_name(say, folder):
    partial = folder / "half.lod.partial"
    field = lod.datasets.load("fractal:size=513")

    def stop(stage, share):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        lod._core.build(field.core, "chunked", str(folder / "half.lod"), {"leaf": 8}, "new", stop)
    assert partial.exists()
    for name in (partial, folder / "half.lod"):
        fails(say("info", name), 1, "incomplete", "--resume")


def test_a_budget_out_of_range_is_a_mistake_where_budgets_are_ignored(say, folder):
    store = folder / "ignores.lod"
    assert say("build", SOURCE, "full", store)[0] == 0
    fails(say("render", store, folder / "a.png", "--triangles", "-5"), 2, "triangles -5")


def test_a_full_disk_leaves_no_half_picture_or_mesh(store, tmp_path):
    program = "import resource, signal, sys\nfrom lodlab.cli import run\n"
    program += "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
    program += "resource.setrlimit(resource.RLIMIT_FSIZE, (2000, 2000))\nsys.exit(run(sys.argv[1:]))"
    for words in (["render", store, tmp_path / "a.png"], ["export", store, tmp_path / "a.ply"]):
        command = [sys.executable, "-c", program, *map(str, words), "--size", "96x64"]
        done = subprocess.run(command, capture_output=True, text=True, timeout=60)
        assert done.returncode == 1 and words[2].name in done.stderr and "Traceback" not in done.stderr, done.stderr
        assert not list(tmp_path.iterdir())


def test_damaged_results_are_one_line_and_status_1(say, tmp_path):
    for name in ("frames.csv", "summary.csv"):
        (tmp_path / name).write_text("")
    fails(say("report", tmp_path), 1, "frames.csv is damaged")


def test_unexpected_errors_are_one_line_and_status_1(say, monkeypatch):
    def broken():
        raise KeyError("lost")

    monkeypatch.setattr(lod, "devices", broken)
    fails(say("devices"), 1, "KeyError", "LODLAB_DEBUG=1")
    monkeypatch.setenv("LODLAB_DEBUG", "1")
    status, _, err = say("devices")
    assert status == 1 and "Traceback" in err


def test_ctrl_c_during_a_build_leaves_nothing_under_the_final_name(tmp_path):
    target = tmp_path / "big.lod"
    # Where the tests run in the background of a shell, interrupts are ignored from the start.
    command = ["env", "--default-signal=INT", sys.executable, "-m", "lodlab"]
    command += ["build", "fractal:size=4097", "chunked", str(target)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    end = time.monotonic() + 60
    while not any(tmp_path.iterdir()) and time.monotonic() < end and process.poll() is None:
        time.sleep(0.02)
    assert process.poll() is None, "the build was over before it could be stopped"
    process.send_signal(2)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "stopped" in err and "Traceback" not in err
    assert not target.exists()


def test_bench_lists_and_checks(say, monkeypatch):
    from lodlab.bench import suite

    status, out, _ = say("bench", "--list")
    assert status == 0 and all(f"{name}: " in out for name in suite.names())
    monkeypatch.setattr(suite, "run", lambda names, say: [])
    monkeypatch.setattr(suite, "check", lambda records: ["draw chunked/x: ratio_low 0.5 is below 0.95"])
    fails(say("bench", "draw", "--check"), 1, "below 0.95")
    status, out, _ = say("bench", "draw", "--json")
    assert status == 0 and json.loads(out) == []


def test_version_and_help_are_said(say):
    assert say("--version") == (0, f"lodlab {lod.__version__}\n", "")
    status, out, err = say()
    assert status == 0 and "--install-completion" in out and err == ""


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("bui", ["build"]),
        ("build jack", ["jacksboro"]),
        ("build jacksboro ", [m["name"] for m in lod.methods()]),
        ("build my", []),  # a file: the shell goes on
        ("fly a.lod --path fl", ["flyover", "flyby"]),
        ("fly a.lod --images ", ["all", "worst", "none"]),
        ("render a.lod a.png --show e", ["error"]),
        ("sweep a.toml --metrics g", ["geometry"]),
    ],
)
def test_the_shell_completes_names(line, expected, monkeypatch, capsys):
    words = f"lodlab {line}"
    monkeypatch.setenv("_LODLAB_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", words)
    monkeypatch.setenv("COMP_CWORD", str(len(words.split(" ")) - 1))
    with pytest.raises(SystemExit):
        cli.run([])
    assert capsys.readouterr().out.split() == expected
