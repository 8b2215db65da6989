# SPDX-License-Identifier: MIT
"""The audit: real stores, whose bounds hold, and the same stores with bounds that do not."""

from __future__ import annotations

import importlib
import math

import numpy as np
import pytest

import lodlab as lod
from lodlab import _core
from lodlab.errors import InvalidInput, StoreError
from lodlab.instrument.audit import NOWHERE, audit, random_cut
from tests.contract import FIELDS

SMALL = {"leaf": 16, "chunk_triangles": 128}


def build(field, folder, method="chunked", **options):
    return lod.build(field, method, folder / "s.lod", progress=False, **options)


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    return build("fractal:size=129,seed=3", tmp_path_factory.mktemp("audit"), finest_error=1.0, **SMALL)


@pytest.fixture(scope="module")
def audited(store):
    return audit(store, cuts=40, progress=False)


class Changed(lod.Store):
    """A store whose node table was tampered with."""

    def __init__(self, store, change):
        super().__init__(store.core, store.source)
        self._change = change

    @property
    def nodes(self):
        return self._change(super().nodes.copy())


def halved(nodes):
    nodes["error"] /= 2
    return nodes


class Tampered:
    """An instrument, and its measurements, that see `factor` times the error and so many holes."""

    factor, hole_samples = 1.0, 0

    def __init__(self, *source):
        self._instrument = _core.Instrument(*source)

    def slack(self, view):
        return self._instrument.slack(view)

    def examine(self, *args, **keys):
        self._nodes, self._errors = self._instrument.examine(*args, **keys).node_errors()
        return self

    def node_errors(self):
        return self._nodes, self.factor * self._errors


def tamper(monkeypatch, **values):
    class Core:
        Instrument = type("Tampered", (Tampered,), values)
        View, resolve_options = _core.View, staticmethod(_core.resolve_options)

    monkeypatch.setattr(importlib.import_module("lodlab.instrument.audit"), "_core", Core)


def test_every_bound_holds_and_is_tight(store, audited):
    assert audited.broken.empty
    assert audited.nodes["holds"].all() and audited.cuts["holds"].all()
    assert set(audited.nodes["node"]) == set(store.nodes["id"].tolist())
    assert set(audited.nodes["morph"]) == {0.0, 0.5, 1.0}
    assert audited.nodes["measured"].notna().all() and audited.unmeasured == 0
    assert 1.0 - audited.slack <= audited.tightness <= 2.0
    own = audited.nodes[audited.nodes["morph"] == 1.0]
    stored = store.nodes["error"][own["node"]]
    assert (own["bound"] == stored).all() and (own["level"] == store.nodes["level"][own["node"]]).all()
    assert (own["measured"] <= stored + audited.slack).all()


def test_the_bounds_of_jacksboro_are_tight(tmp_path):
    audited = audit(build("jacksboro", tmp_path), progress=False)
    assert audited.broken.empty
    assert audited.tightness <= 2.0


def test_nodes_are_those_of_whole_cuts(store, audited):
    """The largest error of a cut's nodes is the cut's, as measured without regard to nodes."""
    session = store.core.session({"stream": False})
    instrument = _core.Instrument(store.source.core, None)
    view = lod.CameraPath.flyover(store.source, frames=1).view(0, size=(64, 64))
    listed = session.audit_cuts()
    assert audited.nodes["cut"].nunique() == len(listed)
    for number, cut in enumerate(listed):
        whole = instrument.examine(session, cut, view, pictures=False).measured_max
        rows = audited.nodes[audited.nodes["cut"] == number]
        assert len(rows) == len(cut.nodes)
        # Two eyes: vertices differ by float steps at their distances.
        assert rows["measured"].max() == pytest.approx(whole, abs=audited.slack + instrument.slack(view))


def test_stored_bounds_of_half_are_caught(store, audited):
    found = audit(Changed(store, halved), cuts=10, progress=False)
    broken = found.broken[found.broken["drawn"] == "listed"]
    assert not found.cuts["holds"].any()
    assert set(found.broken[found.broken["drawn"] == "random"]["cut"]) == set(range(10))
    own = audited.nodes[(audited.nodes["morph"] == 1.0) & (audited.nodes["ratio"] < 1.9)]
    assert len(own) > 20 and set(own["node"]) <= set(broken["node"])
    assert (broken["measured"] > broken["bound"] + found.slack).all()
    assert "BROKEN" in repr(found) and "BROKEN" in found._repr_html_()


def test_a_single_wrong_bound_is_named(store, audited):
    wrong = audited.nodes[(audited.nodes["morph"] == 1.0) & (audited.nodes["level"] == 1)].iloc[0]

    def change(nodes):
        nodes["error"][nodes["id"] == wrong["node"]] = wrong["measured"] - 2 * audited.slack
        return nodes

    found = audit(Changed(store, change), cuts=30, progress=False)
    assert set(found.broken["node"]) == {wrong["node"]}
    assert set(found.broken["drawn"]) == {"listed", "random"}


def test_bounds_as_drawn_are_held_in_every_morph(store, monkeypatch):
    tamper(monkeypatch, factor=2.0)
    found = audit(store, progress=False)
    rows = found.nodes.merge(found.broken[["cut", "node"]], on=["cut", "node"])
    assert set(rows["morph"]) == {0.0, 0.5, 1.0}
    assert 0.4 < found.tightness < 1.0


def test_a_hole_is_broken(store, monkeypatch):
    tamper(monkeypatch, hole_samples=1)
    found = audit(store, cuts=2, progress=False)
    assert set(found.broken["node"]) == {NOWHERE}
    assert np.isinf(found.broken["measured"]).all()
    assert len(found.broken) == found.nodes["cut"].nunique() + 2
    assert found.tightness >= 1.0 - found.slack


def test_nodes_without_a_sample_are_shown(tmp_path):
    heights = FIELDS["odd"]()
    heights[:70, :70] = np.nan
    store = build(lod.HeightField(heights), tmp_path, leaf=8, chunk_triangles=64)
    found = audit(store, progress=False)
    empty = found.nodes[found.nodes["measured"].isna()]
    assert found.unmeasured == empty["node"].nunique() > 0
    assert empty["ratio"].isna().all() and empty["holds"].all()
    assert set(found.nodes["node"]) == set(store.nodes["id"].tolist())
    assert f"{found.unmeasured} of them cover no sample" in repr(found)


def test_a_node_that_no_cut_draws_is_an_error(store):
    def one_more(nodes):
        nodes = np.append(nodes, nodes[-1:])
        nodes["id"][-1] += 1
        return nodes

    count = len(store.nodes)
    with pytest.raises(StoreError, match=f"1 of {count + 1} nodes are in none of the .* first node {count} at res"):
        audit(Changed(store, one_more), progress=False)


def test_a_node_drawn_outside_its_cut_is_an_error(store, monkeypatch):
    def node_errors(self):
        return np.append(self._nodes, np.uint32(7777)), np.append(self._errors, 0.0)

    tamper(monkeypatch, node_errors=node_errors)
    with pytest.raises(StoreError, match="a cut of .* nodes draws node 7777, which is none of them"):
        audit(store, progress=False)


@pytest.mark.parametrize("name", sorted(FIELDS))
def test_bounds_hold_on_every_shape(name, tmp_path):
    field = lod.HeightField(FIELDS[name](), spacing=(30.0, 40.0))
    assert audit(build(field, tmp_path, **SMALL), cuts=5, progress=False).broken.empty


@pytest.mark.parametrize("planet", [False, True])
def test_full_is_exact(planet, tmp_path):
    source = lod.HeightField(_core.fractal(91, 180).astype(float), planet=planet)
    found = audit(build(source, tmp_path, method="full"), cuts=1, progress=False)
    assert found.broken.empty and len(found.cuts) == 1
    assert (found.nodes["measured"] <= found.slack).all()
    assert math.isnan(found.tightness)
    with pytest.raises(InvalidInput, match="histogram: no node of .* is off by more than"):
        found.histogram()
    assert "every bound holds" in found._repr_html_()


def test_equal_seeds_draw_equal_cuts(store, audited):
    assert audited.cuts.equals(audit(store, cuts=40, progress=False).cuts)
    assert not audited.cuts["nodes"].equals(audit(store, cuts=40, seed=1, progress=False).cuts["nodes"])
    assert audited.cuts["nodes"].nunique() > 10
    assert audit(store, progress=False).cuts.empty


def test_random_cuts_choose_among_resolutions():
    """Two roots; the first has four children of three resolutions each."""
    rows = [(0, -1, 0, 0), (1, -1, 0, 0), *((node, 0, 1, r) for r in range(3) for node in range(2, 6))]
    nodes = np.array(rows, dtype=[("id", "i8"), ("parent", "i8"), ("level", "i4"), ("resolution", "i4")])
    random = np.random.default_rng(5)
    seen, resolutions = set(), set()
    for _ in range(200):
        ids, chosen = random_cut(nodes, random, 0.5)
        seen.add(tuple(ids.tolist()))
        if len(ids) > 2:
            resolutions |= set(zip(ids[1:].tolist(), chosen[1:].tolist(), strict=True))
            assert chosen[ids == 1].tolist() == [0]
        else:
            assert chosen.tolist() == [0, 0]
    assert seen == {(0, 1), (1, 2, 3, 4, 5)}
    assert resolutions == {(node, r) for node in range(2, 6) for r in range(3)}


def test_it_shows_itself(audited, tmp_path):
    audited.histogram().save(tmp_path / "h.png")
    assert (tmp_path / "h.png").read_bytes().startswith(b"\x89PNG")
    page = audited._repr_html_()
    assert "every bound holds" in page and "data:image/png;base64" in page
    assert "40 random cuts" in repr(audited)


def test_what_cannot_be_audited(store):
    for cuts in (-1, 1.5, True, "3"):
        with pytest.raises(InvalidInput, match="audit: cuts is .* at least 0"):
            audit(store, cuts=cuts)
    with pytest.raises(InvalidInput, match="leaves"):
        audit(store, leaves=3)
