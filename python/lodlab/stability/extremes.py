# SPDX-License-Identifier: MIT
"""Scenes s13 to s15: large coordinates, every kind of view, every kind of budget."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from .. import _core
from ..errors import Unsupported
from ..runs.flight import budget_text
from ..sources.base import Source
from ..sources.heightfield import HeightField
from ..sources.mesh import Mesh
from ..stores.session import Cut, Session
from . import fields, meshes
from .stage import Figure, Stage, Worst, chosen, look, refuses

FAR = 6.4e6  # metres: as far as Earth's surface is from its centre
SHADES = 2  # levels of 255 by which a pixel may differ and still be the same


# ---- large coordinates ----------------------------------------------------------------------------


def large_coordinates(stage: Stage) -> Iterator[Figure]:
    """Failure: planet scale. Vertices tremble and planes fight where coordinates are large.
    Test: the scene at the origin and translated by up to 6.4e6 m, under one view; a step of 1 mm of the eye, every
    captured vertex projected from both places; two level planes 1 m apart seen from 100 km. Figures: nodes that are
    chosen or morph otherwise, limit 0; share of pixels that differ by more than 2 of 255, limit 0.1 %; a vertex's
    motion on screen beyond its exact one, limit 0.5 px; pixels in which the lower plane is in front, limit 0.
    """
    if stage.source.kind == "planet":
        yield _step(stage, stage.path.views(stage.size))
    else:
        yield from _translated(stage)
    yield _planes(stage)


def _translated(stage: Stage) -> Iterator[Figure]:
    at = _placed(stage)
    shifts = [(FAR, 0.0), (-FAR, FAR)] if stage.short else [(1e4, 0), (1e5, -1e5), (1e6, 1e6), (FAR, 0), (-FAR, FAR)]
    home = stage.other("origin", at((0.0, 0.0)))
    cuts, pixels, moved = Worst(), Worst(), Worst()
    views = [_on_grid(v) for v in home.views(2 if stage.short else 4)]
    session = home.session()
    kept = [(view, home.pixel_error(1.0)) for view in views]
    here = [(session.select(view, budget)) for view, budget in kept]
    seen = [session.draw(cut, view).image for cut, view in zip(here, views, strict=True)]
    for shift in [(0.0, 0.0), *shifts]:
        there = stage.other("translated", at(shift))
        far = there.session()
        for (view, budget), cut, image in zip(kept, here, seen, strict=True):
            way = np.array([*shift, 0.0])
            away = look(view.eye + way, view.target + way, fov=view.fov, size=view.size, near=view.near)
            other = far.select(away, budget)
            draw = there.picture(far, other, away)
            changed = len(chosen(other) ^ chosen(cut)) or _morphs(other, cut)
            cuts.see(changed, draw)
            pixels.see(100.0 * _differing(far.draw(other, away).image, image), draw)
            moved.see(_beyond_exact(there, far, other, away), draw)
    yield cuts.figure("nodes chosen otherwise far from the origin", "nodes", 0)
    yield pixels.figure("pixels that differ far from the origin", "%", 0.1)
    yield moved.figure("vertex motion beyond the exact one, 1 mm step", "px", 0.5)


def _placed(stage: Stage) -> Callable[[tuple[float, float]], Source]:
    """The stage's source, moved: exactly, by whole metres."""
    if stage.on_mesh:
        positions = np.round(stage.source.positions * 2.0**20) / 2.0**20
        return lambda shift: Mesh(positions + [*shift, 0.0], stage.source.faces)
    return lambda shift: HeightField(stage.source.heights, spacing=(75.0, 92.0), origin=shift)


def _on_grid(view: _core.View) -> _core.View:
    """The view with eye and target on 64ths of a metre: translations by whole metres are then exact."""
    eye, target = (np.round(p * 64.0) / 64.0 for p in (view.eye, view.target))
    return look(eye, target, fov=view.fov, size=view.size, near=view.near)


def _morphs(a: Cut, b: Cut) -> int:
    """Nodes of two cuts of the same nodes whose morph weights differ by more than float rounding."""
    return int((np.abs(a.nodes["morph"] - b.nodes["morph"]) > 1e-4).sum())


def _differing(image: np.ndarray, other: np.ndarray) -> float:
    """Share of the pixels that differ by more than `SHADES` in some colour."""
    return float((np.abs(image.astype(int) - other.astype(int)).max(axis=2) > SHADES).mean())


def _step(stage: Stage, views: Any) -> Figure:
    session, moved = stage.session(), Worst()
    views = list(views)
    for view in views[:: max(1, len(views) // (4 if stage.short else 12))]:
        cut = session.select(view, stage.pixel_error(1.0))
        moved.see(_beyond_exact(stage, session, cut, view), stage.picture(session, cut, view))
    return moved.figure("vertex motion beyond the exact one, 1 mm step", "px", 0.5)


def _beyond_exact(stage: Stage, session: Session, cut: Cut, view: _core.View) -> float:
    """Largest motion on screen, pixels, that a step of 1 mm adds to a vertex's exact motion, three directions."""
    before = session.capture(cut, view).triangles.reshape(-1, 3)
    worst = 0.0
    for axis in np.eye(3):
        step = look(view.eye + 1e-3 * axis, view.target + 1e-3 * axis, fov=view.fov, size=view.size, near=view.near)
        after = session.capture(cut, step).triangles.reshape(-1, 3)
        if after.shape != before.shape:
            return math.inf
        (a, seen), (b, _) = _project(before, step), _project(after, step)
        apart = np.linalg.norm(a - b, axis=1)[seen]
        worst = max(worst, float(apart.max(initial=0.0)))
    return worst


def _project(points: np.ndarray, view: _core.View) -> tuple[np.ndarray, np.ndarray]:
    """(N, 2) pixel coordinates in double, relative to the eye, and (N,) whether they are inside the viewport."""
    forward = view.target - view.eye
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(right, forward), forward])
    x, y, depth = (axes @ (points - view.eye).T).astype(np.float64)
    width, height = view.size
    per = width / (2.0 * math.tan(math.radians(view.fov) / 2.0))
    ahead = depth > view.near
    depth = np.where(ahead, depth, 1.0)
    out = np.stack([per * x / depth, per * y / depth], axis=1)
    return out, ahead & (np.abs(out[:, 0]) <= width / 2) & (np.abs(out[:, 1]) <= height / 2)


def _plane(as_mesh: bool, height: float) -> Source:
    """A level plane of 128 km far from the origin."""
    if as_mesh:
        return Mesh(*meshes.moved(meshes.plate(128), [FAR, FAR - 128_000.0, height], 128_000.0))
    return HeightField(np.full((129, 129), height), spacing=1000.0, origin=(FAR, FAR))


def _planes(stage: Stage) -> Figure:
    """Level planes (on planets: spheres) at 0 and 1 m from 100 km: the upper one must be nearer in every pixel."""
    wrong = Worst()
    if stage.source.kind == "planet":
        made = [fields.sphere(height) for height in (1000.0, 1001.0)]
        up, along = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
        middle = up * (made[0].radius + 1000.0)
    else:
        made = [_plane(stage.on_mesh, h) for h in (1000.0, 1001.0)]
        up, along = np.array([0.0, 0.0, 1.0]), np.array([0.6, 0.8, 0.0])
        middle = np.array([FAR + 64_000.0, FAR - 64_000.0, 1000.0])
    stages = [stage.other(f"plane {i}", source) for i, source in enumerate(made)]
    for tilt in (0.05, 0.6, 1.2):
        eye = middle + 1e5 * (math.cos(tilt) * up + math.sin(tilt) * along)
        view = look(eye, middle, fov=20.0, size=stage.size, up=(0.0, 0.0, 1.0))
        sessions = [s.session() for s in stages]
        cuts = [s.select(view, stage.pixel_error(1.0)) for s in sessions]
        low, high = (s.draw(c, view).depth for s, c in zip(sessions, cuts, strict=True))
        both = np.isfinite(low) & np.isfinite(high)
        found = int((high >= low)[both].sum()) if both.any() else math.nan
        wrong.see(found, stages[1].picture(sessions[1], cuts[1], view))
    return wrong.figure("pixels where the lower plane is in front", "pixels", 0)


# ---- views ----------------------------------------------------------------------------------------


def extreme_views(stage: Stage) -> Iterator[Figure]:
    """Failure: views nobody tried: fields of view from 1 to 170 degrees, viewports of one pixel, the eye on the
    surface, below it, looking away, looking nowhere.
    Test: each is selected, drawn and measured. Figures: views answered with what is not finite, with an error beyond
    the promise, with holes, cracks or what else no cut may have, or with a figure where nothing is seen, limit 0;
    views that are none and are not refused with a typed error, limit 0.
    """
    session = stage.session()
    wrong, draw = [], None
    views = views_nobody_tried(stage)
    for name, view in views.items():
        for pixels in (0.5,) if stage.short else (0.5, 8.0):
            cut = session.select(view, stage.pixel_error(pixels))
            if not _answered(stage, session, cut, view):
                wrong.append(name)
                draw = draw or stage.picture(session, cut, view)
    if draw is None:
        view = views["along the ground, at the border"]
        draw = stage.picture(session, session.select(view, stage.pixel_error(0.5)), view)
    yield Figure(f"views answered wrongly{_first(wrong)}", len(wrong), "views", 0, draw())
    good = {"eye": (0.0, 0.0, 9.0), "target": (1.0, 1.0, 0.0)}
    bad = [
        {"target": good["eye"]},
        {"up": (0.0, 0.0, 0.0)},
        {"fov": 0.5},
        {"fov": 180.0},
        {"fov": math.nan},
        {"size": (0, 10)},
        {"size": (10, 20_000)},
        {"eye": (math.nan, 0.0, 0.0)},
        {"eye": (math.inf, 0.0, 0.0)},
        {"near": 0.0},
        {"near": -1.0},
    ]
    accepted = [repr(values) for values in bad if not refuses(lambda v=values: _core.View(**{**good, **v}))]
    yield Figure(f"views accepted that are none{_first(accepted)}", len(accepted), "views", 0)


def _first(names: list[str]) -> str:
    """The first of what is wrong, as a figure's name ends; empty where nothing is."""
    return f": {names[0]}" if names else ""


def views_nobody_tried(stage: Stage) -> dict[str, _core.View]:
    """Views by name; those that look away see nothing of the source."""
    low, high = stage.box
    middle = 0.5 * (low + high)
    span = float((high - low)[:2].max())
    ground, up = stage.foot
    little, deep, rise = (1e-6 * span, 0.01 * span, 0.1 * span) if stage.on_mesh else (1e-3, 30.0, 300.0)
    way = np.array([0.3, 0.9, -0.1])
    out = {f"fov {fov:g}": stage.over(fov=fov) for fov in (1.0, 5.0, 60.0, 120.0, 170.0)}
    out |= {f"{w} x {h} pixels": stage.over(size=(w, h)) for w, h in ((1, 1), (1, 64), (64, 1), (2, 3))}
    from_to = {
        "eye on the surface": (ground, ground + way * span),
        "eye 1 mm above the surface": (ground + little * up, ground + way * span),
        "eye below the surface": (ground - deep * up, ground + [span, 0.0, rise]),
        "eye far below, looking up": (middle - [0, 0, span], middle),
        "straight down": (middle + [0, 0, span], middle),
        "along the ground, at the border": (np.array([low[0], low[1], high[2]]), np.array([high[0], high[1], high[2]])),
        "from 1000 spans away": (middle + np.array([600.0, 700.0, 300.0]) * span, middle),
        "into the sky": (high + [0, 0, span], high + [0, 0, 2.0 * span]),
        "away": (low - span, low - 2.0 * span),
    }
    return out | {name: look(eye, target, size=stage.size) for name, (eye, target) in from_to.items()}


def _answered(stage: Stage, session: Session, cut: Cut, view: _core.View) -> bool:
    """Whether every figure of a frame is what it may be."""
    found = stage.examine(session, cut, view)
    sees = bool(np.isfinite(found.reference.depth).any())
    worst, claim = found.measured_px_max, cut.predicted_px
    ok = math.isfinite(claim) and claim >= 0.0 and found.image.shape == (view.size[1], view.size[0], 4)
    ok &= stage.flaws(found, cut) == 0
    ok &= math.isfinite(found.measured_max) and not math.isinf(worst)
    if not math.isnan(worst) and cut.promises_bound:
        ok &= worst <= claim + stage.pixel_slack(view)
    ok &= sees == math.isfinite(found.measured_px_rms)  # where nothing is seen: undefined by rule, not 0
    return bool(ok)


# ---- budgets --------------------------------------------------------------------------------------


def extreme_budgets(stage: Stage) -> Iterator[Figure]:
    """Failure: budgets of 0, 1, one less than a node, huge, infinite, NaN, negative, contradictory.
    Test: those that are none end in a typed error; the rest are kept, or the cheapest cut (hard budgets) or the finest
    one (pixel error) is drawn and `budget_met` is false; what counts is what was captured. Figures: budgets answered
    wrongly, limit 0; budgets accepted that are none, or of a kind that the method lacks, limit 0.
    """
    stage.need_budgets()
    session, view = stage.session(), stage.over(height=0.1)
    wrong, draw = [], None
    for values in _budgets_nobody_tried(stage, session, view):
        cut = session.select(view, _core.Budget(**values))
        if not _kept_or_missed_openly(stage, session, cut, values):
            wrong.append(budget_text(values))
            draw = draw or stage.picture(session, cut, view)
    shown = draw or stage.picture(session, cut, view)
    yield Figure(f"budgets answered wrongly{_first(wrong)}", len(wrong), "budgets", 0, shown())
    bad: list[dict[str, Any]] = [{"pixel_error": v} for v in (0, 0.0, -1.0, math.nan, -math.inf, "much")]
    bad += [{k: v} for k in ("triangles", "nodes") for v in (0, -1, 2.5, math.nan, math.inf, "many")]
    accepted = [repr(v) for v in bad if not refuses(lambda v=v: session.select(view, _core.Budget(**v)))]
    if not refuses(lambda: session.select(view, _core.Budget())):
        accepted.append("none at all")
    for kind in {"pixel_error", "triangles", "nodes"} - set(stage.budgets):
        if not refuses(lambda k=kind: session.select(view, _core.Budget(**{k: 1})), Unsupported):
            accepted.append(f"{kind}, which the method has not")
    yield Figure(f"budgets accepted that are none{_first(accepted)}", len(accepted), "budgets", 0)


def _budgets_nobody_tried(stage: Stage, session: Session, view: _core.View) -> Iterator[dict[str, Any]]:
    """Budgets as dicts, of the method's kinds alone."""
    huge = 10**18
    if "pixel_error" in stage.budgets:
        spread = np.geomspace(0.01, 1e3, 16).tolist()
        claims = {session.select(view, _core.Budget(pixel_error=v)).predicted_px for v in spread}
        just_missed = [0.999 * claim for claim in sorted(claims) if claim > 0.0]
        yield from ({"pixel_error": v} for v in (1e-300, 1e-6, *spread, *just_missed, 1e300, math.inf))
    for kind in ("triangles", "nodes"):
        if kind not in stage.budgets:
            continue
        least, most = stage.extent(session, view, kind)
        tries = {1, 2, least - 1, least, least + 1, most - 1, most, most + 1, huge, 10**30}
        yield from ({kind: v} for v in sorted(tries) if v >= 1)
        if "pixel_error" in stage.budgets:
            yield from ({"pixel_error": p, kind: v} for p, v in ((1e-9, 1), (1e9, 1), (1e9, huge), (1e-9, huge)))
    if {"triangles", "nodes"} <= set(stage.budgets):
        yield from ({"triangles": t, "nodes": n} for t, n in ((1, huge), (huge, 1), (1, 1), (huge, huge)))


def _kept_or_missed_openly(stage: Stage, session: Session, cut: Cut, values: dict[str, Any]) -> bool:
    """Law 2: what is submitted stays within hard budgets, or is the cheapest cut's and said to be over."""
    view = cut.view
    captured = session.capture(cut, view, everything=False)
    spent = {"triangles": len(captured.triangles), "nodes": len(np.unique(captured.node))}
    hard = {k: v for k, v in values.items() if k != "pixel_error"}
    over = [k for k, limit in hard.items() if spent[k] > limit]
    target = values.get("pixel_error", math.inf)
    if spent["triangles"] != cut.triangles or cut.budget_met != (not over and cut.predicted_px <= target):
        return False
    if over:  # openly: what is drawn is said to be the least that there is
        return spent == {"triangles": cut.least_triangles, "nodes": cut.least_nodes}
    if hard or cut.predicted_px <= target:
        return True
    finest = session.select(view, _core.Budget(pixel_error=1e-300))
    return np.array_equal(finest.nodes["node"], cut.nodes["node"])
