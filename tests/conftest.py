# SPDX-License-Identifier: MIT
"""What all tests share: real data that may be absent, and charts that nobody looks at."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from lodlab.sources.spec import data_folder


@pytest.fixture(scope="session")
def shared_data() -> Callable[[str], Path]:
    """The path of a file of the shared data, as shared_data("terrain/x.tif").

    Where it is absent the test is skipped with the reason; with LODLAB_REQUIRE_DATA=1 it fails.
    """

    def find(name: str) -> Path:
        folder = data_folder()
        path = None if folder is None else folder / name
        if path is not None and path.is_file():
            return path
        reason = f"shared data: {path or name} is not there (LODLAB_DATA names its folder)"
        if os.environ.get("LODLAB_REQUIRE_DATA") == "1":
            pytest.fail(reason)
        pytest.skip(reason)

    return find


@pytest.fixture(scope="module")
def unrendered() -> Iterator[None]:
    """Charts are composed as ever, and matplotlib, which takes most of a small sweep's time, writes empty ones.

    For tests of what sweeps write into tables; what charts show is tested in test_report.
    """
    from matplotlib.figure import Figure

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Figure, "savefig", lambda figure, out, **keys: out.write(b"<svg/>"))
        yield
