# SPDX-License-Identifier: MIT
"""Adversaries put through the stability suite, which knows none of them: each fails a scene, the honest ones none."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

from lodlab import stability
from lodlab.stability import stage, suite

from .detectors import accepting

#: By kind of source: the scenes, what they are played on, and what cracks, walls and spurs are made of, source units.
PLAYED = {
    "heightfield": (("s01", "s05", "s10", "s12", "s15"), "fractal:size=129,seed=3", 20.0),  # node 27 must be whole
    "mesh": (("s01", "s05", "s10", "s15", "s16"), "mesh:two components", 0.5),
}
HONEST = ("honest", "computed")
ALL = [(kind, method) for kind in PLAYED for method in accepting(kind)]


@pytest.fixture(scope="module")
def failed(tmp_path_factory: pytest.TempPathFactory) -> dict[tuple[str, str], set[str]]:
    """The scenes that each method fails on each kind of source."""
    return {
        (kind, method): scenes
        for kind in PLAYED
        for method, scenes in play(kind, tmp_path_factory.mktemp(f"scenes-{kind}")).items()
    }


def play(kind: str, folder: Path) -> dict[str, set[str]]:
    names, source, gap = PLAYED[kind]
    methods = accepting(kind)

    def with_gap(source, method, options, folder: Path, **values):  # noqa: ANN001, ANN202 - as store_for
        more = {"gap": gap} if method in methods and method not in HONEST else {}
        return real(source, method, {**options, **more}, folder, **values)

    real = stage.store_for
    scenes = [dataclasses.replace(s, short=(source,)) for s in stability.SCENES if s.name in names]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(stage, "store_for", with_gap)
        patch.setattr(suite, "SCENES", tuple(scenes))
        found = stability.run(folder, methods=methods, short=True, progress=False).failed
    return {method: set(found[found["method"] == method]["scene"]) for method in methods}


@pytest.mark.parametrize(("kind", "method"), [each for each in ALL if each[1] in HONEST])
def test_the_honest_fail_no_scene(failed: dict[tuple[str, str], set[str]], kind: str, method: str) -> None:
    assert failed[kind, method] == set()


@pytest.mark.parametrize(("kind", "method"), [each for each in ALL if each[1] not in HONEST])
def test_every_adversary_fails_a_scene(failed: dict[tuple[str, str], set[str]], kind: str, method: str) -> None:
    assert failed[kind, method], f"no scene of {', '.join(PLAYED[kind][0])} caught {method} on a {kind}"
