"""`python -m lingjing.installed_plugins.probe FD NAME VALUE`: try one plug-in, its import and all its hooks.

Started by `discovery` alone, and killed by the kernel when that process ends. Each stage is a line; the last line is a
`discovery.Trial` as JSON. A plug-in that ends this process, or never returns, leaves the stage that it was in.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys
from collections.abc import Callable

_SET_PARENT_DEATH_SIGNAL = 1
"""PR_SET_PDEATHSIG of prctl(2)."""


def main(descriptor: int, name: str, value: str) -> None:
    """Write the stages and the trial, and end this process."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_SET_PARENT_DEATH_SIGNAL, signal.SIGKILL, 0, 0, 0)

    def enter(stage: str) -> None:
        os.write(descriptor, f"{stage}\n".encode("utf-8", "backslashreplace"))

    enter("starting")
    import msgspec

    from lingjing.installed_plugins.discovery import Trial

    try:
        trial = Trial("", _failed_hooks(name, value, enter))
    except BaseException as error:  # noqa: BLE001 - SystemExit too: it is reported, not obeyed
        from lingjing.plugins.loading import one_line

        trial = Trial(f"does not load: {one_line(error)}")
    os.write(descriptor, msgspec.json.encode(trial))
    os._exit(0)  # nothing that the plug-in registered for the end runs


def _failed_hooks(name: str, value: str, enter: Callable[[str], None]) -> dict[str, str]:
    from importlib.metadata import EntryPoint

    from lingjing.installed_plugins.entry_points import PLUGINS
    from lingjing.plugins.host import HOOKS, PluginHost

    enter(f"importing `{value}`")
    plugin = EntryPoint(name, value, PLUGINS).load()
    enter("registering its hooks")
    host = PluginHost(entry_points=False)
    host.register(plugin, name)
    failed: dict[str, str] = {}
    for hook in HOOKS:
        enter(f"calling {hook}")
        reason = host.hook_fault(hook)
        if reason:
            failed[hook] = reason
    return failed


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2], sys.argv[3])
