# SPDX-License-Identifier: MIT
"""lodlab: a laboratory for level of detail.

Bring a terrain or a mesh, build its hierarchy with a method, fly a camera along a path under budgets, without a
window, and get pictures and one table of what each frame cost and how wrong it measurably was.

    import lodlab as lod

    terrain = lod.datasets.load("jacksboro")
    store = lod.build(terrain, "chunked", "jacksboro.lod")
    path = lod.CameraPath.flyover(terrain, frames=120)
    run = lod.fly(store, path, lod.Budget(pixel_error=1.0), size=(1280, 720))
    run.frames
"""

from __future__ import annotations

try:
    from . import _core
except ImportError as error:
    raise ImportError(
        f"lodlab's native core does not load: {error}. It needs the system libraries of Debian's libepoxy0, libegl1, "
        "libgl1-mesa-dri, libtbb12, libembree3-3, libmeshoptimizer2 and libsqlite3-0, and a build for this very Python"
    ) from error

from . import _shaders, errors, instrument, report, stability  # noqa: F401 - _shaders tells the core where they are
from ._core import Budget, View
from .instrument import laws
from .instrument.triangles import measure
from .lab import compare, fit, fly, sweep
from .paths import deform
from .paths.path import CameraPath
from .report import charts
from .runs.checks import Violation, check
from .runs.fitting import Fit
from .runs.provenance import version as _version
from .runs.run import Run
from .runs.sweep import Sweep
from .sources import datasets
from .sources.heightfield import HeightField
from .sources.mesh import Mesh
from .stores.build import build
from .stores.methods import methods
from .stores.session import Cut, Frame, Session
from .stores.store import Store, open

__version__ = _version()
__all__ = [
    "Budget",
    "CameraPath",
    "Cut",
    "Fit",
    "Frame",
    "HeightField",
    "Mesh",
    "Run",
    "Session",
    "Store",
    "Sweep",
    "View",
    "Violation",
    "build",
    "charts",
    "check",
    "compare",
    "datasets",
    "deform",
    "devices",
    "errors",
    "fit",
    "fly",
    "instrument",
    "laws",
    "measure",
    "methods",
    "open",
    "report",
    "stability",
    "sweep",
]


def __dir__() -> list[str]:
    return sorted([*__all__, "__doc__", "__version__"])


def devices() -> list[dict[str, object]]:
    """The EGL devices of this machine: `index`, `name`, `software`."""
    return _core.devices()
