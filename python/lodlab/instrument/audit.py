# SPDX-License-Identifier: MIT
"""The audit of a store: is every bound that it claims true of what is drawn, and is it of any use?

Every node is drawn at every resolution in every state of morph and edges that the method lists, captured and
measured against the source; then, where asked, inside random cuts, whose neighbours no list foresees. A bound holds
when nothing measured exceeds it by more than the instrument's slack. A bound that holds and is far too large is a
defect as well: `tightness` tells.
"""

from __future__ import annotations

import base64
import hashlib
import html
import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from .. import _core
from ..chart import COLOURS, INK, Chart, short
from ..errors import InvalidInput, StoreError
from ..stores.methods import still
from ..stores.store import Store, as_store

LEAST_RATIO = 0.01  # of the histogram: a bound of 0 that is broken stands there
NOWHERE = -1  # the "node" of samples that no node covers


@dataclass
class Audit:
    """What an audit measured; lengths in source units.

    `nodes`: DataFrame, a row for each node in each of the method's own cuts: `node, level, resolution, cut, morph,
    bound, measured, ratio, holds`. `bound`: as drawn in that cut; a node drawn as itself (morph 1) is held to its
    stored bound, too. `measured`: nan for a node that covers no sample (there is nothing to exceed). `ratio`:
    bound / measured, inf where nothing is off. Samples that nothing covers stand as node -1, measured inf.
    `cuts`: DataFrame, a row for each random cut: `cut, nodes, node, bound, measured, holds`: the node of the
    smallest bound / measured (one that does not hold first). `slack`: what every bound is allowed.
    """

    store: Store
    nodes: Any
    cuts: Any
    slack: float

    @cached_property
    def broken(self) -> Any:
        """DataFrame `drawn, cut, node, bound, measured`: the rows of `nodes` (drawn: listed) and of `cuts` (drawn:
        random) that do not hold."""
        import pandas as pd

        columns = ["drawn", "cut", "node", "bound", "measured"]
        tables = (("listed", self.nodes), ("random", self.cuts))
        parts = [table[~table["holds"]].assign(drawn=drawn)[columns] for drawn, table in tables]
        return pd.concat([part for part in parts if len(part)] or parts[:1], ignore_index=True)

    @property
    def _exceeding(self) -> Any:
        """Rows whose measured error is more than rounding: those that say how tight bounds are."""
        return self.nodes[(self.nodes["measured"] > self.slack) & (self.nodes["node"] != NOWHERE)]

    @property
    def tightness(self) -> float:
        """The median of bound / measured where the measured error is above the slack; nan where it never is."""
        return float(self._exceeding["ratio"].median())

    @property
    def unmeasured(self) -> int:
        """Nodes that cover no sample in any of the method's own cuts."""
        return int(self.nodes["measured"].isna().groupby(self.nodes["node"]).all().sum())

    def to_dict(self) -> dict[str, Any]:
        """The outcome as plain values, for JSON."""
        return {
            "nodes": int(self.nodes["node"].nunique()),
            "measurements": len(self.nodes),
            "random_cuts": len(self.cuts),
            "unmeasured": self.unmeasured,
            "median_bound_over_measured": self.tightness,
            "slack": self.slack,
            "broken": self.broken.to_dict("records"),
        }

    def histogram(self) -> Chart:
        """How many times larger than the measured errors the bounds are, on a logarithmic axis."""
        ratios = np.maximum(self._exceeding["ratio"].to_numpy(float), LEAST_RATIO)
        if ratios.size == 0:
            raise InvalidInput(f"histogram: no node of {self.store.path} is off by more than {self.slack:.3g}")
        exact = int((self.nodes["measured"] <= self.slack).sum())
        title = f"{self.store.path.name}: {ratios.size} measurements of {self.nodes['node'].nunique()} nodes"

        def draw(figure: Any, theme: str) -> None:
            from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullLocator

            ink = INK[theme]
            figure.set_size_inches(7.4, 3.6)
            ax = figure.subplots()
            low, high = min(ratios.min(), 1.0), max(ratios.max(), 2.0)
            each = 2.0 ** round(math.log2(40 / math.log2(high / low)))  # bins an octave; 1 is an edge
            first, last = math.floor(each * math.log2(low)) - 2, math.ceil(each * math.log2(high)) + 2
            edges = 2.0 ** (np.arange(first, last + 1) / each)
            ax.hist(ratios, edges, color=COLOURS[theme][0], edgecolor=ink["page"], linewidth=0.8)
            ax.set_xscale("log")
            ax.set_xlim(edges[0], edges[-1])
            ax.xaxis.set_major_locator(LogLocator(subs=(1, 1.2, 1.5, 2, 3, 5) if high < 8 * low else (1, 2, 5)))
            ax.xaxis.set_major_formatter(FuncFormatter(short))
            ax.xaxis.set_minor_locator(NullLocator())
            ax.yaxis.set_major_locator(MaxNLocator(6, integer=True))
            ax.set_ylim(0, 1.22 * ax.get_ylim()[1])
            ax.grid(True, axis="y", linewidth=0.6)
            ax.set_axisbelow(True)
            ax.spines[["top", "right"]].set_visible(False)
            ax.axvline(1.0, color=ink["faint"], linewidth=1.2)
            ax.axvline(self.tightness, color=ink["text"], linewidth=1.2, dashes=(4, 3))
            ax.annotate(f"median {self.tightness:.2f}", (self.tightness, 0.97), xycoords=("data", "axes fraction"),
                        xytext=(5, 0), textcoords="offset points", va="top", fontsize=8.5)  # fmt: skip
            more = f"  ·  {exact} more measurements are exact (within {self.slack:.2g})" if exact else ""
            ax.set_xlabel(f"bound / measured error (below 1: broken){more}")
            ax.set_ylabel("measurements")
            ax.set_title(title, loc="left", fontsize=10.5, fontweight="bold")

        return Chart(draw, "bound by measured error")

    def __repr__(self) -> str:
        verdict = f"{len(self.broken)} BROKEN" if len(self.broken) else "every bound holds"
        unmeasured = f", {self.unmeasured} of them cover no sample" if self.unmeasured else ""
        return (
            f"<lodlab.Audit {self.store.path.name}: {verdict}; {self.nodes['node'].nunique()} nodes in "
            f"{self.nodes['cut'].nunique()} cuts{unmeasured}, {len(self.cuts)} random cuts; "
            f"median bound / measured {self.tightness:.3g}>"
        )

    def _repr_html_(self) -> str:
        parts = [html.escape(repr(self)[1:-1])]
        if len(self.broken):
            parts.append(self.broken.head(10).to_html(index=False))
        if len(self._exceeding):
            chart = base64.b64encode(self.histogram()._repr_png_()).decode()
            parts.append(f'<img alt="bound by measured error" width="740" src="data:image/png;base64,{chart}">')
        return f"<div>{'<br>'.join(parts)}</div>"


def audit(store: Store, *, cuts: int = 0, seed: int = 0, progress: bool = True, **draw_options: Any) -> Audit:
    """Measures every bound of a store against its source.

    `cuts`: how many random cuts to draw besides, the same for the same `seed`. `draw_options`: the method's;
    everything is loaded first. InvalidInput: a negative number of cuts, an unknown option. StoreError: the source
    is not at hand, the method's own cuts leave a node out, or a cut draws a node that it does not hold.
    """
    from ..progress import tqdm

    if isinstance(cuts, bool) or not isinstance(cuts, (int, np.integer)) or cuts < 0:
        raise InvalidInput(f"audit: cuts is {cuts!r}; it is a whole number, at least 0")
    store = as_store(store)
    options = _core.resolve_options(store.method, "draw", draw_options)
    auditor = _Auditor(store, store.core.session(still(store.method, options)))
    listed = auditor.session.audit_cuts()
    auditor.check_complete(listed)
    random = np.random.default_rng(seed)
    shown = None if progress else True
    with tqdm(total=len(listed) + cuts, desc="audit", unit="cut", disable=shown, leave=False) as bar:
        rows = []
        for number, cut in enumerate(listed):
            rows.append(auditor.examine(cut).assign(cut=number))
            bar.update()
        worst: dict[bytes, tuple] = {}  # by cut: an equal one is not measured again
        order = []
        for _ in range(cuts):
            cut = any_cut(auditor.session, store.nodes, random)
            drawn = cut.nodes
            order.append(hashlib.blake2b(drawn["node"].tobytes() + drawn["resolution"].tobytes()).digest())
            if order[-1] not in worst:
                worst[order[-1]] = auditor.worst(cut)
            bar.update()
    return _assemble(auditor, rows, [worst[cut] for cut in order])


def _assemble(auditor: _Auditor, rows: list[Any], worst: list[tuple]) -> Audit:
    import pandas as pd

    columns = ["node", "level", "resolution", "cut", "morph", "bound", "measured", "ratio", "holds"]
    nodes = pd.concat(rows, ignore_index=True)[columns]
    kinds = {"nodes": int, "node": int, "bound": float, "measured": float, "holds": bool}
    random = pd.DataFrame(worst, columns=list(kinds)).astype(kinds)
    random.insert(0, "cut", np.arange(len(random)))
    return Audit(auditor.store, nodes, random, auditor.slack)


class _Auditor:
    """Measures cuts node by node, from an eye in the middle of the source: there float steps are smallest."""

    def __init__(self, store: Store, session: Any):
        self.store, self.session = store, session
        self.instrument = _core.Instrument(store.source.core, None)
        table = store.nodes
        low, high = table["box_min"].min(axis=0), table["box_max"].max(axis=0)
        eye = 0.5 * (low + high)
        self.view = _core.View(tuple(eye), tuple(eye + [high[0] - low[0], 0.0, 0.0]), size=(64, 64))
        self.slack = self.instrument.slack(self.view)
        self._table = table[np.argsort(_keys(table["id"], table["resolution"]))]
        self._keys = _keys(self._table["id"], self._table["resolution"])

    def check_complete(self, listed: list[Any]) -> None:
        """StoreError when a node is in none of the cuts at one of its resolutions."""
        seen = [_keys(cut.nodes["node"], cut.nodes["resolution"]) for cut in listed]
        left_out = self._table[~np.isin(self._keys, np.concatenate(seen) if seen else [])]
        if len(left_out):
            raise StoreError(
                f"audit of {self.store.path}: {len(left_out)} of {len(self._table)} nodes are in none of the "
                f"{len(listed)} cuts that method {self.store.method} lists, first node {left_out[0]['id']} at "
                f"resolution {left_out[0]['resolution']}"
            )

    def examine(self, cut: Any) -> Any:
        """DataFrame `node, level, resolution, morph, bound, measured, ratio, holds` of one cut as it is drawn."""
        import pandas as pd

        measurement = self.instrument.examine(self.session, cut, self.view, pictures=False)
        drawn = cut.nodes
        stored = self._table[np.searchsorted(self._keys, _keys(drawn["node"], drawn["resolution"]))]
        bound = np.where(drawn["morph"] == 1.0, np.minimum(drawn["error"], stored["error"]), drawn["error"])
        captured, errors = measurement.node_errors()
        strays = np.setdiff1d(captured, drawn["node"])
        if len(strays):
            raise StoreError(
                f"audit of {self.store.path}: a cut of {len(drawn)} nodes draws node {strays[0]}, which is none of them"
            )
        measured = pd.Series(errors, captured, dtype=float)
        rows = pd.DataFrame(
            {
                "node": drawn["node"].astype(np.int64),
                "level": stored["level"].astype(np.int64),
                "resolution": drawn["resolution"].astype(np.int64),
                "morph": drawn["morph"].astype(np.float64),
                "bound": bound,
                "measured": measured.reindex(drawn["node"]).to_numpy(),
            }
        )
        if measurement.hole_samples > 0 or not len(captured):
            hole = {"node": NOWHERE, "level": NOWHERE, "resolution": 0, "morph": math.nan, "bound": 0.0}
            rows = pd.concat([rows, pd.DataFrame([{**hole, "measured": math.inf}])], ignore_index=True)
        with np.errstate(divide="ignore", invalid="ignore"):
            rows["ratio"] = np.where(rows["measured"] == 0.0, math.inf, rows["bound"] / rows["measured"])
        rows["holds"] = ~(rows["measured"] > rows["bound"] + self.slack)
        return rows

    def worst(self, cut: Any) -> tuple[int, int, float, float, bool]:
        """How many nodes a cut has; the one that is nearest to its bound, its bound and measured error; whether all
        hold."""
        rows = self.examine(cut)
        row = rows.sort_values(["holds", "ratio"], kind="stable").iloc[0]
        return len(cut.nodes), row["node"], row["bound"], row["measured"], rows["holds"].all()


def _keys(nodes: np.ndarray, resolutions: np.ndarray) -> np.ndarray:
    """(N,) int64, one number for each node and resolution."""
    return nodes.astype(np.int64) << 16 | resolutions.astype(np.int64)


def any_cut(session: Any, nodes: np.ndarray, random: np.random.Generator) -> Any:
    """A random valid cut of a core session: the method's own where its cuts obey rules, else of any nodes at any
    resolutions. `nodes`: as `store.nodes`."""
    own = session.random_cut(int(random.integers(2**63)))
    return own if own is not None else session.cut(*random_cut(nodes, random, math.sqrt(random.random())))


def random_cut(nodes: np.ndarray, random: np.random.Generator, split: float) -> tuple[np.ndarray, np.ndarray]:
    """Ids (N,) and resolutions (N,) of a random valid cut: each inner node is split with this probability, and
    drawn at any of its resolutions. `nodes`: as `store.nodes`."""
    order = np.argsort(nodes["id"], kind="stable")
    ids, first, count = np.unique(nodes["id"][order], return_index=True, return_counts=True)
    parent, level = nodes["parent"][order][first], nodes["level"][order][first]
    above = np.searchsorted(ids, parent)  # of roots: anything
    parted = np.isin(ids, parent) & (random.random(len(ids)) < split)
    reached = parent < 0
    for depth in range(1, int(level.max()) + 1):
        here = level == depth
        reached[here] = reached[above[here]] & parted[above[here]]
    chosen = reached & ~parted
    which = first[chosen] + random.integers(count[chosen])
    return ids[chosen], nodes["resolution"][order][which].astype(np.int32)
