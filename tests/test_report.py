# SPDX-License-Identifier: MIT
"""Charts and reports: they show what the tables say, stand alone, and are legible in light and dark."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import pytest

import lodlab as lod
from lodlab import charts, figures, pictures
from lodlab.chart import COLOURS, INK
from lodlab.errors import InvalidInput
from lodlab.instrument import statistics
from lodlab.report import labels, series
from lodlab.report import page as report
from lodlab.runs import directory
from lodlab.runs.passes import worst_frame

CONFIG = {
    "sources": ["fractal:size=65,seed=3"],
    "frames": 5,
    "size": [96, 64],
    "accuracy_frames": 3,
    "pixel_errors": [1.0, 4.0],
    "methods": [{"name": "full"}, {"name": "chunked", "options": {"leaf": 16, "chunk_triangles": 128}}],
}


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    return lod.sweep(CONFIG, out=tmp_path_factory.mktemp("report") / "run", progress=False)


@pytest.fixture(scope="module")
def page(swept):
    return (swept.directory / "report.html").read_text()


class Links(HTMLParser):
    """Collects what a page points at, and whether its elements are closed in order."""

    VOID = {"meta", "img", "br", "source", "link"}

    def __init__(self):
        super().__init__()
        self.targets, self.links, self.open, self.text = [], [], [], []

    def handle_starttag(self, tag, attributes):
        self.targets += [v for k, v in attributes if k in ("src", "srcset") and v]
        self.links += [v for k, v in attributes if k == "href" and v]
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text.append(data)


def test_report_stands_alone(page):
    links = Links()
    links.feed(page)
    assert links.open == [] and links.targets
    assert all(t.startswith("data:image/") for t in links.targets)
    assert all(re.fullmatch(r"images/[^/:]+/[^/:]+\.png", t) for t in links.links), "a link leaves the directory"
    assert not re.search(r"url\((?!data:)|@import|<script|https?://(?!www\.w3\.org)", page)
    assert len(page) < 8_000_000


def test_report_says_what_was_run(swept, page):
    text = "".join(re.sub(r"<[^>]+>", " ", page))
    for name in swept.runs:
        assert name in text
    for word in ("lodlab", "llvmpipe" if "llvmpipe" in swept.summary["device"].iloc[0] else "OpenGL", "commit"):
        assert word in text
    assert "lodlab sweep config.toml" in text and "difference ×" in text
    assert text.count("levels of the hierarchy") == len(swept.runs)
    assert "prefers-color-scheme: dark" in page
    assert 'class="broken"' not in page, "a law does not hold"


def test_report_links_the_worst_frame_of_each_run(swept, page):
    links = Links()
    links.feed(page)
    for name in swept.runs:
        worst = worst_frame(swept.run(name).frames.to_dict("records"))
        wanted = [f"{name}.worst/{worst:06d}-{kind}.png" for kind in ("reference", "error", "level")]
        assert all(f"images/{file}" in links.links for file in (f"{name}/{worst:06d}.png", *wanted)), name
    assert all((swept.directory / unquote(link)).is_file() for link in links.links)


def test_charts_give_their_figure_and_refuse_unknown_themes(swept, tmp_path):
    chart = lod.charts.pareto(swept)
    figure = chart.figure("dark")
    figure.axes[0].set_title("mine")
    figure.savefig(tmp_path / "mine.png")
    assert len(figure.axes) == 2 and (tmp_path / "mine.png").stat().st_size > 0
    assert figure is not chart.figure("dark"), "a changed figure would change the chart"
    with pytest.raises(InvalidInput, match="theme is 'pink'; it is one of light, dark"):
        chart.figure("pink")


def test_links_are_safe_for_every_name_of_a_run():
    link = report._link(Path("runs/images/chunked-a=1,b+c/000042.png"))
    assert unquote(link) == "images/chunked-a=1,b+c/000042.png" and not set(link) & set("\"'<>&# ")


def test_strips_show_the_measured_error(page):
    at = [
        page.index(caption) for caption in (">drawn<", ">reference: ", ">difference ×", ">measured error<", ">levels ")
    ]
    assert at == sorted(at)


def test_report_says_how_well_the_machine_repeats(swept, page):
    floor = statistics.noise_floor(swept.noise)
    assert "The same method twice differs by up to" in page and f"<b>{figures.percent(floor)}</b>" in page
    assert "<code>chunked-px1</code>, timed once more" in page and "shared the machine" not in page
    assert "3 at a time" in report.noise_text(swept.noise.assign(jobs=3))


def test_report_without_a_null_comparison_says_so(swept, page, tmp_path):
    for name in ("config.toml", "frames.csv", "summary.csv", "provenance.json"):
        (tmp_path / name).write_bytes((swept.directory / name).read_bytes())
    text = report.write(tmp_path).read_text()
    assert "No null comparison is here" in text and "The same method twice differs" not in text


def test_report_of_fewer_columns(swept, tmp_path):
    """Results of an earlier version: what they lack is left out."""
    gone = [c for c in swept.summary if c.startswith(("ssim", "flip", "pop")) or c.endswith(("_low", "_high"))]
    older = lod.Sweep(None, swept.frames, swept.summary.drop(columns=gone))
    assert "SSIM" in report.summary_table(swept.summary) and "SSIM" not in report.summary_table(older.summary)
    assert charts.pareto(older)._repr_png_().startswith(b"\x89PNG")


def test_distances_are_in_the_units_of_the_source_and_what_is_undefined_in_every_run_is_left_out(swept):
    ground = report.summary_table(swept.summary)
    assert "measured<br>m</th>" in ground and " · " not in ground
    ways = {"measured_max_source_to_drawn_worst": 1.5, "measured_max_drawn_to_source_worst": 2.5}
    table = report.summary_table(swept.summary.assign(source_kind="mesh", psnr_db_worst=np.nan, **ways))
    assert "measured<br>units</th>" in table and "1.50 · 2.50</small>" in table and "PSNR" not in table


def test_tables_show_the_interval_of_the_median(swept):
    row = swept.summary.iloc[0]
    low, high = (figures.number(row[f"frame_ms_median_{end}"]) for end in ("low", "high"))
    assert f"{low} – {high}" in report.summary_table(swept.summary)


def test_report_is_made_again_from_the_files_alone(swept, page):
    (swept.directory / "report.html").unlink()
    assert report.write(swept.directory) == swept.directory / "report.html"
    assert (swept.directory / "report.html").read_text() == page


def test_report_of_runs_that_were_not_measured(tmp_path):
    lod.sweep({**CONFIG, "accuracy_frames": 0, "images": "none"}, out=tmp_path / "run", progress=False)
    text = (tmp_path / "run" / "report.html").read_text()
    assert "No frame was measured" in text and "kept no pictures" in text
    assert not (tmp_path / "run" / "pareto.png").exists()


def test_report_of_nothing_is_refused(tmp_path):
    with pytest.raises(InvalidInput, match="no directory"):
        report.write(tmp_path / "none")
    with pytest.raises(InvalidInput, match="no file"):
        report.write(tmp_path)
    with directory.RunDirectory(tmp_path / "empty") as empty:
        empty.begin({"sources": []}, [], {})
    with pytest.raises(InvalidInput, match="no finished run"):
        report.write(tmp_path / "empty")


def test_source_names_cannot_break_the_page(swept):
    summary = swept.summary.copy()
    summary["run"] = "<script>alert(1)</script>"
    assert "<script>" not in report.summary_table(summary)


@pytest.mark.parametrize("kind", ["sweep", "run", "runs", "folder"])
def test_pareto_takes_every_kind_of_result(swept, kind):
    chosen = {
        "sweep": swept,
        "run": swept.run("chunked-px1"),
        "runs": [swept.run(name) for name in swept.runs],
        "folder": swept.directory,
    }[kind]
    chart = charts.pareto(chosen)
    image = decode(chart._repr_png_())
    assert image.shape[1] >= 700
    ElementTree.fromstring(chart.svg("dark"))


def decode(png):
    import io

    from PIL import Image

    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB")).astype(int)


def test_pareto_is_dressed_for_light_and_dark(swept):
    light, dark = (decode(charts.pareto(swept).png(theme)) for theme in ("light", "dark"))
    assert light[0, 0].min() > 240 and dark[0, 0].max() < 40
    for image, theme in ((light, "light"), (dark, "dark")):
        colour = COLOURS[theme][0]
        wanted = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)])
        assert (np.abs(image - wanted).max(axis=2) < 8).sum() > 200, "the curve is not to be seen"


def test_colours_stand_out_from_their_page():
    """WCAG's contrast for graphics is 3 : 1; text in these colours is large or bold."""
    for theme, colours in COLOURS.items():
        for colour in (*colours, INK[theme]["text"], INK[theme]["faint"]):
            ratio = contrast(colour, INK[theme]["page"])
            assert ratio >= (3.0 if colour not in ("#56B4E9", "#CC79A7") else 2.1), (theme, colour, ratio)


def contrast(a, b):
    def luminance(colour):
        values = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
        linear = [v / 12.92 if v <= 0.04045 else ((v + 0.055) / 1.055) ** 2.4 for v in values]
        return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]

    high, low = sorted((luminance(a), luminance(b)), reverse=True)
    return (high + 0.05) / (low + 0.05)


def test_pareto_marks_zero_and_infinity(swept):
    scale = charts._ErrorScale(np.array([0.0, 0.5, 4.0, np.inf]))
    placed = scale.place(np.array([0.0, 0.5, 4.0, np.inf]))
    assert placed[0] == scale.floor < 0.5 and placed[3] == scale.top > 4.0
    within_slack = charts._ErrorScale(np.array([0.004, 0.5]))
    assert within_slack.place(np.array([0.004]))[0] == within_slack.floor


def test_series_are_named_by_what_varies(swept):
    summary = swept.summary.copy()
    other = summary[summary["method"] == "chunked"].copy()
    other["options"] = other["options"].str.replace('"morph":"true"', '"morph":"false"')
    import pandas as pd

    both = pd.concat([summary, other], ignore_index=True)
    labels = [s.label for s in series.series_of(both)]
    assert labels == ["full", "morph true", "morph false"]
    assert [s.baseline for s in series.series_of(both)] == [True, False, False]
    looks = series.dress(series.series_of(both), "light")
    assert len({colour for colour, _ in looks.values()}) == 3 and len({marker for _, marker in looks.values()}) == 3


def study(swept, leaves):
    """The sweep, flown with other values of `leaf` as well, a little slower each."""
    import pandas as pd

    frames, summary = [swept.frames], [swept.summary]
    for i, leaf in enumerate(leaves):
        for tables, of in ((frames, swept.frames), (summary, swept.summary)):
            rows = of[of["method"] == "chunked"].copy()
            rows["options"] = rows["options"].str.replace('"leaf":16', f'"leaf":{leaf}')
            rows["run"] = rows["run"] + f"-leaf={leaf}"
            times = [c for c in rows if c.startswith("frame_ms")]
            rows[times] *= 1.05 + 0.05 * i
            tables.append(rows)
    return lod.Sweep(None, *(pd.concat(tables, ignore_index=True) for tables in (frames, summary)))


@pytest.mark.parametrize("leaves", [(32, 64, 128), range(17, 40)])
def test_curves_of_a_parameter_study_differ_in_colour_and_are_named_beside_them(swept, leaves):
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    result = study(swept, leaves)
    curves = series.series_of(result.summary)
    for theme in ("light", "dark"):
        looks = series.dress(curves, theme)
        assert len({colour for colour, _ in looks.values()}) == len(curves) == len(leaves) + 2
    figure = Figure(layout="constrained")
    FigureCanvasAgg(figure)
    charts.pareto(result)._draw(figure, "light")
    figure.canvas.draw()
    times, triangles = figure.axes  # only one method: no row for others
    assert "chunked" in times.get_title(loc="left")
    legend = triangles.get_legend()
    assert [t.get_text() for t in legend.get_texts()] == ["full", *(f"leaf {leaf}" for leaf in (16, *leaves))]
    page = figure.bbox
    names = [t.get_window_extent() for t in legend.get_texts()]
    assert all(box.x0 >= triangles.bbox.x1 and box.x1 <= page.x1 for box in names)
    budgets = [t.get_window_extent() for t in times.texts]
    assert len(budgets) == 2  # at the first curve alone
    for boxes in (names, budgets):
        assert not any(a.overlaps(b) for i, a in enumerate(boxes) for b in boxes[i + 1 :])


def test_methods_without_a_study_keep_a_row_of_panels_together(swept):
    import pandas as pd

    result = study(swept, (32, 64))
    other = result.summary[result.summary["method"] == "chunked"].head(2).copy()
    other["method"] = "seamless"
    rows = series.studies(pd.concat([result.summary, other], ignore_index=True))
    assert [(suffix, sorted(set(part["method"]))) for suffix, part in rows] == [
        ("", ["full", "seamless"]), (" · chunked", ["chunked", "full"])
    ]  # fmt: skip


def test_many_runs_have_a_timeline_for_each_curve(swept):
    assert report._timeline(swept).count('<figure class="chart">') == 1
    many = study(swept, (32, 64, 128))
    page = report._timeline(many)
    assert page.count('<figure class="chart">') == 4
    assert [f"leaf {leaf}." in page for leaf in (16, 32, 64, 128)] == [True] * 4


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [
        (10, 200, [10, 20, 50, 100, 200]),
        (4.0, 9.0, [4, 5, 6, 8]),
        (1, 1e5, [1, 10, 100, 1e3, 1e4, 1e5]),
        (8.1e5, 9.7e5, [8.4e5, 8.8e5, 9.2e5, 9.6e5]),
    ],
)
def test_axes_have_round_marks(low, high, expected):
    assert charts.round_numbers(low, high, 6) == pytest.approx(expected)


def test_labels_do_not_cover_points_or_each_other():
    curves = [np.array([(40.0 + 30 * i, 200.0 - 35 * i) for i in range(5)]) + (0.0, -12.0 * k) for k in range(2)]
    made = [labels.Label("8 px", *point, 8.0) for curve in curves for point in curve]
    made += [labels.Label(name, *c[0], 10.0, labels.ABOVE) for name, c in zip(("one", "two"), curves, strict=True)]
    labels.place(made, curves, (232.0, 228.0))
    boxes = np.array([label.box(label.dx, label.dy) for label in made])
    points = np.vstack(curves)
    for i, box in enumerate(boxes):
        assert labels._covered(box, np.delete(boxes, i, axis=0)) == 0.0, made[i]
        assert labels._covered(box, np.hstack([points - 2.0, points + 2.0])) == 0.0, made[i]


def test_charts_refuse_what_they_cannot_show(swept, tmp_path):
    with pytest.raises(InvalidInput, match="int is no run"):
        charts.pareto(3)
    with pytest.raises(InvalidInput, match=r"\.png, \.svg, \.pdf"):
        charts.pareto(swept).save(tmp_path / "chart.gif")
    unmeasured = swept.summary.copy()
    unmeasured["measured_px_max_worst"] = np.nan
    with pytest.raises(InvalidInput, match="no run was measured"):
        charts.pareto(lod.Sweep(None, swept.frames, unmeasured))


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.5, "0.5"), (20, "20"), (1500, "1.5k"), (277000, "277k"), (2e6, "2M"), (0, "0"), (999.9, "1k")],
)
def test_short_numbers(value, text):
    assert charts.short(value) == text


@pytest.mark.parametrize(
    ("value", "text"),
    [(np.nan, "–"), (np.inf, "∞"), (0, "0"), (True, "yes"), (0.01234, "0.0123"), (1.5, "1.50"), (12345, "12\u202f345"),
     (0.00001, "1.0e-05")],
)  # fmt: skip
def test_numbers_for_people(value, text):
    assert figures.number(value) == text


def test_differences_are_brightened_and_say_so():
    a = np.full((8, 8, 4), 100, np.uint8)
    b = a.copy()
    b[2, 3, 1] = 103
    delta, factor = pictures.difference(a, b)
    assert factor == 64 and delta[2, 3, 1] == 192 and delta[0, 0].tolist() == [0, 0, 0, 255]
    assert pictures.difference(a, a)[0][..., :3].max() == 0
    assert pictures.difference(a, 255 - a)[1] == 4


def test_results_show_themselves(swept):
    assert "chunked-px4" in swept._repr_html_()
    html = swept.run("chunked-px4")._repr_html_()
    assert "data:image/png;base64," in html
    assert repr(swept).startswith("<lodlab.Sweep of 3 runs")


# ---- pictures of measured error --------------------------------------------------------------------


def error_map(share):
    import matplotlib

    return np.array(matplotlib.colormaps["magma_r"](share, bytes=True)[:3])


def flat(height=60, width=240, grey=128):
    return np.full((height, width, 4), grey, np.uint8)


def test_error_pictures_have_known_colours_at_known_errors():
    errors = np.full((60, 240), 1.0)
    errors[:, 60:120], errors[:, 120:180], errors[:, 180:] = 0.0, 2.0, 7.0
    made = pictures.error_picture(flat(), errors, top=2.0)
    assert made.dtype == np.uint8 and made.shape[1:] == (240, 4) and made.shape[0] > 60
    for column, share in ((30, 0.5), (90, 0.0), (150, 1.0), (210, 1.0)):
        assert np.array_equal(made[30, column, :3], error_map(share)), (column, share)
    bar = made[60:, :, :3].reshape(-1, 3)
    for share in (0.0, 0.5, 1.0):
        assert (np.abs(bar - error_map(share).astype(int)).max(axis=1) <= 4).sum() > 5, f"{share} is not in the scale"


def test_error_pictures_keep_the_background_and_shout_holes():
    image = flat()
    image[:, :50] = (10, 200, 30, 255)
    errors = np.full((60, 240), 0.5)
    errors[:, :50], errors[20:30, 100:110] = np.nan, np.inf
    made = pictures.error_picture(image, errors)
    assert np.array_equal(made[:60, :50], image[:, :50])
    assert (made[20:30, 100:110, :3] == pictures.HOLE).all()
    whole = pictures.error_picture(image, np.where(np.isinf(errors), 0.5, errors))
    shouting = [(p[60:, :, :3] == pictures.HOLE).all(axis=2).sum() for p in (made, whole)]
    assert shouting[0] > 20 and shouting[1] == 0, "the scale names holes where there are some, and only there"


def test_error_pictures_shade_errors_by_the_picture():
    image = flat()
    image[:, :80, :3], image[:, 160:, :3] = 60, 200
    made = pictures.error_picture(image, np.full((60, 240), 1.0), top=4.0).astype(int)
    dark, middle, light = (made[30, column, :3].sum() for column in (40, 120, 200))
    assert dark < 0.8 * middle and middle < light, "the relief is gone"
    assert np.array_equal(made[30, 120, :3], error_map(0.25))


def test_error_scales_end_at_round_numbers_and_say_what_is_above():
    errors = np.zeros((100, 240))
    errors[:50] = 1.7
    errors[0, :12] = 50.0  # one in two thousand
    made = pictures.error_picture(flat(100), errors)
    assert np.array_equal(made, pictures.error_picture(flat(100), errors, top=2.0))
    calm = pictures.error_picture(flat(100), np.minimum(errors, 1.7), top=2.0)
    assert np.any(made[100:] != calm[100:]), "the scale does not say that errors lie above its end"
    for value, top in ((0.0, 0.01), (0.004, 0.01), (0.01, 0.01), (0.011, 0.015), (0.9, 1.0), (1.0, 1.0), (23.0, 30.0)):
        assert pictures._round_up(value) == pytest.approx(top), value


@pytest.mark.parametrize("value", [np.nan, np.inf, 0.0])
@pytest.mark.parametrize("size", [(1, 1), (40, 30), (3, 2000)])
def test_error_pictures_of_any_size_and_of_nothing(value, size):
    made = pictures.error_picture(flat(*size), np.full(size, value, np.float32))
    assert made.shape[0] > size[0] and made.shape[1] >= size[1]


def test_error_pictures_refuse_what_does_not_fit():
    for image, errors in (
        (flat(), np.zeros((60, 239))),
        (flat()[..., 0], np.zeros((60, 240))),
        (flat().astype(float), np.zeros((60, 240))),
    ):
        with pytest.raises(InvalidInput, match="error picture: image"):
            pictures.error_picture(image, errors)
    for top in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(InvalidInput, match="top is"):
            pictures.error_picture(flat(), np.zeros((60, 240)), top=top)
