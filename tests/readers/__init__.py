"""Foxglove's own readers, run by Node.js: `make readers` installs them."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

HERE = Path(__file__).parent


def skip_without_node() -> None:
    """Skip the module that calls this where there is no Node.js or its packages are not installed."""
    if shutil.which("node") is None or not (HERE / "node_modules" / "@mcap" / "core").is_dir():
        pytest.skip("Node.js or Foxglove's readers are not installed: run `make readers`", allow_module_level=True)


def node(script: str, *arguments: object) -> str:
    """Return the output of a script of this folder. Raises `subprocess.CalledProcessError`."""
    command = ["node", str(HERE / script), *map(str, arguments)]
    return subprocess.run(command, check=True, capture_output=True, text=True, timeout=600).stdout
