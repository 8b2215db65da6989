# SPDX-License-Identifier: MIT
"""Adversaries put through the stability suite, which knows none of them: each fails a scene, the honest ones none."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

from lodlab import stability
from lodlab.stability import stage, suite

from .detectors import ADVERSARIES, accepting

SOURCE = "fractal:size=129,seed=3"  # flaws of adversaries sit in node 27, which must be whole
SCENES = ("s01", "s05", "s10", "s12", "s15")
GAP = 20.0  # metres: what cracks and walls are made of
HONEST = ("honest", "computed")
METHODS = accepting("heightfield")


@pytest.fixture(scope="module")
def failed(tmp_path_factory: pytest.TempPathFactory) -> dict[str, set[str]]:
    """The scenes that each method fails."""

    def with_gap(source, method, options, folder: Path, **values):  # noqa: ANN001, ANN202 - as store_for
        gap = {"gap": GAP} if method in ADVERSARIES and method not in HONEST else {}
        return real(source, method, {**options, **gap}, folder, **values)

    real = stage.store_for
    scenes = [dataclasses.replace(s, short=(SOURCE,)) for s in stability.SCENES if s.name in SCENES]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(stage, "store_for", with_gap)
        patch.setattr(suite, "SCENES", tuple(scenes))
        folder = tmp_path_factory.mktemp("scenes")
        found = stability.run(folder, methods=METHODS, short=True, progress=False).failed
    return {method: set(found[found["method"] == method]["scene"]) for method in METHODS}


@pytest.mark.parametrize("method", HONEST)
def test_the_honest_fail_no_scene(failed: dict[str, set[str]], method: str) -> None:
    assert failed[method] == set()


@pytest.mark.parametrize("method", [m for m in METHODS if m not in HONEST])
def test_every_adversary_fails_a_scene(failed: dict[str, set[str]], method: str) -> None:
    assert failed[method], f"no scene of {', '.join(SCENES)} caught {method}"
