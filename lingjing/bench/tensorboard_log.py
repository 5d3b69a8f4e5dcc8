"""The rows of a suite as curves in TensorBoard, offline: a run for each entrant and column, a step for each seed."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from os import PathLike, fspath
from pathlib import Path
from typing import Any, Self

from lingjing.bench.rows import SuiteRow
from lingjing.errors import UsageError


class TensorboardLog:
    """A receiver of rows for `lingjing.bench(…, progress=…)`, which writes event files below a folder.

    A run is `ENTRANT/MISSION-MODE`, a step is a seed, and each metric that is a number is a scalar. Rows of aborted
    episodes are left out. `close` ends the files; they are complete after each row too.

        with TensorboardLog("runs/tensorboard") as log:
            lingjing.bench("small.toml", out="runs/bench/small", progress=log)

    Raises `UsageError` if the package tensorboard is not installed, and if the folder cannot be written.
    """

    def __init__(self, folder: str | PathLike[str]) -> None:
        self._folder = Path(fspath(folder))
        self._make = _writer()
        self._writers: dict[str, Any] = {}
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise UsageError(f"cannot write `{folder}`: {error.strerror}", hint="choose another folder") from error

    def __call__(self, row: SuiteRow) -> None:
        """Write the metrics of a row."""
        metrics = row.report.metrics
        if row.standing == "aborted" or metrics is None:
            return
        run = "/".join((_plain(row.entrant), f"{_plain(row.mission)}-{row.mode}"))
        writer = self._writers.get(run) or self._writers.setdefault(run, self._make(str(self._folder / run)))
        for name, value in metrics.items():
            if isinstance(value, bool | int | float):
                writer.add_scalar(name, float(value), step=row.seed)
        writer.flush()

    def close(self) -> None:
        """End all files."""
        for writer in self._writers.values():
            writer.close()
        self._writers.clear()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _writer() -> Callable[[str], Any]:
    try:
        make: Callable[[str], Any] = import_module("tensorboard.summary").Writer
    except ImportError as error:
        raise UsageError("the log needs the package tensorboard", hint="pip install tensorboard") from error
    return make


def _plain(name: str) -> str:
    """Return a name as one part of a path: an entrant may be `FILE.py:CLASS`."""
    return "".join(letter if letter.isalnum() or letter in "-_.:" else "_" for letter in name).lstrip(".") or "_"


__all__ = ["TensorboardLog"]
