# SPDX-License-Identifier: MIT
"""Scenes s07 to s12: errors that nest, neighbours and corners of any levels, bounds, voids, sizes."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator

import numpy as np

from .. import _core, instrument
from ..errors import InvalidInput
from ..stores.session import Session
from . import fields, meshes
from .stage import Figure, NotApplicable, Stage, Worst, look, refuses, zero_if_unseen
from .tree import Goal

#: Bounds and errors are sums of floats and doubles: two that are equal on paper may differ by this much.
ROUNDING = 1.0 + 1e-9


def errors_nest(stage: Stage) -> Iterator[Figure]:
    """Failure: errors that do not nest. A child's projected error above its parent's breaks top-down selection,
    most easily with the eye inside a bounding volume.
    Test: 100,000 eyes (10,000 in short) inside node boxes, at their centres, corners and near their faces; each looks
    in a random direction under three falling pixel errors. Figures: eyes at which the claim is not finite, or a
    tighter budget claims a larger error, limit 0 (where a node has one resolution, so that a split can only refine,
    also spots that a tighter budget draws with a looser bound); children whose stored bound or box is not within
    their parent's, limit 0.
    """
    tree, session = stage.tree, stage.session()
    splits_refine = len(tree.nodes) == len(tree.ids)
    budgets = [stage.pixel_error(p) for p in (16.0, 1.0, 0.0625)]
    random = np.random.default_rng(7)
    wrong = Worst()
    found, draw = 0, None
    for eye in node_eyes(stage, random, 10_000 if stage.short else 100_000):
        away = random.normal(size=3) * (stage.source.extent if stage.on_mesh else 100.0)
        view = look(eye, eye + away, fov=70.0, size=stage.size)
        cuts = [session.select(view, budget) for budget in budgets]
        claims = [cut.predicted_px for cut in cuts]
        nest = all(math.isfinite(claim) for claim in claims)
        nest = nest and all(b <= a * ROUNDING for a, b in itertools.pairwise(claims))
        if nest and splits_refine:
            bounds = [tree.cover(cut.nodes) for cut in cuts]
            nest = all(np.all(b <= a * ROUNDING) for a, b in itertools.pairwise(bounds))
        if not nest:
            found, draw = found + 1, stage.picture(session, cuts[-1], view, "level")
    wrong.see(found, draw or stage.picture(session, cuts[-1], view, "level"))
    yield wrong.figure("eyes at which errors do not nest", "eyes", 0)
    child = np.flatnonzero(tree.parent >= 0)
    above = tree.parent[child]
    out = tree.fine_error[child] > tree.fine_error[above] * ROUNDING
    out |= tree.coarse_error[child] > tree.coarse_error[above] * ROUNDING
    out |= np.any((tree.low[child] < tree.low[above]) | (tree.high[child] > tree.high[above]), axis=1)
    yield Figure("children beyond their parent's bound or box", int(out.sum()), "nodes", 0)


def node_eyes(stage: Stage, random: np.random.Generator, count: int) -> Iterator[np.ndarray]:
    """Eyes at random nodes: a quarter each inside the box, at its centre, at a corner, a hair from a corner."""
    tree = stage.tree
    for i, node in enumerate(random.integers(0, len(tree.ids), count)):
        low, high = tree.low[node], tree.high[node]
        side = high - low
        corner = low + side * random.integers(0, 2, 3)
        yield (
            low + side * random.uniform(size=3),
            0.5 * (low + high),
            corner,
            corner + side * random.normal(size=3) * 1e-6,
        )[i % 4]


# ---- neighbours and corners -----------------------------------------------------------------------


def neighbours(stage: Stage) -> Iterator[Figure]:
    """Failure: neighbours many levels apart. Cracks larger than skirts; more small neighbours on an edge than the
    coarse side has vertices.
    Test: cuts by hand in which one finest node lies beside the coarsest, in every direction, as far apart as the
    method's rules let them; seen from both sides. Figures: cracks (pixels where the method draws fillers, edges where
    it does not), limit 0; the worst node's error beyond its bound and the slack, limit 0.
    """
    tree = stage.tree
    if tree.depth == 0:
        raise NotApplicable("a hierarchy of one level has no neighbours of different levels")
    spots, ways = [], set()
    for _, _, point, way in tree.edges():
        if not stage.short or tuple(way) not in ways:
            spots.append((point, way))
        ways.add(tuple(way))
    if not spots:
        raise NotApplicable("every level of the hierarchy is one node, which has no neighbours")
    inset = 1e-3 * tree.leaf_side()
    cases = [(point, way, [(point + inset * way, tree.depth)]) for point, way in spots[:24]]
    yield from cracks_and_bounds(stage, [(point, [way, -way], goals) for point, way, goals in cases])


def corners(stage: Stage) -> Iterator[Figure]:
    """Failure: corners, where three or more nodes of different levels meet.
    Test: cuts by hand round inner points where four nodes meet, each quarter at another level, from the coarsest to the
    finest that the method's rules let meet; seen from two sides. Figures and limits as for neighbours.
    """
    tree = stage.tree
    if tree.depth < 2:
        raise NotApplicable("a hierarchy of fewer than three levels has no corner where three of them meet")
    inset = 1e-3 * tree.leaf_side()
    sides = [np.array(s, dtype=float) for s in itertools.product((-1.0, 1.0), repeat=2)]
    cases = []
    for point, level in itertools.islice(tree.corners(), 2 if stage.short else 6):
        if tree.depth - level < 2:
            continue
        levels = [level, min(level + 1, tree.depth - 1), tree.depth, min(level + 2, tree.depth)]
        for turn in range(2 if stage.short else 4):
            goals = [(point + inset * sides[i], levels[(i + turn) % 4]) for i in range(4)]
            cases.append((point, [sides[0], sides[3]], goals))
    if not cases:
        raise NotApplicable("no corner of the hierarchy is one where three levels meet")
    yield from cracks_and_bounds(stage, cases)


def cracks_and_bounds(stage: Stage, cases: list[tuple[np.ndarray, list[np.ndarray], list[Goal]]]) -> Iterator[Figure]:
    """The figures of cuts by hand round points, each seen from some sides."""
    session = stage.session()
    cracks, beyond = Worst(), Worst()
    fillers = False
    for point, ways, goals in cases:
        cut = stage.tree.cut(session, goals)
        fillers |= cut.filler_triangles > 0
        for way in ways:
            view = _near(stage, point, way)
            row = stage.examine(session, cut, view)
            found = row.crack_pixels if cut.filler_triangles else row.crack_edges
            cracks.see(found + row.hole_samples, stage.picture(session, cut, view, "level"))
        beyond.see(stage.excess(session, cut, view), stage.picture(session, cut, view, "level"))
    yield cracks.figure("crack pixels" if fillers else "crack edges", "pixels" if fillers else "edges", 0)
    yield beyond.figure("error beyond bound and slack", stage.unit, 0)


def _near(stage: Stage, point: np.ndarray, way: np.ndarray) -> _core.View:
    """A leaf away from a point, looking down at it, as obliquely as nothing but ground is seen.

    Beside the sky a coarse silhouette is off by its error, and a crack could not be told from it.
    """
    side = stage.tree.leaf_side()
    low, high = stage.box
    eye = np.clip(point + side * way / np.linalg.norm(way), low[:2], high[:2])
    for height in (0.6, 1.2, 2.4):
        top = stage.height(*eye, around=side) + height * side
        view = look([*eye, top], [*point, stage.height(*point)], fov=40.0, size=stage.size)
        if np.isfinite(stage.bench.yardstick.reference(view).depth).all():
            break
    return view


# ---- bounds ---------------------------------------------------------------------------------------


def bounds_hold(stage: Stage) -> Iterator[Figure]:
    """Failure: a reported error that is no bound: a widely used simplifier's was 2 to 20 times below the truth.
    Test: law 1 along the flyover and over the whole field under pixel errors of 0.5, 2 and 8; an audit of every node in
    the method's own cuts and in random valid ones. Figures: measured screen error beyond the predicted one and the
    slack, limit 0; the worst node's error beyond its bound and the slack, limit 0.
    """
    session = stage.session()
    views = stage.views(3 if stage.short else 12)
    if stage.source.kind != "planet":
        views += [stage.over(), stage.over(height=0.03, fov=100.0)]
    screen = Worst()
    for view in views:
        for pixels in (0.5, 2.0, 8.0):
            cut = session.select(view, stage.pixel_error(pixels))
            row = stage.examine(session, cut, view, pictures=False)
            over = row.measured_px_max - cut.predicted_px - stage.pixel_slack(view)
            screen.see(math.inf if row.hole_samples > 0 else zero_if_unseen(over), stage.picture(session, cut, view))
    audited = instrument.audit(stage.store, cuts=4 if stage.short else 40, progress=False, **stage.options)
    over = [(table["measured"] - table["bound"]).max() for table in (audited.nodes, audited.cuts)]
    yield screen.figure("measured beyond predicted and slack", "px", 0)
    yield Figure("error of a node beyond bound and slack", float(max(over)) - audited.slack, stage.unit, 0)


def folded(stage: Stage) -> Iterator[Figure]:
    """Failure: folded displacement. Where the source lies over itself, or close to another sheet, it is no graph over
    a coarse face along its normals: rays miss it, or hit the wrong sheet.
    Test: views from beside and (long form) close by, under pixel errors of 16, 4 and 1, and the finest cut. Figures:
    measured screen error beyond the predicted one and the slack, limit 0; the worst node's error beyond its bound and
    the slack, limit 0; holes, cracks, inverted surface and what else no cut may have, limit 0; the largest distance of
    the finest cut to the source, either way, limit half the way from sheet to sheet: nearer to its own than to any
    other.
    """
    session = stage.session()
    screen, beyond, torn = Worst(), Worst(), Worst()
    for view in [stage.over(), *([] if stage.short else stage.views(3))]:
        for pixels in (16.0, 1.0) if stage.short else (16.0, 4.0, 1.0):
            cut = session.select(view, stage.pixel_error(pixels))
            row, draw = stage.examine(session, cut, view), stage.picture(session, cut, view)
            over = row.measured_px_max - cut.predicted_px - stage.pixel_slack(view)
            screen.see(zero_if_unseen(over), draw)
            beyond.see(stage.excess(session, cut, view), draw)
            torn.see(stage.flaws(row, cut), draw)
    cut = stage.tree.finest(session)
    finest = stage.examine(session, cut, stage.over(), pictures=False)
    beyond.see(stage.excess(session, cut, stage.over()))
    yield screen.figure("measured beyond predicted and slack", "px", 0)
    yield beyond.figure("error beyond bound and slack", stage.unit, 0)
    yield torn.figure("holes, cracks and other flaws", "flaws", 0)
    limit = 0.5 * meshes.FOLDED[stage.bench.name]
    yield Figure("distance of the finest cut", finest.measured_max, stage.unit, limit)


# ---- voids and sizes ------------------------------------------------------------------------------


def voids(stage: Stage) -> Iterator[Figure]:
    """Failure: voids. nodata -32768, -9999, NaN; at a corner, along an edge, everywhere: curtains over holes, vertices
    at the height of the mark.
    Test: views from above (where no hole hides behind its rim) at pixel errors of 1 and next to nothing, and the
    coarsest cut. Figures: pixels empty where the reference is not, or the other way round, beyond the error and a
    pixel, limit 0; vertices that are not finite or far from every height, and real samples without surface, limit 0.
    All void is no height field: refused.
    """
    if stage.bench.name in fields.REFUSED:
        yield _refused(stage)
        return
    session = stage.session()
    low, high = stage.box
    outline, bad = Worst(), Worst()
    views = [stage.over(), stage.over(height=0.8, fov=90.0), stage.over(height=1.5)]
    for view in views[: 2 if stage.short else 3]:
        for pixels in (1e-3, 1.0, 1e6):
            cut = session.select(view, stage.pixel_error(pixels))
            row = stage.examine(session, cut, view)
            draw = stage.picture(session, cut, view)
            drawn = np.isfinite(session.draw(cut, view).depth)
            wanted = np.isfinite(stage.bench.yardstick.reference(view).depth)
            reach = 1 + math.ceil(min(row.measured_px_max, 1e3))
            outline.see(_stray(drawn, wanted, reach), draw)
            corners = session.capture(cut, view).triangles.reshape(-1, 3)
            finite = np.isfinite(corners).all(axis=1)
            reached = 1.5 * (high[2] - low[2]) + 2.0 * stage.tree.coarse_error.max()
            wild = np.abs(corners[finite, 2] - 0.5 * (low + high)[2]) > reached
            bad.see((~finite).sum() + wild.sum() + row.hole_samples, draw)
    yield outline.figure("pixels off the hole's outline", "pixels", 0)
    yield bad.figure("vertices out of range, samples uncovered", "vertices, samples", 0)


def _stray(drawn: np.ndarray, wanted: np.ndarray, reach: int) -> int:
    """Pixels of one mask that are farther than `reach` from the other, or outside it by as much."""
    from scipy.ndimage import binary_dilation, binary_erosion

    square = np.ones((3, 3), bool)
    grown = binary_dilation(wanted, square, iterations=reach)
    shrunk = binary_erosion(wanted, square, iterations=reach, border_value=1)
    return int((drawn & ~grown).sum() + (shrunk & ~drawn).sum())


def _refused(stage: Stage) -> Figure:
    """What is no source, by its own rule, is refused with a typed error."""
    accepted = not refuses(lambda: stage.source)
    return Figure("accepted, though no source", int(accepted), "sources", 0)


def sizes(stage: Stage) -> Iterator[Figure]:
    """Failure: sizes that are not a power of two plus one; 1 x 1, 2 x N, 1 x N; flat fields; a spike; a cliff.
    Test: the field is built and drawn at its finest and coarsest and at a pixel error of 1. Figures: the worst node's
    error beyond its bound and the slack (at the finest, where the method reproduces its source, beyond the quantum),
    limit 0; holes, cracks, inverted surface and what else no cut may have, limit 0. Fewer than 2 x 2 samples: refused.
    """
    if stage.bench.name in fields.REFUSED:
        yield _refused(stage)
        return
    yield from _at_any_error(stage, stage.session())


def any_mesh(stage: Stage) -> Iterator[Figure]:
    """Failure: meshes that are open, of several components, of genus above 0, not manifold, with inverted, duplicate or
    flat triangles, unused vertices; slivers, one triangle, none; far from the origin.
    Test: as for sizes. A method that needs another kind of mesh refuses it, and its reason counts what is wrong; one
    that needs no other is not to refuse it. Figures: as for sizes; meshes that it should refuse and does not, or
    without a count, limit 0. No triangles are no mesh: refused.
    """
    if stage.bench.name in fields.REFUSED:
        yield _refused(stage)
        return
    if not stage.lacking:
        yield from _at_any_error(stage, stage.session())
        return
    try:
        stage.bench.store(stage.method)
    except InvalidInput as refusal:
        counts = any(c.isdigit() for c in str(refusal))
        yield Figure(f"refused: {refusal}", 0 if counts else 1, "refusals", 0)
        return
    yield Figure(f"built, though {stage.lacking}", 1, "meshes", 0)


def _at_any_error(stage: Stage, session: Session) -> Iterator[Figure]:
    view = stage.over()
    beyond, torn = Worst(), Worst()
    quantum = float(stage.store.info()["quantum"])
    for pixels in (1e-6, 1.0, 1e9):
        cut = session.select(view, stage.pixel_error(pixels))
        row = stage.examine(session, cut, view)
        draw = stage.picture(session, cut, view)
        beyond.see(stage.excess(session, cut, view), draw)
        torn.see(stage.flaws(row, cut), draw)
        if pixels < 1e-3 and stage.table["reproduces_source"]:
            exact = stage.examine(session, stage.tree.finest(session), view, pictures=False).measured_max
            beyond.see(exact - quantum - stage.bench.yardstick.instrument().slack(view), draw)
    yield beyond.figure("error beyond bound and slack", stage.unit, 0)
    yield torn.figure("holes, cracks and other flaws", "flaws", 0)
