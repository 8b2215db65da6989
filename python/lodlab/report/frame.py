# SPDX-License-Identifier: MIT
"""The frame of the pages that lodlab writes: one file, without a network, in light and dark. A page is a body and a
style of its own in it."""

from __future__ import annotations

import html
from pathlib import Path
from string import Template

_HEAD = ("title", "heading", "subtitle")  # plain text


def fill(body: Path, **values: str) -> str:
    """A page: `body` (NAME.html, NAME.css beside it) and the frame, filled in. `title`, `heading`, `subtitle` are plain
    text, all others (`lead`, and what the body names) HTML."""
    values |= {name: html.escape(values[name]) for name in _HEAD}
    inner = Template(body.read_text(encoding="utf-8")).substitute(values)
    style = body.with_suffix(".css").read_text(encoding="utf-8")
    frame = Path(__file__).with_name("frame.html").read_text(encoding="utf-8")
    return Template(frame).substitute(values, style=style, body=inner.strip())
