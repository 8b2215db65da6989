# SPDX-License-Identifier: MIT
"""Scenes s01 to s06: cuts under a still, a trembling and a moving camera, and what budgets do to them."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from .. import _core
from ..stores.methods import options_of
from ..stores.session import Cut, Session
from .stage import NO_LIMIT, Figure, Stage, Worst, chosen, look, zero_if_unseen

SETTLED = 3  # frames after which a still camera's cut is fixed
SEEN_PX = 1.0  # a jump that is seen: what pop_area counts


def still_camera(stage: Stage) -> Iterator[Figure]:
    """Failure: split and merge forever. Dual queues cycle under a still camera, since a count is unreachable.
    Test: 100 frames of one view, reached from another, under every kind of budget; then with paging, if the method
    pages. Figure: the frame from which on nothing changes. Limit: 3; with paging a frame to fetch and one to upload
    more for each further level.
    """
    views = stage.views(2)
    worst: dict[str, Worst] = {}
    session = stage.session()
    for view, other in zip(views, reversed(views), strict=True):
        for kind, budget in stage.budget_kinds(session, view).items():
            found, cut = _frames_until_fixed(stage, session, (other, view), budget)
            worst.setdefault(kind, Worst()).see(found, stage.picture(session, cut, view, "level"))
    for kind, w in worst.items():
        yield w.figure(f"frames until fixed, {kind}", "frames", SETTLED)
    if "stream" in options_of(stage.method, "draw"):
        paging = Worst()
        for view in views:
            session = stage.session(stream=True)
            budget = stage.budget_kinds(stage.session(), view)[stage.budgets[0]]
            found, cut = _frames_until_fixed(stage, session, (view,), budget)
            paging.see(found, stage.picture(session, cut, view, "level"))
        yield paging.figure("frames until fixed, paging", "frames", SETTLED + 2 * stage.tree.depth)


def _frames_until_fixed(
    stage: Stage, session: Session, views: Sequence[_core.View], budget: _core.Budget, frames: int = 100
) -> tuple[int, Cut]:
    """Frame, counted from 1, from which the last view's cut stays the same, and that cut."""
    for view in views[:-1]:
        stage.frame(session, view, budget)
    fixed, before = 1, None
    for f in range(1, frames + 1):
        cut = stage.frame(session, views[-1], budget)
        session.settle()
        now = cut.digest
        if before is not None and now != before:
            fixed = f
        before = now
    return fixed, cut


def thresholds(choose: Callable[[float], frozenset], low: float, high: float, whole: bool, count: int) -> list[float]:
    """Budgets at which a cut changes, found by bisection between neighbours of a geometric row of them.

    The budget that is returned and the one just below it give different cuts. Whole numbers for counts.
    """
    row = np.geomspace(low, high, 4 * count)
    out = []
    for a, b in zip(row[:-1], row[1:], strict=True):
        a, b = (round(a), round(b)) if whole else (float(a), float(b))
        first = choose(a)
        if len(out) == count or choose(b) == first:
            continue
        while b - a > (1 if whole else 1e-13 * b):
            middle = (a + b) // 2 if whole else 0.5 * (a + b)
            a, b = (middle, b) if choose(middle) == first else (a, middle)
        out.append(b)
    return out


def budget_thresholds(stage: Stage) -> Iterator[Figure]:
    """Failure: budget thrash. A band between refine and coarsen smaller than a node makes detail oscillate.
    Test: budgets at which the cut changes, found by bisection (where none does, the loosest and the tightest); at each,
    and next to it, the camera holds still for 20 frames after a far looser and a far tighter budget. Figure: changes
    after frame 3. Limit: 0.
    """
    stage.need_budgets()
    view = stage.over(height=0.2)
    session = stage.session()
    count = 6 if stage.short else 12
    for kind in stage.budgets:
        whole = kind != "pixel_error"
        low, high = stage.extent(session, view, kind) if whole else (0.05, 64.0)

        def choose(value: float, kind: str = kind) -> frozenset:
            return chosen(session.select(view, _core.Budget(**{kind: value})))

        worst = Worst()
        low, high = (max(low, 1), high + 1) if whole else (low, high)
        for value in thresholds(choose, low, high, whole, count) or [low, high]:
            step = 1 if whole else value * 1e-12
            for held in (value - step, value, value + step):
                for start in (low, high):
                    changes, cut = _changes(stage, session, view, {kind: start}, {kind: max(held, step)})
                    worst.see(changes, stage.picture(session, cut, view, "level"))
        yield worst.figure(f"changes at a threshold, {kind}", "changes", 0)


def _changes(stage: Stage, session: Session, view: _core.View, start: dict, held: dict) -> tuple[int, Cut]:
    """Changes of the cut after the frames that it has to settle, coming from another budget."""
    for _ in range(3):
        stage.frame(session, view, _core.Budget(**start))
    cuts = [stage.frame(session, view, _core.Budget(**held)) for _ in range(20)]
    digests = [cut.digest for cut in cuts[SETTLED - 1 :]]
    return sum(a != b for a, b in zip(digests[:-1], digests[1:], strict=True)), cuts[-1]


def history(stage: Stage) -> Iterator[Figure]:
    """Failure: history. What is drawn depends on where the camera was before.
    Test: one view is reached along 20 paths from far, near, behind and above in one session; its cut is compared with
    a fresh session's. Figure: arrivals whose cut differs, under the worst kind of budget. Limit: 0.
    """
    random = np.random.default_rng(3)
    view = stage.views(5)[3]
    session = stage.session()
    reach = float(np.linalg.norm(view.target - view.eye))
    worst = Worst()
    for budget in stage.budget_kinds(session, view).values():
        fresh = stage.frame(stage.session(), view, budget).digest
        differ = 0
        for _ in range(20):
            way = random.normal(size=3)
            start = view.eye + way / np.linalg.norm(way) * reach * 10.0 ** random.uniform(-1.0, 0.7)
            for t in np.linspace(0.0, 1.0, 8)[:-1]:
                there = look((1 - t) * start + t * view.eye, view.target, fov=view.fov, size=view.size)
                stage.frame(session, there, budget)
            cut = stage.frame(session, view, budget)
            differ += cut.digest != fresh
        worst.see(differ, stage.picture(session, cut, view, "level"))
    yield worst.figure("arrivals with another cut, of 20", "cuts", 0)


def jitter(stage: Stage) -> Iterator[Figure]:
    """Failure: jitter. A camera that trembles by a pixel makes nodes flip, seen again and again.
    Test: at spots of the flyover where the cut is about to change, 300 frames that tremble by a pixel (30 in short),
    then forward, back, forward over it; where nodes flip, the jump of the picture is measured. Figure: the largest
    jump that one node takes part in twice, under each kind of budget. Limit: 1 px: no change is seen twice.
    """
    session = stage.session()
    random = np.random.default_rng(4)
    for kind, budget in stage.budget_kinds(session, stage.views(1)[0]).items():
        worst = Worst()
        for t in _turning_points(stage, session, budget, 3 if stage.short else 4):
            spot = stage.path.view_at(t, stage.size)
            tremble = [shaken(spot, random) for _ in range(30 if stage.short else 300)]
            steps = np.clip(t + 1e-4 * np.arange(-5, 6), 0.0, 1.0)
            there = [stage.path.view_at(float(at), stage.size) for at in steps]
            for views in (tremble, [*there, *reversed(there), *there]):
                worst.see(*_seen_twice(stage, session, views, budget))
        yield worst.figure(f"largest jump seen twice, {kind}", "px", SEEN_PX)


def _turning_points(stage: Stage, session: Session, budget: _core.Budget, count: int) -> list[float]:
    """Path times at which the chosen nodes change, one in each part of the flyover; the part's middle where none do."""

    def at(t: float) -> frozenset:
        return chosen(session.select(stage.path.view_at(t, stage.size), budget))

    out = []
    for part in range(count):
        times = np.linspace(0.2 + 0.7 * part / count, 0.2 + 0.7 * (part + 1) / count, 50).tolist()
        cuts = [at(t) for t in times]
        turns = [i for i in range(len(cuts) - 1) if cuts[i] != cuts[i + 1]]
        if not turns:
            out.append(times[len(times) // 2])
            continue
        most = max(turns, key=lambda i: len(cuts[i] ^ cuts[i + 1]))
        (a, b), before = times[most : most + 2], cuts[most]
        while b - a > 1e-9:
            middle = 0.5 * (a + b)
            a, b = (middle, b) if at(middle) == before else (a, middle)
        out.append(b)
    return out


def shaken(view: _core.View, random: np.random.Generator) -> _core.View:
    """The view moved and turned by at most a pixel: what is at the target moves by at most two on screen."""
    forward = view.target - view.eye
    distance = float(np.linalg.norm(forward))
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    up = np.cross(right, forward) / distance
    pixel = distance * 2.0 * math.tan(math.radians(view.fov) / 2.0) / view.size[0]
    moved, turned = (
        pixel * math.sqrt(random.uniform()) * (math.cos(a) * right + math.sin(a) * up)
        for a in random.uniform(0.0, 2.0 * math.pi, 2)
    )
    return look(view.eye + moved, view.target + moved + turned, fov=view.fov, size=view.size)


def _seen_twice(
    stage: Stage, session: Session, views: Sequence[_core.View], budget: _core.Budget
) -> tuple[float, Callable[[], np.ndarray]]:
    """The largest jump, pixels, that some node flips in at least twice, and how to draw a frame that shows it.

    A change from one choice of nodes to another is measured the first two times: twice is what is asked for.
    """
    jumps: dict[tuple[int, int], list[float]] = defaultdict(list)
    times: Counter = Counter()
    before, twice, draw = None, 0.0, None
    for view in views:
        cut = stage.frame(session, view, budget)
        change = (chosen(before), chosen(cut)) if before is not None else (frozenset(), frozenset())
        changed = change[0] ^ change[1]
        times[change] += 1
        if changed and times[change] <= 2:
            jump = zero_if_unseen(stage.examine(session, cut, view, before, pictures=False).pop_px_max)
            for node in changed:
                jumps[node].append(jump)
                second = sorted(jumps[node])[-2] if len(jumps[node]) > 1 else 0.0
                if second > twice:
                    twice, draw = second, stage.picture(session, cut, view, "level")
        before = cut
    return twice, draw or stage.picture(session, before, views[-1], "level")


def everything_pops(stage: Stage) -> Iterator[Figure]:
    """Failure: everything pops at once. Nodes of equal error flip together.
    Test: along the flyover in small steps at a pixel error of 1, the steps in which most nodes change are measured.
    Figures: largest share of the screen that jumps by more than 1 px in one step, limit 1 %; largest jump, limit
    2.1 px: both surfaces are within 1 px of the source, and between two steps that error grows by less than a tenth.
    """
    budget = stage.pixel_error(1.0)
    session = stage.session()
    views = list(stage.path.dense(8).views(stage.size))
    cuts = [session.select(view, budget) for view in views]
    changed = [len(chosen(a) ^ chosen(b)) for a, b in zip(cuts[:-1], cuts[1:], strict=True)]
    most = sorted(range(len(changed)), key=lambda i: -changed[i])[: 12 if stage.short else 30]
    most = [i for i in most if changed[i]] or most[:3]
    area, jump = Worst(), Worst()
    for i in most:
        found = stage.examine(session, cuts[i + 1], views[i + 1], cuts[i])
        draw = stage.picture(session, cuts[i + 1], views[i + 1], "level")
        area.see(100.0 * zero_if_unseen(found.pop_area), draw)
        jump.see(zero_if_unseen(found.pop_px_max), draw)
    yield area.figure("share of the screen that pops", "%", 1.0)
    yield jump.figure("largest pop", "px", 2.1)


def triangles_respond(stage: Stage) -> Iterator[Figure]:
    """Failure: a budget that changes nothing, since the hierarchy has one level.
    Test: triangles in a view of everything, from the loosest budget to the tightest. Figures: decades missing of
    three between fewest and most, limit 0; times that a tighter budget gives fewer triangles, limit 0.
    """
    stage.need_budgets("pixel_error", "triangles")
    kind = "pixel_error" if "pixel_error" in stage.budgets else "triangles"
    view = stage.over(height=1.5, fov=80.0)
    session = stage.session()
    row = np.geomspace(1e5, 1e-4, 37) if kind == "pixel_error" else np.geomspace(1, NO_LIMIT, 37).round().astype(int)
    cuts = [session.select(view, _core.Budget(**{kind: value.item()})) for value in row]
    counts = np.array([cut.triangles for cut in cuts], dtype=float)
    missing = 3.0 - math.log10(counts.max() / counts.min())
    shown = session.draw(cuts[len(cuts) // 2], view, "level").image
    yield Figure("decades of triangles missing of three", max(missing, 0.0), "decades", 0.0, shown)
    fewer = [i for i in range(1, len(row)) if counts[i] < counts[i - 1]]
    yield Figure("tighter budgets with fewer triangles", len(fewer), "budgets", 0)
