# SPDX-License-Identifier: MIT
"""One slack, from how positions are rounded: `full` has no holes wherever the instrument measures it, and eyes too far
away to part samples are refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import lodlab as lod
from lodlab import _core, errors
from lodlab.instrument.metrics import pixel_slack

Vec = tuple[float, float, float]
PX1 = _core.Budget(pixel_error=1.0)


class Ground:
    """`full` of a field, measured without pictures."""

    def __init__(self, field: lod.HeightField, folder: Path) -> None:
        self.field = field
        self.instrument = _core.Instrument(field.core, None)
        self.session = lod.build(field, "full", folder / "full.lod", progress=False).core.session({})

    def sample(self, row: int, col: int) -> np.ndarray:
        return self.field.core.position(np.array([row]), np.array([col]))[0]

    def examine(self, eye: Vec, target: Vec, **values: float) -> tuple[_core.Measurement, _core.View]:
        view = _core.View(tuple(eye), tuple(target), size=(64, 48), **values)
        return self.instrument.examine(self.session, self.session.select(view, PX1), view, pictures=False), view

    def is_whole(self, eye: Vec, target: Vec, **values: float) -> None:
        found, view = self.examine(eye, target, **values)
        assert (found.hole_samples, found.crack_edges, found.inverted_triangles) == (0, 0, 0), eye
        assert not found.measured_px_max > pixel_slack(view)


def test_no_border_sample_is_lost_to_an_eye_within_a_cell_of_it(tmp_path: Path) -> None:
    """The eye's part of a cell is rounded by the size of a cell: 16 of 75 such views had holes."""
    ground, random = Ground(lod.HeightField(np.zeros((8, 8)), spacing=30.0), tmp_path), np.random.default_rng(1)
    for away in (10.0, 1.0, 0.1, 0.01):
        for _ in range(25):
            at, u = ground.sample(int(random.integers(8)), 0), random.normal(size=3)
            u[2] = abs(u[2])
            ground.is_whole(at + u / np.linalg.norm(u) * away, at, near=1e-4)


@pytest.mark.parametrize("spacing", [(325.0, 5.22), (5.22, 325.0)])
def test_an_eye_is_refused_before_positions_fall_on_other_samples(spacing: tuple[float, float], tmp_path: Path) -> None:
    """Positions are up to four float steps off: half a spacing is reached at an eighth of it a step."""
    heights = np.random.default_rng(0).normal(size=(60, 60)) * 100.0
    ground, middle = Ground(lod.HeightField(heights, spacing=spacing), tmp_path), (100.0, -100.0, 0.0)
    axis = int(spacing[1] < spacing[0])
    refused = []
    for away in (1e6, 4e6, 8e6, 1.2e7, 1.6e7, 2.5e7, 3.1e7, 4e7):
        for k in range(3):
            eye = np.array([3.3 * k, -7.7 * k, 1e6 + 1e5 * k])
            eye[axis] += (1.0, -1.0)[axis] * away
            if _core.world_slack(away) > 0.5 * 5.22:
                with pytest.raises(errors.InvalidInput, match="no longer part them"):
                    ground.examine(eye, middle, fov=1.0)
                refused.append(away)
            else:
                ground.is_whole(eye, middle, fov=1.0)
    assert set(refused) == {1.2e7, 1.6e7, 2.5e7, 3.1e7, 4e7}


@pytest.mark.parametrize("slope", [10.0, 1000.0])
def test_no_slope_of_a_planet_is_too_steep_to_be_seen(slope: float, tmp_path: Path) -> None:
    """Heights took digits from the planes of edges, and a share of the area from steep triangles: 59 holes."""
    metres = np.radians(0.001) * 6371000.0
    heights = np.random.default_rng(0).normal(size=(30, 40)) * slope * metres
    ground = Ground(lod.HeightField(heights, planet=True, degrees=(10.0, 45.0, 0.001, 0.001)), tmp_path)
    middle = ground.sample(15, 20)
    up = middle / np.linalg.norm(middle)
    for k in (50, 200, 1000):
        ground.is_whole(middle + metres * k * (up + np.cross(up, [0, 0, 1])), middle)


@pytest.mark.parametrize("step", [0.0008, 0.003])
def test_no_column_by_a_pole_is_lost_where_rounding_joins_it_with_another(step: float, tmp_path: Path) -> None:
    """Beside the pole columns are millimetres apart; from a kilometre away their positions fall together."""
    lat, lon = np.meshgrid(90.0 - step * np.arange(24), step * np.arange(40), indexing="ij")
    along = np.radians(90.0 - lat) * 6371000.0
    heights = 40.0 * np.sin(along * np.cos(np.radians(lon)) / 300.0)
    ground = Ground(lod.HeightField(heights, planet=True, degrees=(0.0, 90.0, step, step)), tmp_path)
    middle = ground.sample(12, 20)
    for away in (1e2, 1e4, 1e6):
        eye = middle + np.array([0.3, 0.2, 1.0]) * away
        found, view = ground.examine(eye, middle)
        assert (found.hole_samples, found.inverted_triangles, found.crack_edges) == (0, 0, 0)
        assert found.measured_max <= 2.0 * ground.instrument.slack(view)


def together(heights: np.ndarray) -> lod.HeightField:
    """A patch at the south pole of a small body: columns micrometres apart, rows 8 mm."""
    return lod.HeightField(heights, planet=True, radius=500.0, degrees=(170.0, -89.946, 0.00069, 0.0009))


def test_columns_that_fall_together_are_no_crack(tmp_path: Path) -> None:
    """From 100 km away floats are 8 mm apart, and columns by the pole 0.6 mm: two that meet leave a fold, no gap."""
    heights = 0.04 * np.random.default_rng(5).normal(size=(24, 104))
    degrees = (0.0, -69.4239335672151, 0.004384063759855018, 0.8946115840341259)
    ground = Ground(lod.HeightField(heights, planet=True, radius=500.0, degrees=degrees), tmp_path)
    for away in (1e4, 3e4, 1e5):
        for k in range(4):
            ground.is_whole(away * np.array([0.9, -0.41 + 0.1 * k, -0.44]), ground.sample(22, 50))


def test_no_slope_along_columns_that_fall_together_is_taken_for_error(tmp_path: Path) -> None:
    """Heights of 100 m within the slack: `full` was off by up to 17 m, and bounds of methods were broken."""
    heights = 5.0 * np.random.default_rng(3).normal(size=(61, 35)).cumsum(axis=1)
    ground = Ground(together(heights), tmp_path)
    for away in (1e-3, 1.5, 70.0):
        at = ground.sample(40, 20)
        found, view = ground.examine(at * (1.0 + away / np.linalg.norm(at)), at)
        assert (found.hole_samples, found.crack_edges, found.inverted_triangles) == (0, 0, 0)
        assert found.measured_max <= ground.instrument.slack(view)


def test_an_error_is_seen_where_columns_fall_together(tmp_path: Path) -> None:
    heights = np.tile(np.random.default_rng(3).normal(size=(61, 1)), 35)
    raised = heights.copy()
    raised[50] += 0.25
    ground = Ground(together(heights), tmp_path)
    session = lod.build(together(raised), "full", tmp_path / "raised.lod", progress=False).core.session({})
    at = ground.sample(40, 20)
    view = _core.View(tuple(1.1 * at), tuple(at), size=(64, 48))
    found = ground.instrument.examine_parts([(session, session.select(view, PX1))], view, pictures=False)
    assert abs(found.measured_max - 0.25) < 0.01


def test_a_pole_is_on_both_ends_of_a_patch_that_goes_almost_round(tmp_path: Path) -> None:
    """Rounded, the pole lies at any longitude: round the long way that was farther from a border than the slack."""
    ground = Ground(lod.HeightField(np.zeros((3, 8)), planet=True, degrees=(20.0, 90.0, 50.0, 0.35)), tmp_path)
    for k in range(40):
        ground.is_whole(np.array([1e5 + 7e3 * k, 2e5 - 3e3 * k, 6.5e6]), ground.sample(1, 3))


def test_a_fan_thinner_than_doubles_tell_is_no_error(tmp_path: Path) -> None:
    """Columns a micrometre apart and cliffs between: multigrain's fans along the border row are lines, and were
    measured as triangles of what doubles leave over."""
    heights = 0.01 * np.random.default_rng(2).normal(size=(17, 44))
    field = lod.HeightField(heights, planet=True, radius=100.0, degrees=(-147.0, -11.4, 4e-7, 4.6e-4))
    store = lod.build(field, "multigrain", tmp_path / "m.lod", progress=False)
    assert len(lod.instrument.audit(store, cuts=5, progress=False).broken) == 0


@pytest.mark.parametrize(
    ("slope", "shape", "degrees", "options"),
    [
        (286.0, (40, 16), (130.38, -74.945, 7.8e-6, 0.008014), {"levels": 2}),
        (0.0, (5, 58), (65.6166, -89.9969297, 2.84561e-4, 7.6758e-4), {"levels": 8, "node_resolution": 8}),
    ],
)
def test_fans_hardly_wider_than_doubles_tell_are_neither_error_nor_hole(
    slope: float, shape: tuple[int, int], degrees: tuple[float, ...], options: dict[str, int], tmp_path: Path
) -> None:
    """Weights within them were rounding, and so a hundredth of their relief; dropped, they left holes."""
    heights = slope * np.add.outer(*map(np.arange, shape))
    field = lod.HeightField(heights, planet=True, degrees=degrees)
    store = lod.build(field, "multigrain", tmp_path / "m.lod", progress=False, **options)
    assert len(lod.instrument.audit(store, cuts=10, progress=False).broken) == 0
