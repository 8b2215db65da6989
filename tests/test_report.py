# SPDX-License-Identifier: MIT
"""Charts and reports: they show what the tables say, stand alone, and are legible in light and dark."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from html.parser import HTMLParser

import numpy as np
import pytest

import lodlab as lod
from lodlab import charts, figures, labels, pictures, report, results
from lodlab.errors import InvalidInput

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
        self.targets, self.open, self.text = [], [], []

    def handle_starttag(self, tag, attributes):
        self.targets += [v for k, v in attributes if k in ("src", "href", "srcset") and v]
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
    results.RunDirectory(tmp_path / "empty", {"sources": []}).close()
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
        colour = charts.COLOURS[theme][0]
        wanted = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)])
        assert (np.abs(image - wanted).max(axis=2) < 8).sum() > 200, "the curve is not to be seen"


def test_colours_stand_out_from_their_page():
    """WCAG's contrast for graphics is 3 : 1; text in these colours is large or bold."""
    for theme, colours in charts.COLOURS.items():
        for colour in (*colours, charts.INK[theme]["text"], charts.INK[theme]["faint"]):
            ratio = contrast(colour, charts.INK[theme]["page"])
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
    labels = [s.label for s in charts.series_of(both)]
    assert labels == ["full", "morph true", "morph false"]
    assert [s.baseline for s in charts.series_of(both)] == [True, False, False]
    looks = charts.dress(charts.series_of(both), "light")
    assert len({colour for colour, _ in looks.values()}) == 3 and len({marker for _, marker in looks.values()}) == 3


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [(10, 200, [10, 20, 50, 100, 200]), (4.0, 9.0, [4, 5, 6, 8]), (1, 1e5, [1, 10, 100, 1e3, 1e4, 1e5])],
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
