"""A folder of Python's path in which tests install plug-ins."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

TRIED = "LINGJING_TRIED_PLUGINS"
"""The environment variable with the results of earlier trials."""


class Site:
    """A folder of Python's path with installed plug-ins."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def add(self, name: str, code: str | None, *, value: str | None = None, entry_points: bytes | None = None) -> None:
        """Install a plug-in: its module, unless `code` is None, and its metadata."""
        info = self.folder / f"lingjing_{name}-1.0.dist-info"
        info.mkdir(parents=True)
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: lingjing-{name}\nVersion: 1.0\n")
        written = f"[lingjing]\n{name} = {value or name}\n".encode()
        (info / "entry_points.txt").write_bytes(written if entry_points is None else entry_points)
        if code is not None:
            (self.folder / f"{name}.py").write_text(code)


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Site]:
    folder = tmp_path / "site"
    folder.mkdir()
    monkeypatch.syspath_prepend(str(folder))
    monkeypatch.setenv("PYTHONPATH", str(folder))
    monkeypatch.setenv(TRIED, "{}")
    yield Site(folder)
    for name in [name for name, module in sys.modules.items() if str(folder) in str(getattr(module, "__file__", ""))]:
        del sys.modules[name]
