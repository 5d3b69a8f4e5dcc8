"""Missions for heterogeneous unmanned systems: write, play, score and analyse them.

The packages in the order of the pipeline: `dsl` (text to mission), `mission` (the typed graph), `scene` (the city),
`plugins` (the contract of extensions), `engines` (physics and pictures), `kernel` (the episode), `trace` (its record),
`analysis` (metrics of a trace). `play` plays one episode, `bench` many; `authoring` tests missions; `report` draws
figures of results; `causal` replays and forks traces; `viewer` shows an episode in a browser or as a film; `envs` wraps
missions as learning environments; `serve` serves episodes to foreign clients;
`testing` makes instances, episodes and traces for tests. `cli` is the command line,
`lsp` the language server, `processes` starts, forks and ends processes.

Modules that all share:

- `errors`: the exceptions; `validation`: faults found by pydantic, in words
- `option_reading`: options checked by their models; `option_listing`: options in words; `suggest`: spellings;
  `articles`: "a" or "an"
- `collector`: pauses of the garbage collector; `numerics`: all that fixes the last bits of numbers;
  `sums`: sums that every version of Python computes alike
- `decoding`: typed values from JSON and msgpack
- `data`: the place of shipped files; `kept_files`: files of the cache; `whole_files`: atomic writes
- `notebook_tables`: tables of notebooks
- `file_names`: names that are not UTF-8
- `patterns`: regular expressions that are compiled at their first use; `digests`: SHA-256 without OpenSSL
- `builtin`: the built-in plug-in, which declares the engines, scenes, evaluators and types that ship
- `installation`: the distributions and their extras; `installed_plugins`: plug-ins of other distributions
- `refusals`: errors of the operating system; `system_hints`: their ways out; `terminal`: text that is safe to print

`docs/architecture.md` describes the whole, `docs/python.md` the use from Python. The public surface is this module,
`lingjing.plugins`, `lingjing.testing`, `lingjing.envs` and the command `lingjing`; all else may change. Exports are
lazy: importing this package loads no other module.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from lingjing.analysis.metrics import Metrics, metrics
    from lingjing.bench.playing import SuiteResults, bench
    from lingjing.causal.replay import replay
    from lingjing.dsl.loading.load import load_mission as compile  # noqa: A004 - `lingjing.compile` is the public name
    from lingjing.errors import InfrastructureError, LingjingError, MissionError, PluginError, UsageError
    from lingjing.mission.diagnostics import Diagnostic
    from lingjing.mission.model import Mission
    from lingjing.numerics import pin
    from lingjing.play.asynchronous import arun
    from lingjing.play.episode import Session, run
    from lingjing.play.options import PlayOptions
    from lingjing.play.report import EpisodeReport
    from lingjing.trace.reader import Trace
    from lingjing.trace.reader import read_trace as read
    from lingjing.trace.verification import verify_file as verify
    from lingjing.viewer.inline import InlineEpisode, show

    __version__: str

__all__ = [
    "Diagnostic", "EpisodeReport", "InfrastructureError", "InlineEpisode", "LingjingError", "Metrics",
    "Mission", "MissionError", "PlayOptions", "PluginError", "Session", "SuiteResults", "Trace", "UsageError",
    "__version__", "arun", "bench", "compile", "metrics", "pin", "read", "replay", "run", "show", "verify",
]  # fmt: skip

_RENAMED = {"read_trace": "read"}
"""Former names of exports, with the present ones."""

_PACKAGES = {"bench": "lingjing.bench"}
"""Exports that are packages of their own: `lingjing.bench` can be called, and holds the modules of suites."""

_EXPORTS = {
    "Diagnostic": ("lingjing.mission.diagnostics", "Diagnostic"),
    "EpisodeReport": ("lingjing.play.report", "EpisodeReport"),
    "InfrastructureError": ("lingjing.errors", "InfrastructureError"),
    "InlineEpisode": ("lingjing.viewer.inline", "InlineEpisode"),
    "LingjingError": ("lingjing.errors", "LingjingError"),
    "Metrics": ("lingjing.analysis.metrics", "Metrics"),
    "Mission": ("lingjing.mission.model", "Mission"),
    "MissionError": ("lingjing.errors", "MissionError"),
    "PlayOptions": ("lingjing.play.options", "PlayOptions"),
    "PluginError": ("lingjing.errors", "PluginError"),
    "Session": ("lingjing.play.episode", "Session"),
    "SuiteResults": ("lingjing.bench.playing", "SuiteResults"),
    "Trace": ("lingjing.trace.reader", "Trace"),
    "UsageError": ("lingjing.errors", "UsageError"),
    "arun": ("lingjing.play.asynchronous", "arun"),
    "compile": ("lingjing.dsl.loading.load", "load_mission"),
    "metrics": ("lingjing.analysis.metrics", "metrics"),
    "pin": ("lingjing.numerics", "pin"),
    "read": ("lingjing.trace.reader", "read_trace"),
    "replay": ("lingjing.causal.replay", "replay"),
    "run": ("lingjing.play.episode", "run"),
    "show": ("lingjing.viewer.inline", "show"),
    "verify": ("lingjing.trace.verification", "verify_file"),
}


def __getattr__(name: str) -> Any:
    """Import an export at its first use (PEP 562) and store it."""
    if name == "__version__":
        value: object = _version()
    elif name in _PACKAGES:
        value = import_module(_PACKAGES[name])
    elif name in _EXPORTS:
        module, attribute = _EXPORTS[name]
        value = getattr(import_module(module), attribute)
    elif name in _RENAMED:
        import warnings

        warnings.warn(f"use `lingjing.{_RENAMED[name]}` instead of `{name}`", DeprecationWarning, stacklevel=2)
        return globals().get(_RENAMED[name]) or __getattr__(_RENAMED[name])
    else:
        raise AttributeError(f"module `lingjing` has no attribute `{name}`")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


def _version() -> str:
    from lingjing.installation import CORE, version_of

    return version_of(CORE)
