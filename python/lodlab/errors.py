# SPDX-License-Identifier: MIT
"""The typed errors of lodlab. A message names the operation, the value and the limit.

`InvalidInput` (a `ValueError`): the caller's mistake. `StoreError` (an `OSError`): a store that cannot be
read, written or trusted. `GLError` (a `RuntimeError`): EGL, OpenGL or a shader failed. `Unsupported`
(a `RuntimeError`): the method or the machine cannot do what was asked, by design.

`BrokenPromise` (a `UserWarning`): the results are there and can be trusted, and they show a law broken; the command
line ends with status 1 after one. `warnings.simplefilter("error", lodlab.errors.BrokenPromise)` makes it an error.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from typing import Any

from ._core import GLError, InvalidInput, StoreError, Unsupported

__all__ = ["BrokenPromise", "GLError", "InvalidInput", "StoreError", "Unsupported"]


class BrokenPromise(UserWarning):
    """A measured run breaks a law: which, in which run and frame, and by how much."""


def close_to(name: str, known: Iterable[str], most: int = 4) -> list[str]:
    """The known names that a mistyped one may mean, likeliest first: similar ones, and those that it is part of."""
    known = list(known)
    similar = difflib.get_close_matches(name.lower(), known, n=most, cutoff=0.7)
    within = [other for other in known if len(name) > 2 and name.lower() in other]
    return list(dict.fromkeys([*similar, *within]))[:most]


def check_one_of(what: str, value: Any, known: Iterable[str]) -> None:
    """InvalidInput for a value that is none of the known ones, with those that it may mean."""
    known = list(known)
    if value not in known:
        close = close_to(str(value), known)
        meant = f" (close to it: {', '.join(close)})" if close else ""
        raise InvalidInput(f"{what} is {value!r}; it is one of {', '.join(known)}{meant}")
