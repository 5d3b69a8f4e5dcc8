"""The world: the engines of an episode behind one interface, in the caller or in two worker processes.

Concepts. *Motion engines* move the entities that they own. The *sensor engine* draws pictures. An engine runs in the
world process, in the camera process, or in the caller (a *remote* engine, the bridge to a simulator elsewhere). One
decision tick is a whole number of *macro-steps*; after each, every engine reports its boundary. *Background movers* are
bodies of an engine that are no entities, such as traffic.

Modules in the order of a call:

- `contract`: the interface between kernel and world (`World`, `WorldBoundary`, `StoredFrame`)
- `process`: `ProcessWorld`, with a world process and a camera process; `inline`: `InlineWorld`, all in the caller
- `camera`: the caller's side of the camera process
- `selection`: the engines that an instance needs, with the place of each
- `cosimulation`: the coupling of the engines, a tick as macro-steps
- `engine_group`: the engines of one process; `boundary_checks`: validation of boundaries; `guarded_calls`: engine calls
- `stocks`: declared states that no engine keeps; `times`: the time that each engine has taken
- `sensor`: the sensor engine; `frames`: a drawn picture in its stored form
- `handle`: the caller's side of a worker; `launch`: its process; `messages` and `shared`: what both sides exchange
- `worker`: the process itself (`python -m lingjing.kernel.world.worker` or a fork); `handlers`: its replies
- `held_cities`: cities that a process keeps for its forks; `placed_worlds`: a fork server's worlds at boundary 0;
  `held_starts`: those of one caller; `first_pictures`: the pictures of boundary 0
- `extra_plugins`: plug-ins in addition to the installed ones, equal on both sides

`lingjing.processes` starts, forks and ends processes and has channels and deadlines.

Invariants: both kinds of world report the same boundaries and pictures. A worker never outlives its caller. Every
failure of an engine is one `InfrastructureError` with its name, and `reset` starts again afterwards.
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
"""The place of the engines: worker processes or the caller's process."""


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
    """Return a world of the given kind, idle until `reset`.

    - `plugins`: additional plug-in objects as `module:attribute`, importable here and in the workers.
    - `paths`: folders that workers put before the caller's `sys.path`.
    - `installed`: whether installed plug-ins are loaded too.
    - `host`: the caller's host, with the same plug-ins; workers always build their own.
    - `fork_server`: forks the workers from a process with all imports done; without it each starts anew.
    - `hold_starts`: whether an instance that begins again begins in a copy of the world that was kept at its boundary
      0.

    Raises `UsageError` for worker processes outside Linux.
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
