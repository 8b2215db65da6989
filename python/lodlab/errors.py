# SPDX-License-Identifier: MIT
"""The typed errors of lodlab. A message names the operation, the value and the limit.

`InvalidInput` (a `ValueError`): the caller's mistake. `StoreError` (an `OSError`): a store that cannot be
read, written or trusted. `GLError` (a `RuntimeError`): EGL, OpenGL or a shader failed. `Unsupported`
(a `RuntimeError`): the method or the machine cannot do what was asked, by design.
"""

from __future__ import annotations

from ._core import GLError, InvalidInput, StoreError, Unsupported

__all__ = ["GLError", "InvalidInput", "StoreError", "Unsupported"]
