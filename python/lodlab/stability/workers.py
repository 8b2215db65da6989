# SPDX-License-Identifier: MIT
"""Trials of the random search in processes of their own, and scene s20, which sums up what they find.

A worker says which trial it begins before it plays it. One that dies (a crash) or stands still (a hang) loses that
trial alone: it is noted, and another worker goes on with the next. Which trials there are depends on the seed alone,
not on the number of workers.
"""

from __future__ import annotations

import json
import multiprocessing
import os
import tempfile
import time
import warnings
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any

from .. import _core
from .search import LAWS, Found, make_source, make_view, play
from .stage import Figure, Stage
from .trials import draw_trial, ground_of

SHORT_TRIALS, LONG_TRIALS = 90, 3000  # a method, where no time is named
PATIENCE = 120.0  # seconds for one trial; beyond: a hang
CRASH = "crash"
MOST_FINDS = 100  # of a law: what is kept of each is its line


@dataclass
class Sum:
    """What all trials of a method found. `kinds`: trials by kind; `broken`: failed checks by law; `finds`: by law,
    (trial's line, sentence) of the first; `refused`: by reason, without its numbers."""

    trials: int = 0
    checks: Counter[str] = field(default_factory=Counter)
    kinds: Counter[str] = field(default_factory=Counter)
    by_nature: Counter[str] = field(default_factory=Counter)
    refused: Counter[str] = field(default_factory=Counter)
    broken: Counter[str] = field(default_factory=Counter)
    finds: dict[str, list[tuple[str, str]]] = field(default_factory=lambda: defaultdict(list))

    def add(self, method: str, seed: int, index: int, found: Found) -> None:
        trial = draw_trial(method, seed, index)
        self.trials += 1
        self.kinds[trial.kind] += 1
        self.checks += found.checks
        self.by_nature += found.by_nature
        self.refused.update("".join("#" if c.isdigit() else c for c in r)[:100] for r in found.refused)
        for law, sentence in found.broken:
            self.broken[law] += 1
            if len(self.finds[law]) < MOST_FINDS:
                self.finds[law].append((trial.name, sentence))

    def __str__(self) -> str:
        kinds = ", ".join(f"{count:,} {kind}" for kind, count in sorted(self.kinds.items()))
        laws = ", ".join(f"{law} {self.checks[law]:,}" for law in LAWS if self.checks[law])
        return (
            f"{self.trials:,} trials ({kinds}); checks: {laws}; {sum(self.broken.values()):,} broken, "
            f"{sum(self.by_nature.values()):,} by nature, {sum(self.refused.values()):,} refused"
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        return {name: dict(v) if isinstance(v, dict) else v for name, v in vars(self).items()}


# ---- processes ------------------------------------------------------------------------------------


def work(pipe: Connection, method: str, seed: int, act: Callable[..., Found]) -> None:
    """A worker: plays the trials whose numbers it is sent, until it is sent None."""
    os.environ.setdefault("LP_NUM_THREADS", "1")  # llvmpipe's; the processes are the parallel part
    _core.set_thread_count(1)
    warnings.simplefilter("ignore")  # what users are warned of at options is searched on purpose
    pipe.send("ready")
    while (index := pipe.recv()) is not None:
        with tempfile.TemporaryDirectory() as folder:
            pipe.send(act(draw_trial(method, seed, index), Path(folder)))


class _Worker:
    """A process and the trial that it plays."""

    def __init__(self, method: str, seed: int, act: Callable[..., Found]):
        context = multiprocessing.get_context("spawn")
        self.pipe, other = context.Pipe()
        self.process = context.Process(target=work, args=(other, method, seed, act), daemon=True)
        self.process.start()
        other.close()
        self.index: int | None = None
        self.since = time.monotonic()

    def begin(self, index: int | None) -> None:
        self.index, self.since = index, time.monotonic()
        self.pipe.send(index)

    def end(self) -> None:
        self.process.kill()
        self.process.join()
        self.pipe.close()


def search(
    method: str,
    *,
    seed: int = 0,
    trials: int | None = None,
    seconds: float | None = None,
    jobs: int | None = None,
    act: Callable[..., Found] = play,
    patience: float = PATIENCE,
) -> Iterator[tuple[int, Found]]:
    """Plays trials 0, 1, 2, ... of a method in `jobs` processes (default: one for each core) until their number or
    the seconds (from when the first is ready) are reached; (number, what it found) as they end. A crash or a hang is a
    broken law `crash`."""
    end = None  # counted from when the first worker is ready
    waiting = iter(range(trials if trials is not None else 10**12))
    jobs = jobs or len(os.sched_getaffinity(0))
    workers = [_Worker(method, seed, act) for _ in range(min(jobs, trials or jobs))]
    try:
        while workers:
            ready = wait([w.pipe for w in workers], timeout=1.0)
            for worker in list(workers):
                hung = worker.index is not None and time.monotonic() - worker.since > patience
                if worker.pipe not in ready and not hung:
                    continue
                workers.remove(worker)
                found = _result(worker, hung)
                if found is not None and worker.index is not None:
                    yield worker.index, found
                if not worker.process.is_alive() or hung:
                    if found is None:
                        raise RuntimeError(f"search: a worker ended before its first trial ({worker.process.exitcode})")
                    worker.end()
                    worker = _Worker(method, seed, act)
                    workers.append(worker)
                    continue
                if end is None and seconds is not None:
                    end = time.monotonic() + seconds
                over = end is not None and time.monotonic() >= end
                index = None if over else next(waiting, None)
                worker.begin(index)
                if index is None:
                    worker.process.join(10.0)
                    worker.end()
                else:
                    workers.append(worker)
    finally:
        for worker in workers:
            worker.end()


def _result(worker: _Worker, hung: bool) -> Found | None:
    """What a worker sent; for one that died or hung a find that says so; None when it only began."""
    try:
        sent = None if hung else worker.pipe.recv()
    except EOFError:
        worker.process.join()
        code = worker.process.exitcode
        if worker.index is None:
            return None
        reason = f"signal {-code}" if code is not None and code < 0 else f"status {code}"
        return Found(broken=[(CRASH, f"the process ended with {reason}")])
    if hung:
        return Found(broken=[(CRASH, f"no answer after {time.monotonic() - worker.since:.0f} s")])
    return sent if isinstance(sent, Found) else None


# ---- the scene ------------------------------------------------------------------------------------


def random_search(stage: Stage) -> Iterator[Figure]:
    """Failure: what nobody thought of. Test: seeded random sources (shapes, voids, sizes, spacings, globes and windows
    of them), options at the ends of their ranges, views (inside, under, at the border, far, trembling, grazing),
    budgets at the least that a cut needs, streaming under small caches, random cuts; every law that can be checked in
    a frame is. Figures: checks that failed, a figure for each law, named after the first trial that breaks it, limit
    0; crashes and hangs, limit 0. `search-METHOD.json` has the counts and every find.
    """
    from ..progress import tqdm

    total = Sum()
    trials = None if stage.seconds else SHORT_TRIALS if stage.short else LONG_TRIALS
    found_by = search(stage.method, seed=stage.seed, trials=trials, seconds=stage.seconds)
    with tqdm(
        found_by, stage.method, trials, leave=False, disable=None if stage.progress else True, unit="trial"
    ) as bar:
        for index, found in bar:
            total.add(stage.method, stage.seed, index, found)
            bar.set_postfix(broken=sum(total.broken.values()))
    if not total.trials:
        raise RuntimeError("search: no trial was played: nothing tried proves nothing")
    record = {"method": stage.method, "seed": stage.seed, "summary": str(total), **total.to_dict()}
    stage.bench.folder.parent.joinpath(f"search-{stage.method}.json").write_text(json.dumps(record, indent=1) + "\n")
    picture = _picture(stage, total)
    for law in (*LAWS, CRASH):
        if total.checks[law] or total.broken[law] or law == CRASH:
            first = f": {total.finds[law][0][0]}" if total.broken[law] else ""
            of = f"of {total.checks[law]} checks" if law != CRASH else f"of {total.trials} trials"
            yield Figure(f"{law}, {of}{first}", total.broken[law], "checks", 0, picture)


def _picture(stage: Stage, total: Sum) -> Any:
    """The first frame of the first trial that can be drawn; of those that broke a law where there are any."""
    names = [finds[0][0] for law, finds in total.finds.items() if law != CRASH]
    indices = [int(name.split()[-1]) for name in names] + list(range(20))
    for index in indices:
        trial = draw_trial(stage.method, stage.seed, index)
        try:
            source = make_source(trial.source)
            other = stage.other(trial.name, source)
            view = make_view(ground_of(source), trial.frames[0]["view"])
            session = other.session()
            cut = session.select(view, _core.Budget(pixel_error=1.0))
            return session.draw(cut, view).image
        except Exception:  # noqa: S112 - a trial that cannot be drawn has no picture; another has
            continue
    return None
