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

from .detectors import ADVERSARIES, DETECTORS, LOOSE, POP_PX, Range, caught, without_metric

TENTH = 0.1  # pixel: the crack's width, seen in the middle of the first frame
NODES = 64
FINE = NODES * 480  # triangles of all nodes at full resolution, those that vanish on their sides left out

# Who is caught by whom. The first is the detector that the adversary was made for. Others fire rightly:
# - false_twin: the finer cut that it claims has the smaller error; cuts by hand, which an audit draws, have no twin.
# - half_bounds: the law looks at the frames, the audit at every node.
# - pop: pop_px_max says how far, pop_area how much of the picture, of the same jump.
# - hole: its rim has edges without a partner (no surface without such edges leaves a sample out); through it the
#   picture shows what is behind; a sample in it is infinitely far from the surface, in the frame and in the audit.
# - disguise: filler that is to be seen before the surface is above it; filler below is slanted and no more.
# - nothing: one hole, without a rim.
EXPECTED: dict[str, tuple[str, ...]] = {
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
GAPS = {"crack": TENTH, "corner": TENTH, "disguise": 5.0, "wall": 5.0}


@pytest.fixture(scope="module", autouse=True)
def without_likeness():
    """No detector asks how alike pictures are, and FLIP alone takes two thirds of the time."""
    with pytest.MonkeyPatch.context() as patch:
        for metric in ("flip", "ssim"):
            without_metric(patch, metric)
        yield


@pytest.fixture(scope="module")
def grounds(tmp_path_factory):
    return Range(tmp_path_factory.mktemp("adversaries"))


@pytest.fixture(scope="module")
def budgets(grounds):
    """What each adversary flies under; those that exceed a budget get one that they exceed by one."""
    coarse = grounds.fly("honest").moving["predicted_px"].max()
    return {
        "over_triangles": {"triangles": FINE - 1},
        "over_nodes": {"nodes": NODES - 1},
        "over_pixels": {"pixel_error": coarse - 0.999},
    }


@pytest.fixture
def fly(grounds, budgets):
    return lambda name: grounds.fly(name, budgets.get(name, LOOSE), GAPS.get(name, 0.0))


@pytest.fixture(scope="module")
def seen(grounds, budgets, without_likeness):
    """Each adversary's evidence with every detector in place."""
    return {n: grounds.fly(n, budgets.get(n, LOOSE), GAPS.get(n, 0.0)) for n in EXPECTED}


def test_the_table_names_every_adversary_and_every_detector():
    assert set(ADVERSARIES) == {*EXPECTED, "not_a_number"}
    assert set().union(*EXPECTED.values()) == set(DETECTORS)
    for name in DETECTORS:
        assert any(name in by for by in EXPECTED.values())


@pytest.mark.parametrize("name", EXPECTED)
def test_caught_by_its_detectors_and_no_other(seen, name):
    assert caught(seen[name]) == set(EXPECTED[name])


@pytest.mark.parametrize(("name", "detector"), [(name, d) for name, by in EXPECTED.items() for d in by])
def test_without_a_detector_the_others_remain(fly, monkeypatch, name, detector):
    DETECTORS[detector].disable(monkeypatch)
    assert caught(fly(name)) == set(EXPECTED[name]) - {detector}


@pytest.mark.parametrize("name", [name for name, by in EXPECTED.items() if len(by) > 1])
def test_without_its_detectors_it_passes(fly, monkeypatch, name):
    for detector in EXPECTED[name]:
        DETECTORS[detector].disable(monkeypatch)
    assert caught(fly(name)) == set()


@pytest.mark.parametrize(
    ("name", "law", "metric"),
    [
        ("inverted", "winding", "inverted_triangles"),
        ("disguise", "fillers", "slanted_filler_triangles"),
        ("two_faced", "capture", "capture_mismatch_pixels"),
        ("two_faced_whole", "capture", "capture_mismatch_pixels"),
        ("hole", "holes", "hole_samples"),
        ("flicker", "still", "pop_px_max"),
        ("half_bounds", "error", "measured_px_max"),
    ],
)
def test_a_law_is_blind_without_its_metric(fly, monkeypatch, name, law, metric):
    assert law in EXPECTED[name]
    without_metric(monkeypatch, metric)
    assert law not in caught(fly(name))


@pytest.mark.parametrize("honest", ["honest", "computed"])
@pytest.mark.parametrize("name", ["over_triangles", "over_nodes", "over_pixels"])
def test_the_honest_pass_under_every_budget(grounds, budgets, name, honest):
    evidence = grounds.fly(honest, budgets[name])
    assert caught(evidence) == set()
    assert evidence.moving["budget_met"].all() == (name != "over_nodes"), "63 nodes cannot cover 64"


def test_the_honest_agree_at_any_mix_of_resolutions(grounds):
    """So a crack is its maker's, not the family's."""
    store = grounds.store("honest")
    session = store.core.session({})
    mixed = np.random.default_rng(4).integers(2, size=NODES).tolist()
    cut = session.cut(list(range(NODES)), mixed)
    measured = _core.Instrument(grounds.field.core).examine(session, cut, grounds.moving.view(0), pictures=False)
    assert 0 < sum(mixed) < NODES
    assert measured.crack_edges == measured.hole_samples == measured.inverted_triangles == 0
    assert len(instrument.audit(store, cuts=20, progress=False).broken) == 0


def test_the_flaws_are_as_large_as_they_say(seen):
    frames = {name: evidence.moving for name, evidence in seen.items()}
    assert (frames["honest"]["pop_px_max"].dropna() == 0.0).all() and len(frames["honest"]) == 3
    assert (frames["honest"]["nodes"] == NODES).all()
    assert (frames["crack"]["crack_edges"] == 16).all(), "eight edges, two sides"
    assert (frames["corner"]["crack_edges"] == 4).all(), "two edges, two sides"
    assert (frames["over_triangles"]["triangles"] == FINE).all() and frames["over_triangles"]["budget_met"].all()
    assert (frames["over_nodes"]["nodes"] == NODES).all() and frames["over_nodes"]["budget_met"].all()
    pops = frames["pop"].dropna(subset=["pop_px_max"])
    assert (pops["pop_px_max"] > 2 * POP_PX).all(), "several pixels"
    assert (pops["measured_px_max"] <= pops["predicted_px"]).all(), "its bounds hold"
    still = seen["flicker"].still
    assert (still["pop_px_max"].iloc[1:] > POP_PX).all() and (seen["flicker"].moving["pop_px_max"].iloc[1:] == 0).all()
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
    frames = seen["nothing"].moving
    assert (frames["hole_samples"] == frames["measured_samples"]).all() and (frames["triangles"] == 0).all()
    assert np.isinf(frames["measured_max"]).all() and np.isfinite(frames["psnr_db"]).all()
    session = grounds.store("nothing").core.session({})
    view = grounds.moving.view(0, (64, 48))
    cut = session.select(view, _core.Budget(**LOOSE))
    captured = session.capture(cut, view, True)
    assert captured.triangles.shape == (0, 3, 3) and captured.node.shape == captured.kind.shape == (0,)


def test_a_vertex_that_is_no_number_names_method_and_node(grounds):
    with pytest.raises(InvalidInput, match=r"not_a_number.*node 27"):
        grounds.fly("not_a_number")


@pytest.mark.parametrize("name", ["two_faced", "two_faced_whole"])
def test_a_flight_of_the_two_faced_ends_with_an_error(grounds, name):
    with pytest.raises(CaptureMismatch, match=r"frame 1: .* differ from the drawn frame"):
        lod.fly(grounds.store(name), grounds.moving, LOOSE, size=(64, 48), accuracy_frames=1, progress=False)


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
