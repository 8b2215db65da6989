# SPDX-License-Identifier: MIT
"""Configurations: what a sweep is to fly, checked, frozen with every default, and laid out as a plan.

A TOML file, or a dict of the same shape:

    sources = ["jacksboro"]          # SOURCE texts
    paths = ["flyover"]              # built-in names or key-frame files; left out: flyover, orbit where one is a mesh;
                                     # with +bend, +twist, +wave or +FILE.npy behind it what deforms the mesh
    frames = 120                     # per path
    size = [1280, 720]               # pixels
    fov = 60.0                       # horizontal, degrees; left out: key-frame files' own, or 60
    accuracy_frames = 12             # measured frames, evenly spaced
    repeat = 1                       # timing passes
    images = "worst"                 # all | worst | none
    metrics = "all"                  # all | geometry: no picture is drawn to measure, their columns are nan
    device = ""                      # "": LODLAB_DEVICE or auto
    pixel_errors = [0.5, 1, 2]       # budgets, for every method that has none of its own;
    triangles = []                   # where several kinds are given, every combination
    nodes = []

    [[methods]]
    name = "chunked"
    pixel_errors = [1]               # optional: this method's own budgets
    options = { morph = ["true", "formula4"], finest_error = 0.0 }   # a list is a grid

    [[hashes]]                       # in a run directory: of what its rows rest on; what differs is refused
    what = "source"
    name = "jacksboro"
    value = "..."

Methods that ignore budgets (`full`) make one run per path. Every default is written out in `config.toml`.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from .. import _core
from ..disk import absolute_parts
from ..errors import InvalidInput
from ..paths.path import DEFAULT_FOV, label_of, of_keys
from ..sources.spec import short_source
from ..stores.methods import method_table, options_of
from ..stores.store import Store
from . import tables
from .directory import RunDirectory
from .flight import Flight, budget_text, check_budget, run_name
from .identity import check_hashes, merged

BUDGET_LISTS = {"pixel_errors": "pixel_error", "triangles": "triangles", "nodes": "nodes"}
DEFAULTS: dict[str, Any] = {
    "sources": [],
    "paths": ["flyover"],
    "frames": 120,
    "size": [1280, 720],
    "fov": None,
    "accuracy_frames": 12,
    "repeat": 1,
    "images": "worst",
    "metrics": "all",
    "device": "",
    "pixel_errors": [],
    "triangles": [],
    "nodes": [],
    "methods": [],
    "hashes": [],
}
GROWING = ("sources", "paths", "methods", "hashes")  # what a run directory may hold more of
DEFAULT_PIXEL_ERRORS = (0.5, 1.0, 2.0, 4.0, 8.0)
_KINDS = {"frames": int, "fov": float, "accuracy_frames": int, "repeat": int, "images": str, "metrics": str,
          "device": str}  # fmt: skip


# ---- configuration --------------------------------------------------------------------------------


def freeze(config: Mapping[str, Any]) -> dict[str, Any]:
    """A configuration with every default written out and every value checked.

    InvalidInput names an unknown key, method or option (listing the known ones) or a value out of range;
    Unsupported a budget that a method does not have.
    """
    _known("configuration", config, DEFAULTS)
    out: dict[str, Any] = {**DEFAULTS, **config}
    for key, kind in _KINDS.items():
        if out[key] is not None or key != "fov":
            out[key] = _typed(key, out[key], kind)
    for key in ("sources", "paths"):
        out[key] = _texts(key, out[key])
    if out["fov"] is None and not any(of_keys(path) for path in out["paths"]):
        out["fov"] = DEFAULT_FOV
    if not (isinstance(out["size"], (list, tuple)) and len(out["size"]) == 2):
        raise InvalidInput(f"configuration: size is {out['size']!r}; it is [width, height] in pixels")
    out["size"] = [_typed("size", v, int) for v in out["size"]]
    Flight(
        "", "", "", {}, {}, out["frames"], images=out["images"], accuracy_frames=out["accuracy_frames"],
        repeat=out["repeat"], metrics=out["metrics"],
    ).check()  # fmt: skip
    common = {key: _budgets(key, out.pop(key)) for key in BUDGET_LISTS}
    if not isinstance(out["methods"], list) or not out["methods"]:
        raise InvalidInput("configuration: no methods; give at least one [[methods]] with a name")
    out["methods"] = [_freeze_method(m, common) for m in out["methods"]]
    if not isinstance(out["hashes"], list):
        raise InvalidInput(f"configuration: hashes is {out['hashes']!r}; it is a list of tables with what, name, value")
    out["hashes"] = [_freeze_hash(entry) for entry in out["hashes"]]
    return out


def _freeze_hash(entry: Any) -> dict[str, str]:
    fits = isinstance(entry, Mapping) and set(entry) == {"what", "name", "value"}
    if not fits or not all(isinstance(v, str) for v in entry.values()):
        raise InvalidInput(f"configuration: hashes holds {entry!r}; it is a table of the texts what, name, value")
    return dict(entry)


def _freeze_method(given: Mapping[str, Any] | str, common: Mapping[str, list[Any]]) -> dict[str, Any]:
    given = {"name": given} if isinstance(given, str) else given
    if not isinstance(given, Mapping):
        raise InvalidInput(f"configuration: methods holds {given!r}; it is a table with a name")
    _known("[[methods]]", given, {"name": "", "options": {}, **BUDGET_LISTS})
    if "name" not in given:
        raise InvalidInput("configuration: a [[methods]] has no name")
    table = method_table(given["name"])
    own = {key: _budgets(key, given[key]) for key in BUDGET_LISTS if key in given}
    budgets = own if any(own.values()) else dict(common)
    if not table["budgets"]:
        budgets = {}
    method: dict[str, Any] = {"name": given["name"], **{k: v for k, v in budgets.items() if v}}
    for budget in _budget_grid(method):
        check_budget(method["name"], budget)
    method["options"] = _freeze_options(given["name"], given.get("options", {}))
    return method


def _freeze_options(method: str, given: Mapping[str, Any]) -> dict[str, Any]:
    """All options of a method, defaults written out; lists stay lists."""
    if not isinstance(given, Mapping):
        raise InvalidInput(f"options of {method}: {given!r} is no table of names and values")
    build, draw = options_of(method, "build"), options_of(method, "draw")
    for name in given:
        if name not in build and name not in draw:
            known = ", ".join(build + draw) or "none"
            raise InvalidInput(f"options of {method}: no option {name!r}; it has {known}")
    out: dict[str, Any] = {}
    for stage, names in (("build", build), ("draw", draw)):
        out.update(_core.resolve_options(method, stage, {}))
        for name in (n for n in names if n in given):
            values = given[name] if isinstance(given[name], (list, tuple)) else [given[name]]
            if not values:
                raise InvalidInput(f"options of {method}: {name} is an empty list")
            checked = [_core.resolve_options(method, stage, {name: v})[name] for v in values]
            checked = [absolute_parts(v) if isinstance(v, str) else v for v in checked]
            out[name] = checked if len(checked) > 1 else checked[0]
    return dict(sorted(out.items()))


def _known(where: str, given: Mapping[str, Any], known: Mapping[str, Any]) -> None:
    for key in given:
        if key not in known:
            raise InvalidInput(f"{where}: no key {key!r}; it has {', '.join(known)}")


def _typed(key: str, value: Any, kind: type) -> Any:
    fits = isinstance(value, (int, float) if kind is float else kind) and not isinstance(value, bool)
    if not fits:
        raise InvalidInput(f"configuration: {key} is {value!r}; it is {kind.__name__}")
    return kind(value)


def _texts(key: str, values: Any) -> list[str]:
    values = [values] if isinstance(values, str) or not isinstance(values, (list, tuple)) else list(values)
    if not values or not all(isinstance(v, str) and v for v in values):
        raise InvalidInput(f"configuration: {key} is {values!r}; it is a list of at least one text")
    if len(set(values)) != len(values):
        raise InvalidInput(f"configuration: {key} names one twice: {', '.join(values)}")
    return values


def _budgets(key: str, values: Any) -> list[Any]:
    kind = float if key == "pixel_errors" else int
    values = list(values) if isinstance(values, (list, tuple)) else [values]
    out = [_typed(key, v, kind) for v in values]
    for value in out:
        if not value > 0:
            raise InvalidInput(f"configuration: {key} holds {value}; a budget is above 0")
    return out


def _budget_grid(method: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """Every combination of a method's budget lists."""
    lists = [[(name, v) for v in method[key]] for key, name in BUDGET_LISTS.items() if method.get(key)]
    for values in itertools.product(*lists):
        yield dict(values)


def flight_config(store: Store, flight: Flight, device: str | None) -> dict[str, Any]:
    """The configuration of a single run, in the schema of sweeps."""
    budget = flight.budget if method_table(store.method)["budgets"] else {}
    lists = {key: [budget[name]] for key, name in BUDGET_LISTS.items() if name in budget}
    return {
        "sources": [flight.source],
        "paths": [flight.path],
        "frames": flight.frames,
        "size": list(flight.size),
        "fov": flight.fov,
        "accuracy_frames": flight.accuracy_frames,
        "repeat": flight.repeat,
        "images": flight.images,
        "metrics": flight.metrics,
        "device": device or "",
        "hashes": [],
        "methods": [
            {
                "name": store.method,
                **lists,
                "options": dict(sorted({**store.options, **flight.options}.items())),
            }
        ],
    }


# ---- a directory that grows ------------------------------------------------------------------------


def grow(old: Mapping[str, Any] | None, new: Mapping[str, Any], where: Any) -> dict[str, Any]:
    """One configuration of the one that a run directory holds (None: none yet) and the one to be flown: the grid
    of both. InvalidInput names what contradicts: a value that all runs of a directory share."""
    if old is None:
        return dict(new)
    wide = {"fov": DEFAULT_FOV}  # what a path without one of its own has; one that has is known by its poses
    shared = [
        {k: wide.get(k) if v is None else v for k, v in {"fov": None, **config}.items() if k not in GROWING}
        for config in (old, new)
    ]
    if difference := first_difference(*shared):
        raise InvalidInput(
            f"run directory: {where} holds runs of another configuration ({difference}); choose another directory "
            "or remove this one"
        )
    out = {**new, **{key: _union(old[key], new[key]) for key in ("sources", "paths")}}
    out["fov"] = None if old.get("fov") is None else new["fov"]
    out["methods"] = [dict(method) for method in old["methods"]]
    for method in new["methods"]:
        joined = ((i, _join(known, method)) for i, known in enumerate(out["methods"]))
        at, found = next(((i, one) for i, one in joined if one is not None), (len(out["methods"]), method))
        out["methods"][at : at + 1] = [found]
    out["hashes"] = list(old.get("hashes", []))
    return out


def _union(old: Any, new: Any) -> list[Any]:
    """The values of both, each once, in order; a value that is no list is one of one."""
    both = [*(old if isinstance(old, list) else [old]), *(new if isinstance(new, list) else [new])]
    return [value for i, value in enumerate(both) if value not in both[:i]]


def _join(old: Mapping[str, Any], new: Mapping[str, Any]) -> dict[str, Any] | None:
    """One table of [[methods]] for both, where they are a grid together: the same kinds of budgets, and at most one
    option in which they differ."""
    budgets = [[key for key in BUDGET_LISTS if method.get(key)] for method in (old, new)]
    changed = [k for k, v in new["options"].items() if old["options"].get(k) != v]
    if old["name"] != new["name"] or budgets[0] != budgets[1] or len(changed) > 1:
        return None
    options = dict(old["options"])
    for name in changed:
        values = _union(options[name], new["options"][name])
        options[name] = values if len(values) > 1 else values[0]
    return {"name": old["name"], **{key: _union(old[key], new[key]) for key in budgets[0]}, "options": options}


# ---- the plan -------------------------------------------------------------------------------------

KEY = ("source", "path", "method", "options", *(f"budget_{name}" for name in BUDGET_LISTS.values()))


@dataclass(frozen=True)
class Task:
    """A flight and the store that it needs."""

    flight: Flight
    method: str
    build_options: dict[str, Any]

    @property
    def key(self) -> tuple[str, ...]:
        """What tells its rows from those of other runs of a directory, as text: columns of KEY."""
        budget = self.flight.budget if method_table(self.method)["budgets"] else {}
        options = _plain({**self.build_options, **self.flight.options})
        limits = (tables.cell(budget.get(name)) for name in BUDGET_LISTS.values())
        return (self.flight.source, self.flight.path, self.method, options, *limits)


def enter(
    directory: RunDirectory,
    config: Mapping[str, Any],
    hashes_of: Callable[[Sequence[Task]], list[dict[str, str]]],
    called: str = "configuration",
) -> tuple[dict[str, Any], list[Task]]:
    """Makes a directory ready for a configuration: what stands in it and what is to be flown as one grid, and its
    plan. `hashes_of` says what the rows of given runs rest on now; `called`: the configuration, in messages.
    InvalidInput where something contradicts, or has changed under its name; nothing is written then."""
    old = directory.config
    if old is not None:  # what is left of one that was cut off is made whole
        old = {**old, "methods": freeze(old)["methods"]}
    grown = grow(old, config, directory.path)
    tasks = plan(grown)
    names = names_of(directory.done, tasks)
    done = set(names.values())
    now = hashes_of([*plan(config), *(task for task in tasks if task.flight.name not in done)])
    check_hashes(called, config["hashes"], now)
    check_hashes(f"run directory {directory.path}", grown["hashes"], now)
    grown["hashes"] = merged(grown["hashes"], now)
    directory.begin(grown, {name for task in tasks for name in (*task.build_options, *task.flight.options)}, names)
    return grown, tasks


def names_of(done: Mapping[str, Mapping[str, str]], tasks: Iterable[Task]) -> dict[str, str]:
    """The names that finished runs (their summary rows by name) have in a plan: old to new. Runs of no task keep
    theirs."""
    planned = {task.key: task.flight.name for task in tasks}
    rows = {name: {**row, "options": _plain(json.loads(row["options"]))} for name, row in done.items()}
    return {name: planned.get(tuple(row[c] for c in KEY), name) for name, row in rows.items()}


def _plain(options: Mapping[str, Any]) -> str:
    """Options as text in which 0.0 is 0: stores keep a whole number without its point."""
    whole = {k: int(v) if isinstance(v, float) and v.is_integer() else v for k, v in options.items()}
    return tables.options_text(whole)


def plan(config: Mapping[str, Any]) -> list[Task]:
    """The runs of a frozen configuration, in order, with readable names that differ."""
    grid = []
    for source, path, method in itertools.product(config["sources"], config["paths"], config["methods"]):
        options = method["options"]
        names = list(options)
        for values in itertools.product(*(v if isinstance(v, list) else [v] for v in options.values())):
            chosen = dict(zip(names, values, strict=True))
            for budget in _budget_grid(method):
                grid.append((source, path, method["name"], chosen, budget))
    seen: dict[tuple[str, str], set[str]] = {}
    for _, _, name, chosen, _ in grid:
        for option, value in chosen.items():
            seen.setdefault((name, option), set()).add(tables.options_text({"": value}))
    tasks, names_used = [], set()
    for source, path, method, chosen, budget in grid:
        varied = [f"{k}={tables.cell(v)}" for k, v in chosen.items() if len(seen[method, k]) > 1]
        camera, deform = label_of(path)
        many = [short_source(source) if len(config["sources"]) > 1 else "", camera if len(config["paths"]) > 1 else ""]
        many.append(deform)
        name = run_name(*many, method, *varied, budget_text(budget))
        unique, n = name, 2
        while unique in names_used:
            unique, n = f"{name}_{n}", n + 1
        names_used.add(unique)
        draw = {k: chosen[k] for k in options_of(method, "draw")}
        flight = Flight(
            unique, source, path, budget, draw, config["frames"], tuple(config["size"]), config["fov"],
            config["accuracy_frames"], config["repeat"], config["images"], config["metrics"],
        )  # fmt: skip
        tasks.append(Task(flight, method, {k: chosen[k] for k in options_of(method, "build")}))
    return tasks


def first_difference(old: Any, new: Any, where: str = "") -> str | None:
    """Names the first key at which two configurations differ, or None."""
    if isinstance(old, Mapping) and isinstance(new, Mapping):
        for key in [*old, *(k for k in new if k not in old)]:
            if key not in old or key not in new:
                return f"{where}{key}: {old.get(key, 'unset')} there, {new.get(key, 'unset')} now"
            found = first_difference(old[key], new[key], f"{where}{key}.")
            if found:
                return found
        return None
    if isinstance(old, list) and isinstance(new, list):
        for i, (a, b) in enumerate(zip(old, new, strict=False)):
            found = first_difference(a, b, f"{where}{i + 1}.")
            if found:
                return found
    return None if old == new else f"{where.rstrip('.')}: {old!r} there, {new!r} now"
