"""The world: the engines of an episode behind one interface, in the caller or in two worker processes.

In the order of a call:

- `contract`    what the kernel asks (`World`) and gets (`WorldBoundary`, `StoredFrame`)
- `process`     `ProcessWorld`: a world process and a camera process; `inline` `InlineWorld`: all in the caller
- `camera`      the camera process as the caller sees it
- `selection`   which engines an instance needs and where each runs
- `cosimulation`   the coupling of the engines: a tick as macro-steps
- `engine_group`   the engines of one process ← `boundary_checks` (what a boundary must be) ← `guarded_calls`
- `stocks`      declared states that no engine keeps; `times` how long each engine has taken
- `sensor`      the sensor engine ← `frames` (a drawn picture as it is stored)
- `handle`      the caller's end of a worker ← `launch` (its process) ← `messages`, `shared`
- `worker`      the far end, `python -m lingjing.kernel.world.worker` or a fork ← `handlers` (its answers)
- `held_cities`   cities that a process holds for its forks; `placed_worlds` worlds that stand at boundary 0 (a fork
  server's), `held_starts` the same of one caller; `first_pictures` the pictures of boundary 0
- `extra_plugins`   plug-ins named on top of the installed ones, the same at both ends

Starting, forking and ending processes, channels and deadlines are `lingjing.processes`.

Invariants: both worlds report the same boundaries and pictures; a worker never outlives its caller; whatever goes
wrong with an engine is one `InfrastructureError` that names it, after which `reset` starts afresh.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from lingjing.kernel.world.contract import World
    from lingjing.plugins.host import PluginHost
    from lingjing.processes.fork_client import ForkServerClient

__all__ = ["WorldKind", "open_world"]

WorldKind = Literal["process", "inline"]
"""Where the engines run: in processes of their own, or in the caller's."""


def open_world(
    kind: WorldKind,
    *,
    host: PluginHost | None = None,
    plugins: tuple[str, ...] = (),
    paths: tuple[str, ...] = (),
    installed: bool = True,
    fork_server: ForkServerClient | None = None,
    hold_starts: bool = False,
) -> World:
    """A world of the given kind, idle until `reset`.

    `plugins` are extra plug-in objects as `module:attribute`, importable here and in the workers (where `paths` come
    before the caller's `sys.path`); without `installed` they are the only ones. `host`, if the caller has built one
    already, must offer the same; workers always find plug-ins for themselves. A `fork_server` forks them from a process
    that has imported all they need, else each is started anew. With `hold_starts` an instance that begins again begins
    in a copy of the world that was kept at its boundary 0.
    """
    if kind == "inline":
        from lingjing.kernel.world.extra_plugins import host_with
        from lingjing.kernel.world.inline import InlineWorld

        return InlineWorld(host if host is not None else host_with(plugins, installed=installed))
    if sys.platform != "linux":
        from lingjing.errors import UsageError

        raise UsageError("worker processes need Linux (or WSL2)", hint="use `--world inline`")
    from lingjing.kernel.world.process import ProcessWorld

    return ProcessWorld(
        plugins=plugins, paths=paths, installed=installed, host=host, fork_server=fork_server, hold_starts=hold_starts
    )
