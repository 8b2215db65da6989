# SPDX-License-Identifier: MIT
"""Every adversary is caught by the detectors made for it and by no other; without them it passes.

So a detector that stops working is found, and so is one that cries where nothing is wrong.
"""

from __future__ import annotations

import numpy as np
import pytest

import lodlab as lod
from lodlab import _core, instrument
from lodlab.errors import InvalidInput
from lodlab.runs.passes import CaptureMismatch

from .detectors import DETECTORS, LOOSE, POP_PX, Range, accepting, caught, without_metric

TENTH = 0.1  # pixel: the crack's width, seen in the middle of the first frame
NODES = 64
FINE = NODES * 480  # triangles of all nodes at full resolution, those that vanish on their sides left out
FIELD, MESH = "heightfield", "mesh"
PATCHES, FACES = 9, 2384  # of the mesh: eight octants of the ball, and the bowl, which lies in one

# Who is caught by whom. The first is the detector that the adversary was made for. Others fire rightly:
# - false_twin: the finer cut that it claims has the smaller error; cuts by hand, which an audit draws, have no twin.
# - half_bounds: the law looks at the frames, the audit at every node.
# - pop: pop_px_max says how far, pop_area how much of the picture, of the same jump.
# - hole: its rim has edges without a partner (no surface without such edges leaves a sample out); through it the
#   picture shows what is behind; a sample in it is infinitely far from the surface, in the frame and in the audit.
# - disguise: filler that is to be seen before the surface is above it; filler below is slanted and no more.
# - nothing: one hole, without a rim.
# On the mesh a hole's bound says how far the source is from its rim, so that edges and picture alone show it; a
# surface turned inside out shows its inside in the picture.
# - dropped: what is missing shows as distance from the source.
# - spur: no vertex of the source is far from what is drawn; what is drawn is far from it.
ON_FIELD: dict[str, tuple[str, ...]] = {
    "honest": (),
    "computed": (),
    "false_twin": ("error",),
    "half_bounds": ("error", "audit"),
    "crack": ("crack_edges",),
    "corner": ("crack_edges",),
    "pop": ("pop_px_max", "pop_area"),
    "flicker": ("still",),
    "over_triangles": ("budgets",),
    "over_nodes": ("budgets",),
    "over_pixels": ("pixel_error",),
    "hole": ("holes", "crack_edges", "crack_pixels", "error", "finite", "audit"),
    "inverted": ("winding",),
    "two_faced": ("capture",),
    "two_faced_whole": ("capture",),
    "disguise": ("fillers", "raised"),
    "wall": ("raised",),
    "under_reports": ("counts",),
    "nothing": ("holes", "crack_pixels", "error", "finite", "audit"),
}
ON_MESH: dict[str, tuple[str, ...]] = {
    "honest": (),
    "half_bounds": ("error", "audit"),
    "spur": ("audit",),
    "dropped": ("error", "audit"),
    "crack": ("crack_edges",),
    "pop": ("pop_px_max", "pop_area"),
    "flicker": ("still",),
    "over_triangles": ("budgets",),
    "over_nodes": ("budgets",),
    "over_pixels": ("pixel_error",),
    "hole": ("crack_edges", "crack_pixels"),
    "inverted": ("winding", "crack_pixels"),
    "two_faced": ("capture",),
    "two_faced_whole": ("capture",),
    "under_reports": ("counts",),
    "nothing": ("crack_pixels", "error", "finite", "audit"),
}
OF_MESHES = ("half_bounds", "spur", "dropped", "crack", "hole", "inverted")  # whose flaws are the mesh's own
EXPECTED = {FIELD: ON_FIELD, MESH: ON_MESH}
ALL = [(kind, name) for kind, names in EXPECTED.items() for name in names]
GAPS = {
    FIELD: {"crack": TENTH, "corner": TENTH, "disguise": 5.0, "wall": 5.0},
    MESH: {"crack": 0.01 * TENTH, "spur": 20.0},  # a node that moves as a whole shows against what is behind it
}


@pytest.fixture(scope="module", autouse=True)
def without_likeness():
    """No detector asks how alike pictures are, and FLIP alone takes two thirds of the time."""
    with pytest.MonkeyPatch.context() as patch:
        for metric in ("flip", "ssim"):
            without_metric(patch, metric)
        yield


@pytest.fixture(scope="module")
def grounds(tmp_path_factory):
    return {kind: Range(tmp_path_factory.mktemp(f"adversaries-{kind}"), kind) for kind in EXPECTED}


@pytest.fixture(scope="module")
def budgets(grounds):
    """What each adversary flies under; those that exceed a budget get one that they exceed by one."""

    def of(kind, nodes, fine):
        coarse = grounds[kind].fly("honest").moving["predicted_px"].max()
        return {
            "over_triangles": {"triangles": fine - 1},
            "over_nodes": {"nodes": nodes - 1},
            "over_pixels": {"pixel_error": coarse - 0.999},
        }

    return {FIELD: of(FIELD, NODES, FINE), MESH: of(MESH, PATCHES, FACES)}


@pytest.fixture(scope="module")
def fly(grounds, budgets, without_likeness):
    return lambda kind, name: grounds[kind].fly(name, budgets[kind].get(name, LOOSE), GAPS[kind].get(name, 0.0))


@pytest.fixture(scope="module")
def seen(fly):
    """Each adversary's evidence with every detector in place."""
    return {(kind, name): fly(kind, name) for kind, name in ALL}


def test_the_table_names_every_adversary_and_every_detector():
    for kind, names in EXPECTED.items():
        assert set(accepting(kind)) == {*names, "not_a_number"}
    assert set().union(*ON_FIELD.values()) == set(DETECTORS)
    assert set().union(*ON_MESH.values()) == set(DETECTORS) - {"holes", "fillers", "raised"}, "those of fields"


@pytest.mark.parametrize(("kind", "name"), ALL)
def test_caught_by_its_detectors_and_no_other(seen, kind, name):
    assert caught(seen[kind, name]) == set(EXPECTED[kind][name])


@pytest.mark.parametrize(("name", "detector"), [(n, d) for n, by in ON_FIELD.items() for d in by])
def test_without_a_detector_the_others_remain(fly, monkeypatch, name, detector):
    DETECTORS[detector].disable(monkeypatch)
    assert caught(fly(FIELD, name)) == set(ON_FIELD[name]) - {detector}


@pytest.mark.parametrize(
    ("kind", "name"), [(k, n) for k, n in ALL if (len(ON_FIELD[n]) > 1 if k == FIELD else n in OF_MESHES)]
)
def test_without_its_detectors_it_passes(fly, monkeypatch, kind, name):
    for detector in EXPECTED[kind][name]:
        DETECTORS[detector].disable(monkeypatch)
    assert caught(fly(kind, name)) == set()


@pytest.mark.parametrize(
    ("kind", "name", "law", "metric"),
    [
        (FIELD, "inverted", "winding", "inverted_triangles"),
        (FIELD, "disguise", "fillers", "slanted_filler_triangles"),
        (FIELD, "two_faced", "capture", "capture_mismatch_pixels"),
        (FIELD, "two_faced_whole", "capture", "capture_mismatch_pixels"),
        (FIELD, "hole", "holes", "hole_samples"),
        (FIELD, "flicker", "still", "pop_px_max"),
        (FIELD, "half_bounds", "error", "measured_px_max"),
        (MESH, "inverted", "winding", "inverted_triangles"),
        (MESH, "dropped", "error", "measured_px_max"),
    ],
)
def test_a_law_is_blind_without_its_metric(fly, monkeypatch, kind, name, law, metric):
    assert law in EXPECTED[kind][name]
    without_metric(monkeypatch, metric)
    assert law not in caught(fly(kind, name))


@pytest.mark.parametrize(("kind", "honest"), [(FIELD, "honest"), (FIELD, "computed"), (MESH, "honest")])
@pytest.mark.parametrize("name", ["over_triangles", "over_nodes", "over_pixels"])
def test_the_honest_pass_under_every_budget(grounds, budgets, name, kind, honest):
    evidence = grounds[kind].fly(honest, budgets[kind][name])
    assert caught(evidence) == set()
    assert evidence.moving["budget_met"].all() == (name != "over_nodes"), "63 nodes cannot cover 64"


@pytest.mark.parametrize(("kind", "nodes"), [(FIELD, NODES), (MESH, PATCHES)])
def test_the_honest_agree_at_any_mix_of_resolutions(grounds, kind, nodes):
    """So a crack is its maker's, not the family's."""
    store = grounds[kind].store("honest")
    session = store.core.session({})
    mixed = np.random.default_rng(4).integers(2, size=nodes).tolist()
    cut = session.cut(list(range(nodes)), mixed)
    measured = _core.Instrument(grounds[kind].source.core).examine(
        session, cut, grounds[kind].moving.view(0), pictures=False
    )
    assert 0 < sum(mixed) < nodes
    assert measured.crack_edges == measured.inverted_triangles == 0
    assert measured.hole_samples == 0 or kind == MESH
    assert len(instrument.audit(store, cuts=20, progress=False).broken) == 0


def test_the_flaws_of_meshes_are_as_large_as_they_say(seen, grounds):
    frames = {name: evidence.moving for (kind, name), evidence in seen.items() if kind == MESH}
    honest = frames["honest"]["triangles"]
    assert (
        (frames["honest"]["nodes"] == PATCHES).all() and (0.3 * FACES < honest).all() and (honest < 0.4 * FACES).all()
    )
    assert (frames["inverted"]["inverted_triangles"] == honest).all()
    gap = GAPS[MESH]["spur"] * grounds[MESH].pixel
    spur = frames["spur"]
    assert np.allclose(spur["measured_max_drawn_to_source"], gap, rtol=0.1)
    to_drawn = "measured_max_source_to_drawn"
    assert np.allclose(spur[to_drawn], frames["honest"][to_drawn], rtol=1e-3), "as if it were not there"
    dropped = frames["dropped"]
    assert (dropped[to_drawn] > 1.0).all() and (dropped["triangles"] < honest).all()
    assert (frames["hole"]["crack_edges"] == FACES - frames["hole"]["triangles"]).all(), "a fan, and its rim"
    assert (frames["pop"].dropna(subset=["pop_px_max"])["pop_px_max"] > 2 * POP_PX).all()


def test_the_flaws_are_as_large_as_they_say(seen):
    frames = {name: evidence.moving for (kind, name), evidence in seen.items() if kind == FIELD}
    assert (frames["honest"]["pop_px_max"].dropna() == 0.0).all() and len(frames["honest"]) == 3
    assert (frames["honest"]["nodes"] == NODES).all()
    assert (frames["crack"]["crack_edges"] == 16).all(), "eight edges, two sides"
    assert (frames["corner"]["crack_edges"] == 4).all(), "two edges, two sides"
    assert (frames["over_triangles"]["triangles"] == FINE).all() and frames["over_triangles"]["budget_met"].all()
    assert (frames["over_nodes"]["nodes"] == NODES).all() and frames["over_nodes"]["budget_met"].all()
    pops = frames["pop"].dropna(subset=["pop_px_max"])
    assert (pops["pop_px_max"] > 2 * POP_PX).all(), "several pixels"
    assert (pops["measured_px_max"] <= pops["predicted_px"]).all(), "its bounds hold"
    still = seen[FIELD, "flicker"].still
    assert (still["pop_px_max"].iloc[1:] > POP_PX).all() and (
        seen[FIELD, "flicker"].moving["pop_px_max"].iloc[1:] == 0
    ).all()
    assert (frames["hole"]["hole_samples"] == 9).all() and (frames["hole"]["crack_edges"] == 8).all()
    assert (frames["inverted"]["inverted_triangles"] == NODES * 128).all()
    assert (frames["disguise"]["slanted_filler_triangles"] == NODES * 128).all()
    assert (frames["wall"]["raised_filler_triangles"] == NODES * 32).all()
    for column in ("triangles", "drawn_triangles", "measured_px_max"):
        assert (frames["false_twin"][column] == frames["honest"][column]).all(), "it draws what the honest do"
    assert (frames["false_twin"]["predicted_px"] < 0.6 * frames["honest"]["predicted_px"]).all()
    told = frames["under_reports"]
    assert (told["drawn_triangles"] - told["triangles"] == NODES).all(), "one a node"


def test_nothing_drawn_is_measured_and_not_a_failure(seen, grounds):
    frames = seen[FIELD, "nothing"].moving
    assert (frames["hole_samples"] == frames["measured_samples"]).all() and (frames["triangles"] == 0).all()
    assert np.isinf(frames["measured_max"]).all() and np.isfinite(frames["psnr_db"]).all()
    session = grounds[FIELD].store("nothing").core.session({})
    view = grounds[FIELD].moving.view(0, (64, 48))
    cut = session.select(view, _core.Budget(**LOOSE))
    captured = session.capture(cut, view, True)
    assert captured.triangles.shape == (0, 3, 3) and captured.node.shape == captured.kind.shape == (0,)


@pytest.mark.parametrize(("kind", "node"), [(FIELD, 27), (MESH, 0)])
def test_a_vertex_that_is_no_number_names_method_and_node(grounds, kind, node):
    with pytest.raises(InvalidInput, match=rf"not_a_number.*node {node}"):
        grounds[kind].fly("not_a_number")


@pytest.mark.parametrize("name", ["two_faced", "two_faced_whole"])
def test_a_flight_of_the_two_faced_ends_with_an_error(grounds, name):
    with pytest.raises(CaptureMismatch, match=r"frame 1: .* differ from the drawn frame"):
        lod.fly(
            grounds[FIELD].store(name), grounds[FIELD].moving, LOOSE, size=(64, 48), accuracy_frames=1, progress=False
        )


def test_captures_larger_than_the_first_buffer_are_whole(tmp_path):
    """28 bytes a vertex, 16 MiB: more than 200,000 triangles in one batch make the buffer grow."""
    field = lod.datasets.load("fractal:size=513,seed=3")
    store = lod.build(field, "honest", tmp_path / "large.lod", progress=False)
    session = store.core.session({})
    nodes = 32 * 32
    cut = session.cut(list(range(nodes)), [1] * nodes)
    view = lod.CameraPath.flyover(field, 2).view(0, (64, 48))
    captured = session.capture(cut, view, True)
    assert cut.triangles == nodes * 480 > 200_000
    assert len(captured.triangles) == cut.triangles and np.isfinite(captured.triangles).all()
    assert (np.bincount(captured.node, minlength=nodes) == 480).all()
    measured = _core.Instrument(field.core).examine(session, cut, view, pictures=False)
    assert measured.hole_samples == measured.crack_edges == 0
