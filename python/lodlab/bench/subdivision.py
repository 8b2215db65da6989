# SPDX-License-Identifier: MIT
"""Benchmarks of `subdivision` alone: what a store takes, what a frame tests for what it draws, how it compares with
levels of as many triangles, how tight its bounds are."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterable
from typing import Any

import numpy as np

from .. import _core
from ..instrument import audit
from ..stores.store import Store
from .lab import Lab, Record, device, options_of, record
from .meshes import FILES

PLAIN_BYTES = 18.0  # a triangle of plain arrays: half a vertex of three floats, three 32-bit indices
BUDGET = 100_000
FINE = 8  # triangles drawn for each visible control face, at least: less is hardly refined

_CHILD = """
import json, sys
import lodlab

mesh = lodlab.datasets.load(sys.argv[1])
lodlab.build(mesh, "subdivision", sys.argv[2], progress=False)
with open("/proc/self/status") as status:
    print(json.dumps(next(int(line.split()[1]) * 1024 for line in status if line.startswith("VmHWM"))))
"""


def size(lab: Lab) -> Iterable[Record]:
    """Bytes of a store that draws as many triangles as a scan has, beside the scan's plain arrays."""
    spec = FILES["dragon"]
    for bits in ("16", "11"):
        case = f"subdivision/dragon/{bits}"
        if lab.lacks(spec, f"size {case}"):
            continue
        store, mesh = lab.store(spec, "subdivision", bits=bits), lab.source(spec)
        lab.say(f"size {case}")
        plain, info = PLAIN_BYTES * len(mesh.faces), store.info()
        yield record(
            "size",
            case,
            100.0 * info["bytes"] / plain,
            "%",
            reference="plain arrays",
            reference_value=plain,
            ratio=plain / info["bytes"],
            options=options_of(store, {}),
            details={
                "bytes": info["bytes"],
                "triangles_times_source": info["levels"][0]["triangles"] / len(mesh.faces),
                "bytes_per_triangle": info["bytes"] / info["levels"][0]["triangles"],
                **_finest_distances(lab, spec, store),
            },
        )


def _finest_distances(lab: Lab, spec: str, store: Any) -> dict[str, float]:
    """Of the finest cut, both ways, in per cent of the diagonal: root mean square, which no average exceeds."""
    session, mesh, view = store.session({}), lab.source(spec), lab.views(spec, 9)[4]
    cut = session.select(view, _core.Budget(pixel_error=1e-300))
    found = _core.Instrument(mesh.core, None).examine(session, cut, view, pictures=False)
    share = 100.0 / mesh.extent
    return {
        "rms_percent_of_diagonal": share * max(found.measured_rms_source_to_drawn, found.measured_rms_drawn_to_source),
        "max_percent_of_diagonal": share * found.measured_max,
    }


def refine(lab: Lab) -> Iterable[Record]:
    """Triangles that a frame at 1 px tests, by any pass or thread, for each that it draws."""
    spec = FILES["dragon"]
    for pipeline in ("compute", "geometry"):
        case = f"subdivision/dragon/{pipeline}"
        if lab.lacks(spec, f"refine {case}"):
            continue
        store = lab.store(spec, "subdivision")
        session, budget = store.session({"pipeline": pipeline}), _core.Budget(pixel_error=1.0)
        lab.say(f"refine {case}")
        tested, drawn, faces, times = [], [], [], []
        for view in lab.views(spec, 12):
            cut, cost = session.time_frame(view, budget)
            if cost["triangles"] >= FINE * cut.visible_nodes:
                tested.append(cost["processed_triangles"])
                drawn.append(cost["triangles"])
                faces.append(cut.visible_nodes)
                times.append(cost["frame_ms"])
        if not drawn:
            lab.say(f"refine {case} is skipped: no view draws {FINE} triangles for each visible control face")
            continue
        yield record(
            "refine",
            case,
            float(np.max(np.divide(tested, drawn))),
            "tested/drawn",
            device=device(),
            options=options_of(store, {"pipeline": pipeline}),
            details={
                "drawn": float(np.median(drawn)),
                "visible_control_faces": float(np.median(faces)),
                "frame_ms": float(np.median(times)),
                "views": len(drawn),
            },
        )


def accuracy(lab: Lab) -> Iterable[Record]:
    """Screen error that 99 % of the pixels keep to with 100,000 triangles, beside `discrete` with as many; and how much
    larger than what is measured the bounds are."""
    for name in ("dragon", "igea"):
        case, spec = f"subdivision/{name}/{BUDGET}", FILES[name]
        if lab.lacks(spec, f"accuracy {case}"):
            continue
        lab.say(f"accuracy {case}")
        views = lab.views(spec, 5)
        full = lab.store(spec, "full").session({})
        instrument = _core.Instrument(lab.source(spec).core, full)
        sessions = {method: lab.store(spec, method).session({}) for method in ("discrete", "subdivision")}
        rows: dict[str, list[Any]] = {method: [] for method in sessions}
        for view in views:
            triangles = BUDGET
            for method, session in sessions.items():
                cut = session.select(view, _core.Budget(triangles=triangles))
                triangles = cut.triangles  # of the levels: the other may have no more
                row = instrument.examine(session, cut, view, instrument.reference(view))
                rows[method].append((row.measured_px_p99, row.measured_px_max, triangles))
        found = {method: np.median(seen, axis=0) for method, seen in rows.items()}
        ours, theirs = found["subdivision"], found["discrete"]
        yield record(
            "accuracy",
            case,
            float(ours[0]),
            "px, p99",
            reference="discrete",
            reference_value=float(theirs[0]),
            ratio=float(theirs[0] / ours[0]),
            device=device(),
            options=options_of(lab.store(spec, "subdivision"), {}),
            details={
                "triangles": float(ours[2]),
                "discrete_triangles": float(theirs[2]),
                "measured_px_max": float(ours[1]),
                "discrete_measured_px_max": float(theirs[1]),
                "views": len(views),
            },
        )
    spec = FILES["igea"]
    if not lab.lacks(spec, "accuracy subdivision/igea/bounds"):
        lab.say("accuracy subdivision/igea/bounds")
        core = lab.store(spec, "subdivision")
        tightness = audit(Store(core, lab.source(spec)), cuts=0, progress=False).tightness
        yield record("accuracy", "subdivision/igea/bounds", tightness, "bound/measured", options=options_of(core, {}))


def memory(lab: Lab) -> Iterable[Record]:
    """Peak memory of a process, interpreter and all, that reads a scan and builds it. One run: it hardly varies."""
    spec, case = FILES["dragon"], "subdivision/dragon"
    if lab.lacks(spec, f"memory {case}"):
        return
    lab.say(f"memory {case}")
    command = [sys.executable, "-c", _CHILD, spec, str(lab.folder / "memory.lod")]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"memory: the building process ended with status {done.returncode}: {done.stderr}")
    peak = json.loads(done.stdout.splitlines()[-1])
    plain = PLAIN_BYTES * len(lab.source(spec).faces)
    yield record(
        "memory", case, peak / 1e6, "MB", reference="plain arrays", reference_value=plain / 1e6, ratio=plain / peak
    )
