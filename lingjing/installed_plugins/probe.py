"""`python -m lingjing.installed_plugins.probe FD NAME VALUE`: the trial of one plug-in, its import and all its hooks.

`discovery` starts it, and the kernel kills it when that process ends. It writes each stage as a line, and at last a
`discovery.Trial` as JSON. If a plug-in ends this process or never returns, the last line is its stage. Its exit
functions are called. A process or a thread that it leaves running is a fault, and so is a change of the process that
would affect every command.
"""

from __future__ import annotations

import atexit
import contextlib
import os
import signal
import sys
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING

from lingjing.processes.descendants import end_children
from lingjing.processes.linux import adopt_orphans, end_with_parent

if TYPE_CHECKING:
    from lingjing.installed_plugins.discovery import TrialFault

_ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""The signals by which users and schedulers end a command."""


def main(descriptor: int, name: str, value: str) -> None:
    """Write the stages and the trial to a descriptor, and end this process."""
    end_with_parent(os.getppid())
    adopt_orphans()
    myself = os.getpid()

    def enter(stage: str) -> None:
        os.write(descriptor, f"{stage}\n".encode("utf-8", "backslashreplace"))

    enter("starting")
    import msgspec

    from lingjing.installed_plugins.discovery import Trial, TrialFault

    try:
        before = _process_state()
        failed = _failed_hooks(name, value, enter)
        altered = [what for what, state in _process_state().items() if state != before[what]]
        enter("ending")
        atexit._run_exitfuncs()
        reason = f"changes {altered[0]} of each command" if altered else _left_behind()
        trial = Trial(TrialFault(reason) if reason else None, failed)
    except BaseException as error:  # noqa: BLE001 - SystemExit too: it is reported, not obeyed
        from lingjing.plugins.hook_faults import load_fault

        trial = Trial(load_fault(error))
    if os.getpid() == myself:  # only the probe itself, no process that the plug-in has forked
        end_children(set())  # also those in sessions of their own
        os.write(descriptor, msgspec.json.encode(trial))
    os._exit(0)


def _process_state() -> dict[str, object]:
    """The state of the process that a plug-in must not change, because commands that do not use it rely on it."""
    return {
        "the working folder": _folder(),
        "the standard streams": [_file_of(descriptor) for descriptor in range(3)],
        "the handlers of signals": [signal.getsignal(number) for number in _ENDING],
    }


def _folder() -> str:
    try:
        return os.getcwd()  # noqa: PTH109
    except OSError:  # it was removed
        return ""


def _file_of(descriptor: int) -> tuple[int, int] | None:
    try:
        state = os.fstat(descriptor)
    except OSError:  # closed
        return None
    return state.st_dev, state.st_ino


def _left_behind() -> str:
    """Return the fault of a plug-in that leaves a thread or a process running; "" if it leaves none."""
    if any(not thread.daemon and thread is not threading.main_thread() for thread in threading.enumerate()):
        return "leaves a thread running, for which each command would wait at its end"
    with contextlib.suppress(ChildProcessError):
        while os.waitpid(-1, os.WNOHANG)[0]:
            pass
        return "leaves a process running"
    return ""


def _failed_hooks(name: str, value: str, enter: Callable[[str], None]) -> dict[str, TrialFault]:
    from importlib.metadata import EntryPoint

    from lingjing.installed_plugins.entry_points import PLUGINS
    from lingjing.plugins.host import HOOKS, PluginHost

    enter(f"importing `{value}`")
    plugin = EntryPoint(name, value, PLUGINS).load()
    enter("registering its hooks")
    host = PluginHost(entry_points=False)
    host.register(plugin, name)
    failed: dict[str, TrialFault] = {}
    for hook in HOOKS:
        enter(f"calling {hook}")
        fault = host.hook_fault(hook)
        if fault is not None:
            failed[hook] = fault
    return failed


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2], sys.argv[3])
