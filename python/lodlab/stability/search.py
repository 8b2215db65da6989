# SPDX-License-Identifier: MIT
"""Random search: a trial (`trials`) is played, and every promise that can be checked in it is.

Promises are the laws of the instrument. A refusal is no broken promise where what was asked may be refused (an
option's value, a view out of reach); anything else that is raised is. Promises that an option gives up by nature are
rows of `by_nature.toml` for scene s20.
"""

from __future__ import annotations

import functools
import math
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from .. import _core
from ..errors import GLError, InvalidInput, StoreError, Unsupported
from ..instrument.audit import any_cut
from ..stores.build import store_for
from ..stores.methods import lacking, method_table, still
from ..stores.session import Cut, Session
from . import rules
from .meshes import doubled
from .stage import FLAWS, NO_LIMIT, Bench, pixel_slack
from .tree import Tree
from .trials import PAGING, Trial, ground_of, make_source, make_view

SCENE = "s20"
LAWS = {
    "typed": "what is refused is refused with a typed error and a reason",
    "accepted": "what a method accepts by its table it builds, opens, selects and draws",
    "finite": "a claim is a finite number, not negative",
    "error": "the measured error stays within the predicted one",
    "bounds": "no node is farther from the source than its bound",
    "source": "the finest cut is the source",
    "baseline": "drawing everything measures zero",
    "holes": "every sample is covered",
    "cracks": "nothing shows through, and every edge has its opposite",
    "flaws": "surface and fillers are wound, upright and below as they are said to be",
    "capture": "what is captured and counted is what is drawn",
    "hard": "hard budgets hold wherever a cut within them exists",
    "openly": "a missed budget is said to be missed, and what is drawn is the best there is",
    "least": "nothing costs less than the least",
    "history": "under a pixel error alone the way to a view does not matter",
    "settles": "a still camera's cut comes to rest, everything loaded",
    "caches": "what is held on the GPU stays within its cache",
}
STAGES = ("build", "draw")
FINER = 8  # times a picture's sides, to tell a crack from slits
STILL_FRAMES = 60  # after which a cut under a still camera is fixed, paging settled


@dataclass
class Found:
    """What a trial found. `checks`: how often each law was checked; `broken`: (law, sentence) pairs; `refused`: the
    reasons of what was refused, as it may be; `by_nature`: laws that an option gives up."""

    checks: Counter[str] = field(default_factory=Counter)
    broken: list[tuple[str, str]] = field(default_factory=list)
    refused: list[str] = field(default_factory=list)
    by_nature: Counter[str] = field(default_factory=Counter)


class Refused(Exception):
    """The rest of a trial, or of a frame, cannot be played: something was refused that may be."""


def play(trial: Trial, folder: Path) -> Found:
    """Plays a trial, its stores in a folder of its own, and checks every promise. Raises nothing but interrupts."""
    player = _Player(trial, folder)
    try:
        player.play()
    except Refused:
        pass
    except Exception as error:  # whatever it is: that it was raised is the find
        player.note("typed", False, f"{type(error).__name__}: {error}")
    return player.found


class _Player:
    def __init__(self, trial: Trial, folder: Path):
        self.trial, self.folder = trial, folder
        self.found = Found()
        self.table = method_table(trial.method)
        self.where = ""
        self.options: dict[str, Any] = {}

    # ---- what is noted

    def note(self, law: str, holds: bool, text: str | Callable[[], str]) -> bool:
        """Counts a check; one that does not hold is broken, or given up by nature."""
        self.found.checks[law] += 1
        if holds:
            return True
        if any(rule.covers(self.trial.method, self.options, SCENE, law) for rule in _natures()):
            self.found.by_nature[law] += 1
        else:
            self.found.broken.append((law, f"{self.where}{text if isinstance(text, str) else text()}"))
        return False

    def may_refuse(self, act: Callable[[], Any], what: str, may: bool) -> Any:
        """The value of a call; Refused when it is refused with a typed error. `may`: whether it may be."""
        try:
            return act()
        except (InvalidInput, Unsupported) as error:
            self.note("typed", len(str(error).split()) >= 4, f"{what}: no reason: {error}")
            if may or self.note("accepted", False, f"{what} is refused: {error}"):
                self.found.refused.append(f"{what}: {error}")
            raise Refused from error
        except (StoreError, GLError) as error:
            self.note("accepted", False, f"{what}: {type(error).__name__}: {error}")
            raise Refused from error

    # ---- playing

    def play(self) -> None:
        trial = self.trial
        build, draw = self.may_refuse(lambda: self.resolve(), "options", True)
        self.options = {**build, **draw}
        kinds = {o["name"]: o["type"] for o in self.table["options"]}
        self.brought = any(kinds[name] == "meshes" for name in trial.build)  # whose rims and sides are the user's
        source = self.may_refuse(lambda: make_source(trial.source), "source", True)
        self.bench = Bench(trial.name, self.folder, source)
        self.store = self.may_refuse(
            lambda: store_for(source, trial.method, trial.build, self.folder, progress=False),
            "build",
            bool(trial.build) or bool(lacking(source, trial.method)),
        )
        self.session = self.open(still(trial.method, {k: v for k, v in trial.draw.items() if k not in PAGING}))
        self.ground = ground_of(source)
        if trial.kind == "cuts":
            self.play_cuts()
            return
        flying = self.open(trial.draw) if trial.kind == "stream" else self.session
        if flying is not None:
            self.play_frames(flying)

    def resolve(self) -> tuple[dict[str, Any], dict[str, Any]]:
        return tuple(_core.resolve_options(self.trial.method, stage, getattr(self.trial, stage)) for stage in STAGES)

    def open(self, options: Mapping[str, Any]) -> Session:
        return self.may_refuse(lambda: self.store.session(**options), "session", bool(self.trial.draw))

    def play_frames(self, flying: Session) -> None:
        self.seen: dict[Any, list[tuple[int, int]]] = {}  # by view: what its cuts cost
        last = None
        for number, frame in enumerate(self.trial.frames):
            self.where = f"frame {number}: "
            try:
                view = self.may_refuse(functools.partial(make_view, self.ground, frame["view"]), "view", True)
                values = self.budget(view, frame["budget"])
                self.where = f"frame {number}, {view}, {values}: "
                cut = self.may_refuse(functools.partial(self.fly, flying, view, values), "frame", False)
            except Refused:
                continue
            last = view, values, cut
            self.check_budget(view, values, cut)
            self.check_cut(cut, view)
        if last is not None:
            self.check_last(flying, *last)

    def fly(self, flying: Session, view: _core.View, values: Mapping[str, Any]) -> Cut:
        """A frame as runs draw it."""
        try:
            core, cost = flying.core.time_frame(view, _core.Budget(**values))
        except Unsupported as error:
            if not self.trial.draw:
                raise
            self.found.refused.append(f"budget: {error}")
            raise Refused from error
        cut = Cut(core, flying)
        self.note("capture", cost["triangles"] == cut.triangles, lambda: f"{cost['triangles']} of {cut.triangles}")
        if self.trial.kind == "stream":
            limit = self.options["gpu_cache_mb"] << 20
            held = max(cost["resident_bytes"], flying.core.resident_bytes)
            self.note("caches", held <= limit, lambda: f"{held} bytes are held, the cache is {limit}")
            flying.settle()
        return cut

    # ---- budgets

    def spent(self, view: _core.View, kind: str, limit: int) -> int:
        """What the cut of one hard budget costs; 0 when options refuse the budget."""
        self.session.reset()
        cut = self.session.select(view, _core.Budget(**{kind: limit}))
        return {"triangles": cut.triangles, "nodes": cut.visible_nodes}[kind]

    def budget(self, view: _core.View, recipe: Mapping[str, Any]) -> dict[str, Any]:
        """Counts of a recipe as numbers: above the least that a view needs, or by share of what it can use."""
        out = {}
        for kind, value in recipe.items():
            if isinstance(value, (int, float)):
                out[kind] = value
                continue
            may = bool(self.trial.draw)
            least = self.may_refuse(functools.partial(self.spent, view, kind, 1), f"budget {kind}", may)
            most = self.spent(view, kind, NO_LIMIT) if value[0] == "share" else 0
            wanted = (
                least + value[1] if value[0] == "least" else max(least, 1) * (max(most, 1) / max(least, 1)) ** value[1]
            )
            out[kind] = max(1, round(wanted))
        return out

    def check_budget(self, view: _core.View, values: Mapping[str, Any], cut: Cut) -> None:
        claim = cut.predicted_px
        self.note("finite", math.isfinite(claim) and claim >= 0.0, f"predicted {claim} px")
        if not self.table["budgets"]:
            return
        cost = {"triangles": cut.triangles, "nodes": cut.visible_nodes}
        hard = {kind: limit for kind, limit in values.items() if kind in cost}
        within = all(cost[kind] <= limit for kind, limit in hard.items())
        target = values.get("pixel_error", math.inf)
        said = f"{cost}, predicted {claim:.6g} px, budget met: {cut.budget_met}"
        self.note("openly", cut.budget_met == (within and claim <= target), said)
        self.seen.setdefault(view, []).append((cut.triangles, cut.visible_nodes))
        # A budget of 1 that is kept does not say whether nothing at all would do: then the least is below it.
        least = {kind: amount if (amount := self.spent(view, kind, 1)) > 1 else 0 for kind in hard}
        for kind, amount in least.items():
            self.note("least", cost[kind] >= amount, f"{said}; said to need {amount} {kind}")
        streams = self.trial.kind == "stream"
        # What would keep a budget may not have come yet: then it is said to be missing.
        over = {} if within or (streams and cut.missing_nodes > 0) else hard
        if len(over) == 1:
            ((kind, limit),) = over.items()
            self.note("hard", least[kind] > limit, f"{said}; the least is {least[kind]} {kind}")
            self.note("openly", cost[kind] <= least[kind], f"{said}; over, and not the least, {least[kind]}")
        elif over:
            other = [c for c in self.seen[view] if all(c[i] <= hard[k] for i, k in enumerate(cost))]
            self.note("hard", not other, f"{said}; another cut of this view costs {other}")
        if hard and not streams:
            told = None if within else (cut.triangles, cut.visible_nodes)
            claimed = None if cut.least_triangles is None else (cut.least_triangles, cut.least_nodes)
            self.note("openly", claimed == told, f"{said}; the least is said to be {claimed}")
        if not hard and claim > target and not self.trial.draw and not streams:
            finest = self.session.select(view, _core.Budget(pixel_error=1e-300))
            best = finest.predicted_px
            self.note("openly", claim <= best * (1.0 + 1e-9), f"{said}; the finest cut has {best:.6g} px")

    # ---- what is measured

    def examine(self, session: Session, cut: Cut, view: _core.View) -> Any:
        """The measurement; Refused for an eye from which float positions no longer part samples."""

        def measured() -> Any:
            yardstick = self.bench.yardstick
            found = yardstick.instrument().examine(session.core, cut.core, view, yardstick.reference(view), True, None)
            return found if found.measured_px_max is not None else None

        return self.may_refuse(measured, "measure", True)

    def check_cut(self, cut: Cut, view: _core.View) -> None:
        """The laws of one drawn cut. What a streaming session recorded is drawn with everything loaded."""
        try:
            found = self.examine(self.session, cut, view)
        except Refused:
            return
        worst, claim = found.measured_px_max, cut.predicted_px
        slack, metres = pixel_slack(view), self.bench.yardstick.instrument().slack(view)
        if cut.promises_bound and not math.isnan(worst) and self.trial.kind != "cuts":  # those are no view's
            self.note("error", worst <= claim + slack, f"measured {worst:.6g} px, predicted {claim:.6g}")
        if not math.isnan(found.hole_samples):  # of meshes what is missing is an error
            self.note("holes", found.hole_samples == 0, f"{found.hole_samples} samples uncovered")
        nodes, errors = found.node_errors()
        bounds = dict(zip(cut.nodes["node"].tolist(), cut.nodes["error"].tolist(), strict=True))
        beyond = [(n, e) for n, e in zip(nodes.tolist(), errors.tolist(), strict=True) if not e <= bounds[n] + metres]
        if cut.promises_bound:
            self.note("bounds", not beyond, lambda: f"node {beyond[0][0]} is off by {beyond[0][1]:.6g} m")
        if self.trial.method == "full":
            self.note(
                "baseline",
                not worst > slack and found.measured_max <= metres + float(self.store.nodes["error"].max()),
                f"{worst:.6g} px, {found.measured_max:.6g} m",
            )
        if not self.brought:
            self.check_cracks(cut, view, found)
        for column in FLAWS:
            if self.brought and column == "inverted_triangles":
                continue
            law = "capture" if column.startswith("capture") else "flaws"
            self.note(law, not getattr(found, column) > 0, lambda c=column: f"{getattr(found, c)} {c}")
        drawn = found.drawn_triangles
        self.note("capture", math.isnan(drawn) or drawn == cut.triangles, f"{drawn} drawn, {cut.triangles} said")

    def check_cracks(self, cut: Cut, view: _core.View, found: Any) -> None:
        """A picture shows a crack only where an edge lacks its opposite, and no filler is behind. Pixels alone may be
        of a silhouette, which no sample describes between two of them, or of slits between peaks that are narrower
        than they are: in a picture `FINER` times as wide a crack keeps its share, slits lose it. Where triangles lie on
        others, no bound says where an approximation has the rim of the second sheet."""
        if doubled(self.bench.source) and cut.nodes["error"].max() > 2.0 * self.store.info()["quantum"]:
            return
        edges, pixels = found.crack_edges, found.crack_pixels
        hidden = edges > 0 and self.session.capture(cut, view).kind.any()
        shows = edges > 0 and (pixels > 0 or not hidden)
        if shows and hidden:
            near = {} if view.near is None else {"near": view.near}
            size = tuple(FINER * side for side in view.size)
            finer = _core.View(tuple(view.eye), tuple(view.target), tuple(view.up), fov=view.fov, size=size, **near)
            again = self.examine(self.session, cut, finer).crack_pixels
            shows = again >= 0.5 * FINER**2 * pixels
        self.note("cracks", not shows, f"{edges} crack edges, {pixels} crack pixels")

    def check_last(self, flying: Session, view: _core.View, values: Mapping[str, Any], cut: Cut) -> None:
        """Still and history: the last view again."""
        alone = set(values) == {"pixel_error"} or not self.table["budgets"]
        if self.trial.kind == "stream":
            budget = _core.Budget(**values)
            digests: list[str] = []
            rest = 5 + int(self.store.nodes["level"].max())  # a level comes with each frame, and may show with the last
            for _ in range(STILL_FRAMES + rest):
                digests.append(Cut(flying.core.time_frame(view, budget)[0], flying).digest)
                flying.settle()
                if len(digests) > rest and len(set(digests[-rest:])) == 1:
                    break
            self.note("settles", len(set(digests[-rest:])) == 1, f"still moving after {len(digests)} frames")
            cut = Cut(flying.core.time_frame(view, budget)[0], flying)
            self.where = f"at rest, {view}, {values}: "
            self.check_budget(view, values, cut)
            self.check_cut(cut, view)
        roomy = self.options.get("gpu_cache_mb", 1024) >= 1024 and self.options.get("cpu_cache_mb", 1024) >= 24
        if self.trial.kind == "stream" and roomy:
            self.note("settles", cut.missing_nodes == 0, f"{cut.missing_nodes} nodes never come")
        if alone and roomy and not set(self.trial.draw) - set(PAGING):
            self.session.reset()
            fresh = self.session.select(view, _core.Budget(**values))
            self.note("history", fresh.digest == cut.digest, "another cut than of a fresh session")

    def play_cuts(self) -> None:
        random = np.random.default_rng(self.trial.seed)
        for number, frame in enumerate(self.trial.frames):
            self.where = f"random cut {number}: "
            try:
                view = self.may_refuse(functools.partial(make_view, self.ground, frame["view"]), "view", True)
            except Refused:
                continue
            core = self.may_refuse(
                functools.partial(any_cut, self.session.core, self.store.nodes, random), "random cut", False
            )
            self.where = f"random cut {number}, {view}: "
            self.check_cut(Cut(core, self.session), view)
        if self.table["reproduces_source"] and not self.trial.build:
            self.check_source(view)

    def check_source(self, view: _core.View) -> None:
        cut = Tree(self.store.nodes).finest(self.session)
        try:
            found = self.examine(self.session, cut, view)
        except Refused:
            return
        quantum = float(self.store.info()["quantum"])
        slack = self.bench.yardstick.instrument().slack(view)
        self.note("source", found.measured_max <= quantum + slack, f"off by {found.measured_max:.6g} m")


@functools.cache
def _natures() -> list[rules.Rule]:
    return [rule for rule in rules.read() if rule.scene == SCENE]
