# SPDX-License-Identifier: MIT
"""Threads and Nones from Python: a typed error or the answer, never a crash. What would end the interpreter runs in
one of its own."""

from __future__ import annotations

import subprocess
import sys
import textwrap
import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import lodlab as lod
from lodlab import _core
from lodlab.errors import GLError, InvalidInput

VIEW = lod.View((300, -1500, 900), (300, -300, 0), size=(64, 48))
BUDGET = lod.Budget(pixel_error=1.0)


@pytest.fixture(scope="module")
def field():
    return lod.HeightField(np.random.default_rng(0).normal(size=(40, 45)).cumsum(0) * 3.0)


@pytest.fixture(scope="module")
def stores(field, tmp_path_factory):
    folder = tmp_path_factory.mktemp("threads")
    return {m: lod.build(field, m, folder / f"{m}.lod", progress=False) for m in ("full", "chunked", "multigrain")}


def alone(text, *arguments):
    """What a script prints in an interpreter of its own; a crash is a failure."""
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(text), *arguments], capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, f"status {done.returncode}: {done.stderr[-2000:]}"
    return done.stdout.splitlines()


def in_thread(work):
    """What a call returns or raises in a thread of its own, which then ends."""
    with ThreadPoolExecutor(1) as pool:
        done = pool.submit(work)
        return done.exception() or done.result()


def test_a_session_is_its_first_users_while_that_thread_lives(stores):
    session = stores["chunked"].core.session({})
    session.select(VIEW, BUDGET)
    for use in (
        lambda: session.select(VIEW, BUDGET),
        lambda: session.reset(),
        lambda: session.resident_bytes,
        lambda: session.audit_cuts(),
        lambda: session.draw(session.select(VIEW, BUDGET), VIEW),
    ):
        with pytest.raises(GLError, match="belongs to the thread that first used it"):
            raise in_thread(use)


def test_a_session_goes_on_with_the_next_thread_when_its_own_has_ended(stores):
    session = stores["multigrain"].core.session({})
    first = in_thread(lambda: session.select(VIEW, BUDGET).triangles)
    assert first == in_thread(lambda: session.select(VIEW, BUDGET).triangles) == session.select(VIEW, BUDGET).triangles


def test_two_threads_that_select_on_one_session_get_errors_and_no_crash(stores):
    session = stores["multigrain"].core.session({})  # nobody's before the first select
    seen, start = [], threading.Barrier(2)

    def work():
        start.wait()
        for i in range(40):
            try:
                session.select(VIEW, lod.Budget(pixel_error=0.1 + i % 7))
            except GLError as error:
                seen.append(str(error))
        start.wait()  # neither ends, and is followed, before the other is done

    threads = [threading.Thread(target=work) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(seen) == 40 and all("first used it" in text for text in seen)


def test_threads_that_end_hand_the_context_on(stores):
    """Systems give the id of a thread that has ended to the next one; notebooks' executors do just that."""
    said = alone(
        """
        import sys, threading
        import lodlab as lod
        view = lod.View((300, -1500, 900), (300, -300, 0), size=(64, 48))
        pictures = []
        def work(path):
            store = lod.open(path)
            cut = store.select(view, lod.Budget(pixel_error=1.0))
            pictures.append(store.draw(cut).image.sum())
        for path in [*sys.argv[1:], *sys.argv[1:]]:
            thread = threading.Thread(target=work, args=(path,))
            thread.start()
            thread.join()
        work(sys.argv[1])  # and the main thread after them
        n = len(sys.argv) - 1
        assert pictures[:n] == pictures[n : 2 * n] and pictures[2 * n] == pictures[0], pictures
        def late():
            try:
                work(sys.argv[1])
            except lod.errors.GLError as error:
                print(error)
        thread = threading.Thread(target=late)
        thread.start()
        thread.join()
        """,
        *(str(store.path) for store in stores.values()),
    )
    assert len(said) == 1 and "belongs to the thread that first drew" in said[0]


def test_a_measurement_is_asked_by_two_threads_at_once(field, stores):
    session = stores["chunked"].core.session({})
    cut = session.select(VIEW, BUDGET)
    measurement = _core.Instrument(field.core, None).examine(session, cut, VIEW, pictures=False)
    expected = measurement.crack_edges  # captured on this thread, the context's
    with ThreadPoolExecutor(2) as pool:
        names = ["measured_max", "measured_rms", "measured_px_max", "hole_samples"] * 4
        values = list(pool.map(lambda name: getattr(measurement, name), names))
    assert values[:4] == values[4:8] and measurement.crack_edges == expected == 0


@pytest.mark.parametrize(
    "call",
    [
        lambda f, s, c: _core.Instrument(None, None),
        lambda f, s, c: _core.Instrument(f, None).examine(None, c, VIEW),
        lambda f, s, c: _core.Instrument(f, None).examine(s, None, VIEW, pictures=False),
        lambda f, s, c: _core.Instrument(f, None).examine_parts([(s, None)], VIEW),
        lambda f, s, c: _core.Instrument(f, None).examine_parts([(None, c)], VIEW),
        lambda f, s, c: _core.Instrument(f, None).examine_parts([(s, c)], VIEW, before=[(s, None)]),
        lambda f, s, c: _core.build(None, "full", "/nowhere/a.lod", {}, "new", None),
        lambda f, s, c: _core.StaticMesh(s.capture(c, VIEW, True), None),
        lambda f, s, c: type(s.capture(c, VIEW, True)).triangles.fget(None),
        lambda f, s, c: s.draw(None, VIEW),
        lambda f, s, c: s.draw(c, None),
        lambda f, s, c: s.select(None, BUDGET),
        lambda f, s, c: s.select(VIEW, None),
        lambda f, s, c: s.capture(None, VIEW),
        lambda f, s, c: s.time_frame(None, None),
        lambda f, s, c: _core.time_select(None, [VIEW], BUDGET, 1),
        lambda f, s, c: _core.time_scan(None, [VIEW], 1.0, 1),
        lambda f, s, c: _core.time_select(s, [None], BUDGET, 1),
    ],
)
def test_none_is_refused_where_an_object_is_needed(field, stores, call):
    session = stores["chunked"].core.session({})
    cut = session.select(VIEW, BUDGET)
    with pytest.raises((InvalidInput, TypeError), match="None|incompatible"):
        call(field.core, session, cut)


def test_every_function_of_the_core_survives_none(stores):
    """Every callable, with None for each of up to eight arguments: an exception or a value, in a process of its own."""
    alone(
        """
        import inspect, sys
        import numpy as np
        import lodlab as lod
        from lodlab import _core
        store = lod.open(sys.argv[1])
        session = store.core.session({})
        view = lod.View((300, -1500, 900), (300, -300, 0), size=(64, 48))
        cut = session.select(view, lod.Budget(pixel_error=1.0))
        capture = session.capture(cut, view, True)
        things = [_core, store.core, session, cut, capture, session.draw(cut, view, "shade"), view,
                  lod.Budget(pixel_error=1.0), _core.HeightField(np.zeros((3, 3), np.float32), None, dx=1.0, dy=1.0)]
        tried = 0
        for thing in things:
            for name in dir(thing):
                if name.startswith("__") or name in ("set_thread_count", "choose_device"):
                    continue
                try:
                    member = getattr(thing, name)
                except Exception:
                    continue
                if not callable(member) or (inspect.isclass(member) and issubclass(member, BaseException)):
                    continue
                for count in range(9):
                    tried += 1
                    try:
                        member(*[None] * count)
                    except Exception:
                        pass
        assert tried > 300, tried
        """,
        str(stores["chunked"].path),
    )
