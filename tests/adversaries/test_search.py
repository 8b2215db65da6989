# SPDX-License-Identifier: MIT
"""The random search over meshes: it sees what is wrong with the adversaries, and finds nothing in the honest one."""

from __future__ import annotations

from pathlib import Path

import pytest

from lodlab.stability import search, trials
from lodlab.stability.trials import Trial, draw_trial

VIEW = {
    "kind": "orbit", "at": [0.3, 0.0], "to": [0.5, 0.5], "way": [-0.5, 0.4, 0.3], "away": 1.0, "fov": 60.0,
    "size": [96, 64], "near": None, "up": None,
}  # fmt: skip
TWO = {
    "mesh": "blob", "detail": 12, "seed": 3, "parts": 2, "damage": None, "stretch": [1.0, 1.0, 1.0], "size": 1.0,
    "shift": [0.0, 0.0, 0.0],
}  # fmt: skip
BROKEN = {
    "honest": set(),
    "half_bounds": {"bounds"},
    "spur": {"bounds"},
    "dropped": {"error", "bounds"},
    "crack": {"cracks"},
    "inverted": {"flaws"},
    "under_reports": {"capture"},
}


@pytest.mark.parametrize("method", BROKEN)
def test_what_is_wrong_with_a_mesh_is_seen(tmp_path: Path, method: str) -> None:
    build = {"gap": 0.5} if method == "spur" else {"gap": 0.01}
    frames = [{"view": VIEW | {"kind": kind}, "budget": {"pixel_error": 50.0}} for kind in ("orbit", "zoom", "over")]
    found = search.play(Trial(method, "frames", TWO, build, frames=frames), tmp_path)
    assert {law for law, _ in found.broken} == BROKEN[method] and not found.refused


def test_nothing_is_found_in_the_honest(tmp_path: Path) -> None:
    played = 0
    for index in range(20):
        trial = draw_trial("honest", 0, index)
        if "mesh" not in trial.source:
            continue
        found = search.play(trial, tmp_path / str(index))
        assert found.broken == [], trial.name
        played += 1
    assert played >= 5


def test_views_of_meshes_lie_where_their_name_says() -> None:
    mesh = trials.make_source(TWO | {"mesh": "ball", "parts": 1, "shift": [10.0, 0.0, 0.0]})
    ground = trials.ground_of(mesh)
    for kind in (*trials.VIEWS, *trials.PATHS):
        view = trials.make_view(ground, VIEW | {"kind": kind})
        away = ((view.eye - [10.0, 0.0, 0.0]) ** 2).sum() ** 0.5
        assert (away < 1.0) == (kind == "under") or kind in ("inside", "sample"), kind
