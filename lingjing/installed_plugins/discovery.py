"""The installed plug-ins: found by their entry points, and each of a stranger's tried before it is loaded here.

A plug-in's module may raise, end the process or never return while it is imported or while a hook of it is called. So
each is first loaded in a process of its own, which has `DEADLINE_S` and is killed with its children; only what comes
through that is imported here. What was found is kept in an environment variable, so that workers do not try again.
This project's own plug-ins are loaded at once.
"""

from __future__ import annotations

import hashlib
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import IO, NamedTuple

import msgspec

from lingjing.installation import CORE, OWN
from lingjing.installed_plugins.entry_points import PLUGINS, find_entries, label

DEADLINE_S = 20.0
"""Own time that a plug-in has to be imported and to answer all hooks: heavy imports belong into factories. Chosen."""

KNOWN = "LINGJING_TRIED_PLUGINS"
"""Environment variable: the trials of this process, for the processes that it starts."""

_POLL_S = 0.02
_PROBE = "lingjing.installed_plugins.probe"


class PluginFault(NamedTuple):
    """A plug-in that is not used, or not for one of its hooks: its entry point, its distribution and the reason."""

    plugin: str
    distribution: str
    reason: str

    def __str__(self) -> str:
        return f"plug-in `{self.plugin or '?'}` ({self.distribution}): {self.reason}"


class Trial(msgspec.Struct, frozen=True):
    """The answer of a plug-in that was tried: `reason` for which it cannot be loaded ("" if it can), and the hooks that
    raised, each with its reason."""

    reason: str = ""
    hooks: dict[str, str] = {}


class LoadablePlugin(NamedTuple):
    """An installed plug-in that can be loaded: its entry point, and the hooks of it that must not be called."""

    point: EntryPoint
    barred: frozenset[str] = frozenset()


class InstalledPlugins(NamedTuple):
    """The installed plug-ins: this project's `own`, the `strangers` that came through their trial, and the `faults` of
    the rest."""

    own: tuple[EntryPoint, ...]
    strangers: tuple[LoadablePlugin, ...]
    faults: tuple[PluginFault, ...]


def installed_plugins() -> InstalledPlugins:
    """Find the installed plug-ins, and try those of others that no process above has tried."""
    found = find_entries(PLUGINS)
    faults = [PluginFault(*one) for one in found.broken]
    by_plugin = {point.value: point for point in found.points}
    own = tuple(by_plugin[one.plugin] for one in OWN if one.plugin in by_plugin)
    named = {point.name: label(point.dist) for point in own}
    others: list[EntryPoint] = []
    for point in found.points:
        owner = label(point.dist)
        if point.value in {one.plugin for one in OWN}:
            continue
        if point.name in named:
            faults.append(PluginFault(point.name, owner, f"{named[point.name]} has a plug-in of the same name"))
        else:
            named[point.name] = owner
            others.append(point)
    strangers = []
    for point, trial in zip(others, _tried(others), strict=True):
        owner = label(point.dist)
        faults += [PluginFault(point.name, owner, f"failed in {hook}: {said}") for hook, said in trial.hooks.items()]
        if trial.reason:
            faults.append(PluginFault(point.name, owner, trial.reason))
        else:
            strangers.append(LoadablePlugin(point, frozenset(trial.hooks)))
    return InstalledPlugins(own, tuple(strangers), tuple(faults))


def is_core(point: EntryPoint) -> bool:
    """True for the plug-in without which nothing can be played."""
    return point.value == CORE.plugin


# -- private


def _tried(points: Sequence[EntryPoint]) -> list[Trial]:
    """A trial for each; those that are not known are made, all at once."""
    keys = [_key(point) for point in points]
    known = _known()
    missing = {key: point for key, point in zip(keys, points, strict=True) if key not in known}
    if missing:
        known |= _try_all(missing)
        os.environ[KNOWN] = msgspec.json.encode(known).decode()
    return [known[key] for key in keys]


def _known() -> dict[str, Trial]:
    try:
        return msgspec.json.decode(os.environ.get(KNOWN, "{}"), type=dict[str, Trial])
    except msgspec.DecodeError:
        return {}


def _key(point: EntryPoint) -> str:
    """Return the key of a trial: the entry point, its distribution and the place of that."""
    place = str(Path(str(point.dist.locate_file(""))).resolve()) if point.dist is not None else ""
    made_of = (point.name, point.value, label(point.dist), place)
    return hashlib.sha256("\n".join(made_of).encode("utf-8", "surrogateescape")).hexdigest()[:24]


def _decoded(answer: str) -> Trial:
    try:
        return msgspec.json.decode(answer, type=Trial)
    except msgspec.DecodeError:
        return Trial("wrote into the answer of its trial")


@dataclass(slots=True)
class _Running:
    """A process in which a plug-in is tried; `waited_s` is what it stood in the queue for a processor."""

    process: subprocess.Popen[bytes]
    answer: IO[bytes]
    started: float

    def is_over(self) -> bool:
        """It has ended, or used up its time."""
        return self.process.poll() is not None or self._own_s() > DEADLINE_S

    def trial(self) -> Trial:
        """The answer that it gave, or the reason why it gave none."""
        code = self.process.poll()
        self.answer.seek(0)
        *stages, last = self.answer.read().decode("utf-8", "replace").split("\n")
        if last:
            return _decoded(last)
        stage = stages[-1] if stages else "starting"
        if code is None:
            return Trial(f"gives no answer within {DEADLINE_S:.0f} s while {stage}")
        return Trial(f"ends its process {f'by signal {-code}' if code < 0 else f'with code {code}'} while {stage}")

    def _own_s(self) -> float:
        try:
            waited_ns = int(Path(f"/proc/{self.process.pid}/schedstat").read_text(encoding="ascii").split()[1])
        except (OSError, ValueError, IndexError):  # it ended meanwhile, or this kernel does not count
            waited_ns = 0
        return time.monotonic() - self.started - waited_ns / 1e9


def _try_all(points: Mapping[str, EntryPoint]) -> dict[str, Trial]:
    with ExitStack() as stack:
        running = {key: stack.enter_context(_running(point)) for key, point in points.items()}
        while not all(one.is_over() for one in running.values()):
            time.sleep(_POLL_S)
        return {key: one.trial() for key, one in running.items()}


@contextmanager
def _running(point: EntryPoint) -> Iterator[_Running]:
    """Try a plug-in; it and its children are killed at the end."""
    with tempfile.TemporaryFile() as answer:
        process = subprocess.Popen(
            [sys.executable, "-P", "-m", _PROBE, str(answer.fileno()), point.name, point.value],
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            pass_fds=(answer.fileno(),), start_new_session=True,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(place or str(Path.cwd()) for place in sys.path)},
        )  # fmt: skip
        try:
            yield _Running(process, answer, time.monotonic())
        finally:
            with suppress(ProcessLookupError):  # it ended, and left no children
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()
