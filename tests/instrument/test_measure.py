# SPDX-License-Identifier: MIT
"""The instrument through its Python face: drawn cuts of real stores against numpy's own account of them."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import lodlab as lod
from lodlab import _core, errors
from lodlab.instrument import measure

SIZE = (240, 160)


def bumpy(rows: int = 65, cols: int = 97) -> np.ndarray:
    """Heights (rows, cols) float32, metres, with relief at several wavelengths."""
    y, x = np.mgrid[0:rows, 0:cols]
    return (40 * np.sin(x / 7.0) * np.cos(y / 9.0) + 6 * np.sin(x * 1.3 + y * 0.7)).astype(np.float32)


class Lab:
    """One source with stores of `full` and `chunked`, sessions on both and the instrument."""

    def __init__(self, field: lod.HeightField, folder: Path, chunked: bool = True) -> None:
        self.field = field
        self.full = self._build("full", folder).session({})
        self.chunked = self._build("chunked", folder) if chunked else None
        self.instrument = _core.Instrument(field.core, self.full)

    def _build(self, method: str, folder: Path) -> _core.Store:
        return lod.build(self.field, method, folder / f"{method}.lod", progress=False).core

    def session(self, **options: object) -> _core.Session:
        return self.chunked.session({"stream": False, **options})

    def view(self, height: float = 0.4) -> _core.View:
        """From beyond the south-west corner towards the middle."""
        rows, cols = self.field.shape
        dx, dy = self.field.spacing
        middle = np.array([0.5 * cols * dx, -0.5 * rows * dy, 0.0])
        span = max(cols * dx, rows * dy)
        return _core.View(tuple(middle + span * np.array([-0.5, -0.6, height])), tuple(middle), size=SIZE)


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Lab:
    return Lab(lod.HeightField(bumpy(), spacing=(10.0, 12.0)), tmp_path_factory.mktemp("bumpy"))


@pytest.fixture(scope="module")
def holed(tmp_path_factory: pytest.TempPathFactory) -> Lab:
    heights = bumpy()
    heights[20:31, 40:52] = np.nan
    return Lab(lod.HeightField(heights, spacing=(10.0, 12.0)), tmp_path_factory.mktemp("holed"))


def coarse(lab: Lab, view: _core.View, pixels: float = 6.0) -> tuple[_core.Session, _core.Cut]:
    session = lab.session()
    return session, session.select(view, _core.Budget(pixel_error=pixels))


def drawn_deviations(lab: Lab, capture: _core.Capture) -> np.ndarray:
    """(rows, cols) worst drawn minus source height, by numpy; nan where nothing covers."""
    rows, cols = lab.field.shape
    dx, dy = lab.field.spacing
    source = np.asarray(lab.field.core.heights, dtype=float)
    worst = np.full((rows, cols), np.nan)
    for corners in capture.triangles[capture.kind == 0]:
        # To the nearest thousandth of a cell: float positions are finer than that here.
        at = np.round(corners[:, :2] / [dx, -dy], 3)
        lo, hi = np.floor(at.min(axis=0)).astype(int), np.ceil(at.max(axis=0)).astype(int)
        x, y = np.meshgrid(
            np.arange(max(lo[0], 0), min(hi[0], cols - 1) + 1), np.arange(max(lo[1], 0), min(hi[1], rows - 1) + 1)
        )
        basis = np.column_stack([at[1] - at[0], at[2] - at[0]])
        if abs(np.linalg.det(basis)) < 1e-9:
            continue
        weights = np.linalg.solve(basis, np.stack([x.ravel() - at[0, 0], y.ravel() - at[0, 1]]))
        inside = (weights >= -1e-9).all(axis=0) & (weights.sum(axis=0) <= 1 + 1e-9)
        heights = corners[0, 2] + weights.T @ (corners[1:, 2] - corners[0, 2])
        for c, r, z in zip(x.ravel()[inside], y.ravel()[inside], heights[inside], strict=True):
            deviation = z - source[r, c]
            if not abs(worst[r, c]) >= abs(deviation):
                worst[r, c] = deviation
    return worst


def projected(view: _core.View, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pixel coordinates (N, 2) of world points (N, 3), and whether each is inside the frustum."""
    clip = np.column_stack([points, np.ones(len(points))]) @ np.asarray(view.matrix).T
    w = clip[:, 3]
    inside = (w > 0) & (np.abs(clip[:, :2]) <= w[:, None]).all(axis=1) & (clip[:, 2] <= w)
    return clip[:, :2] / w[:, None] * 0.5 * np.array(view.size), inside


def test_full_measures_nothing(lab: Lab) -> None:
    view = lab.view()
    row = measure(lab.instrument, lab.full, lab.full.select(view), view, lab.instrument.reference(view))
    assert row["measured_max"] <= lab.instrument.slack(view)
    assert row["measured_px_max"] <= _core.SLACK_PIXELS
    assert row["psnr_db"] == math.inf
    for column in ("hole_samples", "crack_edges", "crack_pixels", "capture_mismatch_pixels"):
        assert row[column] == 0
    assert row["measured_samples"] == 65 * 97


def test_errors_are_those_that_numpy_finds(lab: Lab) -> None:
    view = lab.view()
    session, cut = coarse(lab, view)
    row = measure(lab.instrument, session, cut, view, None)
    deviations = drawn_deviations(lab, session.capture(cut, view))
    # Two double computations of float heights some hundred metres from the eye.
    assert row["measured_max"] == pytest.approx(np.abs(deviations).max(), abs=1e-4)
    assert row["measured_rms"] == pytest.approx(math.sqrt((deviations**2).mean()), abs=1e-4)
    rows, cols = np.indices(lab.field.shape)
    samples = np.asarray(lab.field.core.position(rows.ravel(), cols.ravel()))
    here, inside = projected(view, samples)
    there, _ = projected(view, samples + deviations.reshape(-1, 1) * [0.0, 0.0, 1.0])
    # A thousandth of a pixel: a float step of height, some hundred metres away.
    assert row["measured_px_max"] == pytest.approx(np.linalg.norm(here - there, axis=1)[inside].max(), abs=1e-3)
    assert row["measured_px_max"] > 0.1


def test_pixels_stay_below_the_worst_sample(lab: Lab) -> None:
    view = lab.view(0.2)
    session, cut = coarse(lab, view)
    row = measure(lab.instrument, session, cut, view, lab.instrument.reference(view))
    assert 0.0 < row["measured_px_rms"] < row["measured_px_p99"]
    assert row["measured_px_p99"] <= row["measured_px_max"] <= row["predicted_px"] + _core.SLACK_PIXELS
    assert 10.0 < row["psnr_db"] < 100.0
    assert row["capture_mismatch_pixels"] == 0
    assert row["crack_mask_share"] > 0.8


def test_the_border_is_known_from_nearer_than_a_cell(tmp_path: Path) -> None:
    """Positions are rounded by the size of a cell then: three edges of `full` counted as cracks."""
    heights = np.zeros((2, 65), np.float32)
    heights[0, 5] = 100.0
    spacing, origin = (16.446514402133143, 164.46514402133144), (-18.53139187682422, 18.53139187682422)
    field = lod.HeightField(heights, spacing=spacing, origin=origin)
    session = lod.build(field, "full", tmp_path / "f.lod", progress=False).core.session({})
    eye = (519.4075753629301, -142.50408911698727, 6.61358626865121)
    view = _core.View(eye, (565.7841433655626, 5.838843919851975, 0.0), size=(96, 60))
    cut = session.select(view, _core.Budget(pixel_error=1.0))
    assert _core.Instrument(field.core, session).examine(session, cut, view, pictures=False).crack_edges == 0


def test_cracks_show_without_skirts(tmp_path: Path) -> None:
    lab = Lab(lod.HeightField(_core.fractal(513, 513), spacing=30.0), tmp_path)
    view = _core.View(lab.view(0.3).eye, lab.view(0.3).target, size=(480, 320))
    reference = lab.instrument.reference(view)
    seen = {}
    for cracks in ("skirt", "none"):
        session = lab.session(cracks=cracks)
        cut = session.select(view, _core.Budget(pixel_error=4.0))
        seen[cracks] = measure(lab.instrument, session, cut, view, reference)
    assert seen["skirt"]["crack_pixels"] == 0
    assert seen["none"]["crack_pixels"] > 0
    assert seen["none"]["crack_edges"] == seen["skirt"]["crack_edges"] > 0  # fillers close no edge
    assert seen["none"]["crack_mask_share"] > 0.8


@pytest.mark.parametrize("method", ["multigrain", "seamless"])
def test_a_coarse_silhouette_is_no_crack(tmp_path: Path, method: str) -> None:
    """Cuts of 16 and 64 pixels end 8 to 25 pixels elsewhere; four were allowed for, and hundreds counted as cracks."""
    y, x = np.mgrid[0:129, 0:129] * 0.09
    heights = 600 * np.sin(1.7 * x + 0.3) * np.cos(1.1 * y) + 200 * np.sin(7.3 * y - 5.9 * x)
    field = lod.HeightField(heights.astype(np.float32), spacing=90.0)
    full = lod.build(field, "full", tmp_path / "f.lod", progress=False).core.session({})
    session = lod.build(field, method, tmp_path / "m.lod", progress=False).core.session({"stream": False})
    instrument = _core.Instrument(field.core, full)
    for path, pixel_error in ((lod.CameraPath.orbit, 16.0), (lod.CameraPath.flyover, 64.0)):
        for view in path(field, frames=6).views(SIZE):
            cut = session.select(view, _core.Budget(pixel_error=pixel_error))
            row = measure(instrument, session, cut, view, instrument.reference(view))
            assert row["crack_pixels"] == 0 and row["crack_edges"] == 0, row
            assert row["crack_mask_share"] > 0.5, "and most of the picture was looked at"


def test_full_shows_no_crack_where_floats_are_coarse(tmp_path: Path) -> None:
    """An eye at man's height over cells of 1000 km, and steep cells that end within the rasterizer's own grid: a
    reference drawn with another camera than the cut differs from it there."""
    level = lod.HeightField(np.zeros((34, 34)), spacing=1e6)
    steep = lod.HeightField(2e4 * (np.indices((64, 63)).sum(axis=0) % 2) - 1e4, spacing=(30.0, 40.0))
    along = _core.View((60.0, -200.0, 10026.816574324486), (262.06764955948046, -1534.7418814301807, 9604.101391309006),
                       fov=20.0, size=(96, 64))  # fmt: skip
    walk = lod.CameraPath.walk(level, frames=24).views((320, 200))
    for name, field, views in (("level", level, walk), ("steep", steep, [along])):
        full = lod.build(field, "full", tmp_path / f"{name}.lod", progress=False).core.session({})
        instrument = _core.Instrument(field.core, full)
        for view in views:
            row = measure(instrument, full, full.select(view), view, instrument.reference(view))
            assert row["crack_pixels"] == 0 and row["psnr_db"] == math.inf, view


def test_filled_voids_are_not_looked_at(tmp_path: Path) -> None:
    """All that is seen here is a void's filling, of which no error is known: it counted as 6144 cracks."""
    heights = np.zeros((19, 20))
    heights[:12] = np.nan
    field = lod.HeightField(heights, spacing=30.0)
    full = lod.build(field, "full", tmp_path / "f.lod", progress=False).core.session({})
    view = _core.View((285.0, -290.0, 50.0), (285.0, -200.0, 0.0), size=(96, 64))
    instrument = _core.Instrument(field.core, full)
    row = measure(instrument, full, full.select(view), view, instrument.reference(view))
    assert math.isnan(row["psnr_db"]) and math.isnan(row["crack_pixels"]) and row["crack_mask_share"] == 0.0


def test_voids_are_not_measured(holed: Lab) -> None:
    view = holed.view()
    session, cut = coarse(holed, view)
    row = measure(holed.instrument, session, cut, view, holed.instrument.reference(view))
    assert row["measured_samples"] == int(np.asarray(holed.field.valid).sum())
    assert row["hole_samples"] == 0
    assert row["crack_pixels"] == 0
    assert row["capture_mismatch_pixels"] == 0


def test_node_errors_hold_the_stored_bounds(lab: Lab) -> None:
    view = lab.view()
    session, cut = coarse(lab, view)
    nodes, largest = lab.instrument.examine(session, cut, view).node_errors()
    assert set(nodes) == set(cut.nodes["node"])
    assert (largest <= cut.nodes["error"][np.searchsorted(cut.nodes["node"], nodes)] + lab.instrument.slack(view)).all()
    whole = measure(lab.instrument, session, cut, view, None, pictures=False)
    assert largest.max() == pytest.approx(whole["measured_max"])


def test_a_cut_does_not_jump_against_itself(lab: Lab) -> None:
    view = lab.view()
    session, cut = coarse(lab, view)
    reference = lab.instrument.reference(view)
    still = lab.instrument.examine(session, cut, view, reference, before=cut)
    assert (still.pop_px_max, still.pop_area) == (0.0, 0.0)
    finer = session.select(view, _core.Budget(pixel_error=0.5))
    jump = lab.instrument.examine(session, finer, view, reference, before=cut)
    assert 0.0 < jump.pop_px_max <= cut.predicted_px + finer.predicted_px + 2 * _core.SLACK_PIXELS
    roots = session.cut(lab.chunked.nodes["id"][lab.chunked.nodes["parent"] < 0])
    close = lab.view(0.1)
    fall = lab.instrument.examine(session, roots, close, lab.instrument.reference(close), before=finer)
    assert fall.pop_px_max > 1.0
    assert 0.0 < fall.pop_area < 0.5
    first = lab.instrument.examine(session, finer, view, reference)
    assert math.isnan(first.pop_px_max) and math.isnan(first.pop_area)


def test_threads_do_not_change_a_figure(lab: Lab) -> None:
    view = lab.view()
    session, cut = coarse(lab, view)
    reference = lab.instrument.reference(view)
    rows = []
    for threads in (1, 2):
        _core.set_thread_count(threads)
        rows.append(measure(lab.instrument, session, cut, view, reference, before=cut))
    _core.set_thread_count(0)
    np.testing.assert_equal(rows[0], rows[1])  # nan equals nan


def test_the_picture_of_errors_is_the_error(lab: Lab) -> None:
    view = lab.view()
    session, cut = coarse(lab, view)
    measured = lab.instrument.examine(session, cut, view, lab.instrument.reference(view))
    errors = measured.error_px()
    assert errors.shape == (SIZE[1], SIZE[0])
    drawn = session.draw(cut, view)
    assert np.array_equal(np.isnan(errors), ~np.isfinite(drawn.depth))
    assert np.array_equal(measured.image, drawn.image)
    assert np.nanmax(errors) <= measured.measured_px_max * 1.01
    # The same distances from the other side: over the reference's pixels instead of the drawn ones.
    assert np.nanpercentile(errors, 99) == pytest.approx(measured.measured_px_p99, rel=0.05)


def test_without_reference_its_columns_are_nan(lab: Lab) -> None:
    view = lab.view()
    session, cut = coarse(lab, view)
    compared = ("measured_px_p99", "measured_px_rms", "crack_pixels", "crack_mask_share", "psnr_db", "ssim", "flip")
    row = measure(lab.instrument, session, cut, view, None)
    assert all(math.isnan(row[column]) for column in compared)
    assert row["capture_mismatch_pixels"] == 0
    row = measure(lab.instrument, session, cut, view, lab.instrument.reference(view), pictures=False)
    assert all(math.isnan(row[column]) for column in (*compared, "capture_mismatch_pixels"))
    assert row["measured_px_max"] > 0.0


def test_looking_away_measures_no_pixel(lab: Lab) -> None:
    view = _core.View((0.0, 0.0, 500.0), (0.0, 0.0, 600.0), up=(0.0, 1.0, 0.0), size=SIZE)
    session, cut = coarse(lab, view)
    row = measure(lab.instrument, session, cut, view, lab.instrument.reference(view))
    for column in ("measured_px_max", "measured_px_p99", "measured_px_rms", "crack_mask_share", "crack_pixels"):
        assert math.isnan(row[column])
    assert row["measured_max"] > 0.0
    assert row["hole_samples"] == 0
    again = lab.instrument.examine(session, cut, view, lab.instrument.reference(view), before=cut)
    assert math.isnan(again.pop_px_max) and math.isnan(again.pop_area)


def test_a_reference_shows_itself(lab: Lab) -> None:
    reference = lab.instrument.reference(lab.view())
    assert reference.image.shape == reference.classes.shape == (SIZE[1], SIZE[0], 4)
    assert reference.depth.shape == (SIZE[1], SIZE[0])
    assert not reference.image.flags.writeable
    covered = np.isfinite(reference.depth)
    assert 0.2 < covered.mean() < 1.0
    assert (reference.classes[..., 0][covered] != 0).all()
    assert (reference.classes[..., 0][~covered] == 0).all()


def smaller(view: _core.View) -> _core.View:
    return _core.View(view.eye, view.target, size=(60, 40))


def nearer(view: _core.View) -> _core.View:
    return _core.View(tuple(0.9 * np.asarray(view.eye)), view.target, size=SIZE)


@pytest.mark.parametrize(("other", "message"), [(smaller, "60 x 40"), (nearer, "another view")])
def test_a_reference_of_another_view_is_refused(
    lab: Lab, other: Callable[[_core.View], _core.View], message: str
) -> None:
    view = lab.view()
    session, cut = coarse(lab, view)
    with pytest.raises(errors.InvalidInput, match=message):
        measure(lab.instrument, session, cut, view, lab.instrument.reference(other(view)))


def test_another_source_is_refused(lab: Lab, holed: Lab) -> None:
    view = lab.view()
    with pytest.raises(errors.InvalidInput, match="another source"):
        measure(lab.instrument, holed.full, holed.full.select(view), view, None)
    with pytest.raises(errors.InvalidInput, match="another source"):
        _core.Instrument(lab.field.core, holed.full)
    with pytest.raises(errors.InvalidInput, match="without a session"):
        _core.Instrument(lab.field.core).reference(view)


def test_a_planet_drawn_in_full_measures_nothing(tmp_path: Path) -> None:
    field = lod.datasets.load("earth:planet=true")
    heights = np.asarray(field.heights)[::60, ::60].astype(np.float32) * 20.0
    rows, cols = heights.shape
    core = _core.HeightField(
        np.ascontiguousarray(heights), planet=True, lat0=90.0, dlat=180.0 / (rows - 1), dlon=360.0 / cols, wraps=True
    )
    full = _core.build(core, "full", tmp_path / "full.lod").session({})
    instrument = _core.Instrument(core, full)
    for eye in ((2.0e7, 3.0e6, 1.0e6), (1.0e5, 2.0e5, 1.6e7), (-3.0e6, -9.0e6, -8.0e6)):
        view = _core.View(eye, (0.0, 0.0, 0.0), size=SIZE)
        row = measure(instrument, full, full.select(view), view, instrument.reference(view))
        assert row["measured_max"] <= instrument.slack(view)
        assert row["measured_px_max"] <= _core.SLACK_PIXELS
        for column in ("hole_samples", "crack_edges", "crack_pixels", "capture_mismatch_pixels"):
            assert row[column] == 0
        assert row["measured_samples"] == rows * cols
        assert row["psnr_db"] == math.inf


def test_an_eye_too_far_away_to_tell_samples_apart_is_refused(lab: Lab) -> None:
    view = _core.View((1e12, 0.0, 1e12), (0.0, 0.0, 0.0), size=SIZE)
    session = lab.session()
    cut = session.select(view, _core.Budget(pixel_error=1))
    with pytest.raises(errors.InvalidInput, match="measure: the eye is 1e\\+12 m from samples"):
        measure(lab.instrument, session, cut, view, pictures=False)


@pytest.mark.parametrize("eye", [(1e300, 0.0, 0.0), (0.0, -1e37, 0.0)])
def test_views_stay_where_floats_reach(eye: tuple[float, float, float]) -> None:
    with pytest.raises(errors.InvalidInput, match="not within 1e36"):
        _core.View(eye, (0.0, 0.0, 0.0))
