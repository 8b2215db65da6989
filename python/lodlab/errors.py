# SPDX-License-Identifier: MIT
"""The typed errors of lodlab. A message names the operation, the value and the limit.

`InvalidInput` (a `ValueError`): the caller's mistake. `StoreError` (an `OSError`): a store that cannot be
read, written or trusted. `GLError` (a `RuntimeError`): EGL, OpenGL or a shader failed. `Unsupported`
(a `RuntimeError`): the method or the machine cannot do what was asked, by design.

`BrokenPromise` (a `UserWarning`): the results are there and can be trusted, and they show a law broken; the command
line ends with status 1 after one. `warnings.simplefilter("error", lodlab.errors.BrokenPromise)` makes it an error.
"""

from __future__ import annotations

from ._core import GLError, InvalidInput, StoreError, Unsupported

__all__ = ["BrokenPromise", "GLError", "InvalidInput", "StoreError", "Unsupported"]


class BrokenPromise(UserWarning):
    """A measured run breaks a law: which, in which run and frame, and by how much."""
