# SPDX-License-Identifier: MIT
"""The hierarchy of a store as arrays, and valid cuts made by hand from it: some spots fine, all else coarse.

Nodes are known by their row in `ids`. Levels count from the roots (0). A node with several resolutions is
taken at its coarsest, at the spots that are to be fine at its finest.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence

import numpy as np

from ..errors import InvalidInput
from ..stores.session import Cut, Session

Goal = tuple[np.ndarray, int]  # a horizontal point (2,), and the level that its node is to have


class Tree:
    """`ids` (N,), `parent` (N,) rows or -1, `level` (N,), `low` and `high` (N, 3), from `store.nodes`."""

    def __init__(self, nodes: np.ndarray) -> None:
        self.nodes = nodes
        self.ids, first = np.unique(nodes["id"], return_index=True)
        self.parent = np.where(nodes["parent"][first] < 0, -1, np.searchsorted(self.ids, nodes["parent"][first]))
        self.level = nodes["level"][first].astype(int)
        self.low, self.high = nodes["box_min"][first], nodes["box_max"][first]
        # Finest first; of equal bounds the larger number of cells.
        order = np.lexsort((-nodes["resolution"], nodes["error"], np.searchsorted(self.ids, nodes["id"])))
        row = np.searchsorted(self.ids, nodes["id"][order])
        start = np.searchsorted(row, np.arange(len(self.ids)))
        end = np.append(start[1:], len(row)) - 1
        self.fine, self.coarse = nodes["resolution"][order][start], nodes["resolution"][order][end]
        self.fine_error, self.coarse_error = nodes["error"][order][start], nodes["error"][order][end]
        self.children: list[np.ndarray] = [np.flatnonzero(self.parent == i) for i in range(len(self.ids))]
        self.roots = np.flatnonzero(self.parent < 0)
        self.leaves = np.array([i for i, c in enumerate(self.children) if not len(c)])
        self.depth = int(self.level.max())
        self._steps = [np.flatnonzero((self.level == d) & (self.parent >= 0)) for d in range(1, self.depth + 1)]

    def cover(self, cut_nodes: np.ndarray) -> np.ndarray:
        """(leaves,) the bound, as drawn, of the node that covers each leaf in a cut."""
        out = np.full(len(self.ids), np.nan)
        out[np.searchsorted(self.ids, cut_nodes["node"])] = cut_nodes["error"]
        for step in self._steps:
            above = out[self.parent[step]]
            out[step] = np.where(np.isnan(above), out[step], above)
        return out[self.leaves]

    # ---- cuts by hand

    def holds(self, node: int, point: np.ndarray) -> bool:
        """Whether a point lies in a node's horizontal box."""
        return bool(np.all(self.low[node, :2] <= point) and np.all(point <= self.high[node, :2]))

    def refine(self, goals: Sequence[Goal]) -> list[int]:
        """The coarsest cut in which the node at every goal's point has the goal's level (or is a leaf)."""
        out, todo = [], list(self.roots)
        while todo:
            node = todo.pop()
            wanted = any(self.level[node] < level and self.holds(node, point) for point, level in goals)
            if wanted and len(self.children[node]):
                todo.extend(self.children[node])
            else:
                out.append(int(node))
        return sorted(out)

    def balance(self, cut: Sequence[int], apart: int) -> list[int]:
        """Splits nodes until those whose boxes touch are at most `apart` levels apart."""
        out = list(cut)
        while True:
            low, high, level = self.low[out, :2], self.high[out, :2], self.level[out]
            touch = np.all((low[:, None] <= high[None]) & (low[None] <= high[:, None]), axis=2)
            behind = touch & (level[None, :] - level[:, None] > apart)
            split = [i for i in np.flatnonzero(behind.any(axis=1)) if len(self.children[out[i]])]
            if not split:
                return sorted(out)
            out = [n for i, n in enumerate(out) if i not in set(split)] + [
                int(c) for i in split for c in self.children[out[i]]
            ]

    def cut(self, session: Session, goals: Sequence[Goal]) -> Cut:
        """The cut of these goals; where the method's rules refuse it, the nearest one with neighbours 4, 2, 1 apart,
        each also at the resolutions that the method gives its nodes.

        InvalidInput when the method refuses all of them.
        """
        wanted = self.refine(goals)
        for apart in (None, 4, 2, 1):
            rows = wanted if apart is None else self.balance(wanted, apart)
            spots = [any(self.holds(n, p) and self.level[n] >= d for p, d in goals) for n in rows]
            with contextlib.suppress(InvalidInput):
                return self._cut(session, rows, np.where(spots, self.fine[rows], self.coarse[rows]))
            try:
                return session.cut(self.ids[rows], None)
            except InvalidInput:
                if apart == 1:
                    raise
        raise AssertionError("unreachable")

    def finest(self, session: Session) -> Cut:
        """The cut of all leaves, at their finest."""
        return self._cut(session, self.leaves, self.fine[self.leaves])

    def _cut(self, session: Session, rows: Sequence[int], resolutions: np.ndarray) -> Cut:
        several = len(self.nodes) > len(self.ids)
        return session.cut(self.ids[rows], resolutions if several else None)

    # ---- spots

    def edges(self) -> Iterator[tuple[int, int, np.ndarray, np.ndarray]]:
        """(a, b, point, direction): coarsest neighbours, a point of their common edge, the way from b into a.

        The coarsest are the roots where there are several, else the nodes of the first level with several.
        """
        for level in range(self.depth + 1):
            nodes = np.flatnonzero(self.level == level)
            if len(nodes) > 1:
                break
        for a in nodes:
            for b in nodes:
                for axis in (0, 1):
                    across = 1 - axis
                    from_ = max(self.low[a, across], self.low[b, across])
                    to = min(self.high[a, across], self.high[b, across])
                    for sign in (-1.0, 1.0):
                        mine, its = (self.low, self.high) if sign > 0 else (self.high, self.low)
                        near = 1e-3 * (self.high[a, axis] - self.low[a, axis])
                        if a != b and abs(mine[a, axis] - its[b, axis]) <= near and from_ < to - near:
                            point, way = np.zeros(2), np.zeros(2)
                            point[axis], way[axis] = mine[a, axis], sign
                            point[across] = from_ + 0.37 * (to - from_)
                            yield int(a), int(b), point, way

    def corners(self) -> Iterator[tuple[np.ndarray, int]]:
        """(point, level): inner points where at least three nodes of a level meet, coarse levels first."""
        for level in range(self.depth):
            nodes = np.flatnonzero(self.level == level)
            for point in np.unique(self.low[nodes, :2], axis=0):
                held = np.all((self.low[nodes, :2] <= point) & (point <= self.high[nodes, :2]), axis=1)
                if held.sum() >= 3:
                    yield point, level

    def leaf_side(self) -> float:
        """The horizontal side of a leaf, metres: the median."""
        return float(np.median((self.high - self.low)[self.leaves, :2].max(axis=1)))
