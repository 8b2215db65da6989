# SPDX-License-Identifier: MIT
"""Every method that accepts meshes keeps the contract over them; the others refuse them with a reason."""

from __future__ import annotations

from pathlib import Path

import pytest

import lodlab as lod
from lodlab.stability import meshes
from tests.mesh_contract import MeshContract

METHODS = {m["name"]: "mesh" in m["accepts"] for m in lod.methods()}

for _name in (name for name, accepts in METHODS.items() if accepts):
    globals()[f"Test{_name.title()}"] = type(f"Test{_name.title()}", (MeshContract,), {"method": _name})


@pytest.mark.parametrize("method", [name for name, accepts in METHODS.items() if not accepts])
def test_a_method_of_fields_refuses_meshes(method: str, tmp_path: Path) -> None:
    with pytest.raises(lod.errors.Unsupported, match=f"method {method} does not accept a mesh"):
        lod.build(meshes.load("mesh:closed"), method, tmp_path / "a.lod", progress=False)
    assert not list(tmp_path.iterdir())
