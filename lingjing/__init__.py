"""Missions for heterogeneous unmanned systems: write one, play it, score it, see why.

The tree is the pipeline: `dsl` (text → mission) → `mission` (the typed graph) → `scene` (the city) → `plugins` (the
contract) and `engines` → `kernel` (the episode) → `trace` (what happened) → `analysis` (what it means). `viewer` shows
an episode in a browser or as a film. `play` plays one episode, `bench` many, `report` draws the figures of them,
`causal` runs traces again, `envs` makes learning environments of missions; `cli` is the command line, `lsp` the
language server. `processes` starts, forks and ends processes. Shared by all: `errors` (the exceptions), `validation`
(the faults that pydantic finds, in words),
`option_reading` (options read by their models), `option_listing` (options as people read them), `suggest`
(did-you-mean), `collector` (the garbage collector at rest), `data` (where shipped files are), `installation` (the
distributions' names, and what their extras bring), `installed_plugins` (those of other distributions, tried before they
are loaded), `kept_files` (files of the cache folder), `whole_files` (files written whole or not at all), `file_names`
(names that are not text), `refusals` (what the system refuses), `numerics` (what fixes the last bits of numbers),
`signals` (signals held back for a while), `terminal` (text made safe to print).
`docs/architecture.md` walks through them. The public surface is this module, `lingjing.plugins` and the command
`lingjing`; the rest may change.

Exports are lazy: importing this package loads nothing but itself.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from lingjing.dsl.loading.load import load_mission as compile  # noqa: A004 - `lingjing.compile` is the public name
    from lingjing.mission.model import Mission
    from lingjing.numerics import pin
    from lingjing.play.episode import run
    from lingjing.play.options import PlayOptions
    from lingjing.play.report import EpisodeReport

    __version__: str

__all__ = ["EpisodeReport", "Mission", "PlayOptions", "__version__", "compile", "pin", "run"]

_EXPORTS = {
    "EpisodeReport": ("lingjing.play.report", "EpisodeReport"),
    "Mission": ("lingjing.mission.model", "Mission"),
    "PlayOptions": ("lingjing.play.options", "PlayOptions"),
    "compile": ("lingjing.dsl.loading.load", "load_mission"),
    "pin": ("lingjing.numerics", "pin"),
    "run": ("lingjing.play.episode", "run"),
}


def __getattr__(name: str) -> Any:
    """Import an export at its first use (PEP 562) and keep it."""
    if name == "__version__":
        value: object = _version()
    elif name in _EXPORTS:
        module, attribute = _EXPORTS[name]
        value = getattr(import_module(module), attribute)
    else:
        raise AttributeError(f"module `lingjing` has no attribute `{name}`")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


def _version() -> str:
    from lingjing.installation import CORE, version_of

    return version_of(CORE)
