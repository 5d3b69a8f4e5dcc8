"""The discovery of installed plug-ins by their entry points, with a trial of each foreign one before it is loaded.

A plug-in's module may raise, end the process or never return during its import or one of its hooks. So each foreign
plug-in is first loaded in a process of its own, which has `DEADLINE_S` and is killed with its children. Only a plug-in
that passes is imported here. An environment variable keeps the results, so that workers do not repeat trials.
`slow_trials` keeps those without an answer, so that the next commands do not wait again. This project's own plug-ins
are loaded without a trial.
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

from lingjing.decoding import from_json
from lingjing.errors import PluginError
from lingjing.installation import CORE, OWN
from lingjing.installed_plugins.entry_points import PLUGINS, find_entries, label
from lingjing.installed_plugins.slow_trials import find_slow_trial, keep_slow_trial

DEADLINE_S = 20.0
"""The longest own time to import a plug-in and call all its hooks, seconds. Chosen: heavy imports belong into
factories."""

KNOWN = "LINGJING_TRIED_PLUGINS"
"""The environment variable that passes the trials of this process on to its children."""

TRUSTED = "LINGJING_TRUSTED_PLUGINS"
"""The environment variable with the names of the foreign plug-ins that may run in a command which plays behind walls,
separated by commas. Without it all may."""

UNTRIED = "LINGJING_UNTRIED_PLUGINS"
"""The environment variable of a process behind walls, which loads plug-ins without a trial: that needs a process."""

TRIED_EARLIER = "an earlier command tried it, and `lingjing plugins` tries it again"
"""The addition to the fault of a plug-in that is left out without a trial."""

_POLL_S = 0.02
"""The interval between two checks of the running trials, seconds. Chosen."""
_PROBE = "lingjing.installed_plugins.probe"
"""The module of a trial's process."""


class PluginFault(NamedTuple):
    """A plug-in that is left out, or that has a hook which is left out."""

    plugin: str
    distribution: str
    reason: str
    hint: str = ""
    """An action that solves the problem; "" if unknown."""
    traceback: str = ""
    """The traceback of the error; "" unless the user wants to see it."""

    def __str__(self) -> str:
        return f"plug-in `{self.plugin or '?'}` ({self.distribution}): {self.reason}"


def fault_error(fault: PluginFault, hint: str) -> PluginError:
    """Return the error that reports a fault, with its own hint, or `hint` where it has none. Its notes are the hint and
    the traceback."""
    error = PluginError(str(fault), hint=fault.hint or hint)
    if fault.traceback:
        error.add_note(fault.traceback.rstrip())
    return error


class TrialFault(msgspec.Struct, frozen=True):
    """The fault of a plug-in, or of one of its hooks."""

    reason: str
    """The fault in words."""
    hint: str = ""
    """An action that solves the problem; "" if unknown."""
    traceback: str = ""
    """The end of the traceback; "" unless the user wants to see it."""

    def of(self, plugin: str, distribution: str, hook: str = "") -> PluginFault:
        """Return the fault of a plug-in; with `hook`, that of one of its hooks."""
        reason = f"failed in {hook}: {self.reason}" if hook else self.reason
        return PluginFault(plugin, distribution, reason, self.hint, self.traceback)


class Trial(msgspec.Struct, frozen=True):
    """The result of a trial."""

    fault: TrialFault | None = None
    """The fault for which the plug-in cannot be loaded; None if it can."""
    hooks: dict[str, TrialFault] = {}
    """The faults of the hooks that raised."""


class LoadablePlugin(NamedTuple):
    """An installed plug-in that can be loaded: its entry point, and its hooks that must not be called."""

    point: EntryPoint
    barred: frozenset[str] = frozenset()


class InstalledPlugins(NamedTuple):
    """The installed plug-ins."""

    own: tuple[EntryPoint, ...]
    """The plug-ins of this project."""
    strangers: tuple[LoadablePlugin, ...]
    """The foreign plug-ins that have passed their trial."""
    faults: tuple[PluginFault, ...]
    """The other plug-ins, with the reasons."""


def installed_plugins() -> InstalledPlugins:
    """Return the installed plug-ins. Tries foreign ones, unless this process or an ancestor has tried them."""
    entries = find_entries(PLUGINS)
    faults = [PluginFault(*entry) for entry in entries.broken]
    by_plugin = {point.value: point for point in entries.points}
    own = tuple(by_plugin[entry.plugin] for entry in OWN if entry.plugin in by_plugin)
    named = {point.name: label(point.dist) for point in own}
    others: list[EntryPoint] = []
    for point in entries.points:
        owner = label(point.dist)
        if point.value in {entry.plugin for entry in OWN}:
            continue
        if point.name in named:
            faults.append(PluginFault(point.name, owner, f"{named[point.name]} has a plug-in of the same name"))
        else:
            named[point.name] = owner
            if is_trusted(point):
                others.append(point)
            else:
                hint = f"--trust {point.name} lets its code run in this command, beside the scores"
                faults.append(PluginFault(point.name, owner, "its code runs behind walls alone", hint))
    strangers = []
    for point, trial in zip(others, _trials(others), strict=True):
        owner = label(point.dist)
        faults += [fault.of(point.name, owner, hook) for hook, fault in trial.hooks.items()]
        if trial.fault is not None:
            faults.append(trial.fault.of(point.name, owner))
        else:
            strangers.append(LoadablePlugin(point, frozenset(trial.hooks)))
    return InstalledPlugins(own, tuple(strangers), tuple(faults))


def is_trusted(point: EntryPoint) -> bool:
    """Return True if the code of a plug-in may run in this process: `TRUSTED` is not set, or names it."""
    names = os.environ.get(TRUSTED)
    return names is None or point.name in names.split(",") or point.value in {entry.plugin for entry in OWN}


@contextmanager
def trusting(names: Sequence[str] | None) -> Iterator[None]:
    """Let only these foreign plug-ins run in this process and in the processes that it starts; None for all."""
    before = os.environ.get(TRUSTED)
    try:
        if names is not None:
            os.environ[TRUSTED] = ",".join(names)
        yield
    finally:
        os.environ.pop(TRUSTED, None)
        if before is not None:
            os.environ[TRUSTED] = before


def is_core(point: EntryPoint) -> bool:
    """Return True for the plug-in that every episode needs."""
    return point.value == CORE.plugin


# -- private


def _trials(points: Sequence[EntryPoint]) -> list[Trial]:
    """Return a trial for each plug-in. Unknown ones are tried, all at the same time."""
    if os.environ.get(UNTRIED):
        return [Trial() for _ in points]
    keys = [_key(point) for point in points]
    known = _known()
    missing = {key: point for key, point in zip(keys, points, strict=True) if key not in known}
    if missing:
        slow = {key: reason for key, point in missing.items() if (reason := find_slow_trial(point, _timed(key)))}
        known |= {key: _faulty(f"{reason}; {TRIED_EARLIER}") for key, reason in slow.items()}
        known |= _try_all({key: point for key, point in missing.items() if key not in slow})
        os.environ[KNOWN] = msgspec.json.encode(known).decode()
    return [known[key] for key in keys]


def _timed(key: str) -> str:
    """Return the key under which a trial without an answer is kept: a longer deadline is another trial."""
    return f"{key} {DEADLINE_S}"


def _known() -> dict[str, Trial]:
    try:
        return from_json(os.environ.get(KNOWN, "{}"), dict[str, Trial])
    except msgspec.DecodeError:
        return {}


def _key(point: EntryPoint) -> str:
    """Return the key of a trial: a hash of the entry point, its distribution and the distribution's place."""
    place = str(Path(str(point.dist.locate_file(""))).resolve()) if point.dist is not None else ""
    made_of = (point.name, point.value, label(point.dist), place)
    return hashlib.sha256("\n".join(made_of).encode("utf-8", "surrogateescape")).hexdigest()[:24]


def _faulty(reason: str) -> Trial:
    return Trial(TrialFault(reason))


def _decoded(answer: str) -> Trial:
    try:
        return from_json(answer, Trial)
    except msgspec.DecodeError:
        return _faulty("wrote into the answer of its trial")


@dataclass(slots=True)
class _Running:
    """A running trial. `answer` is the file that the process writes to, `started` its start on the monotonic clock."""

    process: subprocess.Popen[bytes]
    answer: IO[bytes]
    started: float

    def is_over(self) -> bool:
        """Return True if the process has ended or has exceeded its time."""
        return self.process.poll() is not None or self._own_s() > DEADLINE_S

    def trial(self) -> Trial:
        """Return the trial that the process has written, or one with the reason for which it has written none."""
        code = self.process.poll()
        self.answer.seek(0)
        *stages, last = self.answer.read().decode("utf-8", "replace").split("\n")
        if last:
            return _decoded(last)
        stage = stages[-1] if stages else "starting"
        if code is None:
            return _faulty(f"gives no answer within {DEADLINE_S:.0f} s while {stage}")
        return _faulty(f"ends its process {f'by signal {-code}' if code < 0 else f'with code {code}'} while {stage}")

    def _own_s(self) -> float:
        try:
            waited_ns = int(Path(f"/proc/{self.process.pid}/schedstat").read_text(encoding="ascii").split()[1])
        except (OSError, ValueError, IndexError):  # it ended meanwhile, or this kernel does not count
            waited_ns = 0
        return time.monotonic() - self.started - waited_ns / 1e9


def _try_all(points: Mapping[str, EntryPoint]) -> dict[str, Trial]:
    with ExitStack() as stack:
        running = {key: stack.enter_context(_running(point)) for key, point in points.items()}
        while not all(trial.is_over() for trial in running.values()):
            time.sleep(_POLL_S)
        trials = {key: trial.trial() for key, trial in running.items()}
        for key in (key for key, trial in running.items() if trial.process.poll() is None):
            if (fault := trials[key].fault) is not None:
                keep_slow_trial(points[key], _timed(key), fault.reason)
    return trials


@contextmanager
def _running(point: EntryPoint) -> Iterator[_Running]:
    """Start the trial of a plug-in. At the end its process and the children are killed."""
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
