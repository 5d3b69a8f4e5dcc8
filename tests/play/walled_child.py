"""The process of a test that builds walls and runs the attacks behind them, without an episode."""

import contextlib
import json
import os
import sys

import msgspec

from lingjing.play.policy_processes.host import limit_memory
from lingjing.processes.walls.entering import Walls, enter
from tests.play.walled_attacks import ATTACKS


class WalledRun(msgspec.Struct):
    """The walls to build, and the attackers' configuration as JSON."""

    walls: Walls
    config: str


def run(argument: bytes, ends: tuple[int, ...]) -> None:
    """Print the report of the walls and the result of each attack, one JSON document a line."""
    request = msgspec.msgpack.decode(argument, type=WalledRun)
    report = enter(request.walls, has_namespaces=os.getpid() == 1)
    limit_memory(512 << 20)
    config, results = json.loads(request.config), {}
    printed = os.dup(1)
    for name, function in ((name, ATTACKS[name]) for name in config.get("only", ATTACKS)):
        with contextlib.suppress(FileExistsError):
            try:
                results[name] = function(config)
            except (Exception, SystemExit) as error:
                results[name] = f"{type(error).__name__}: {error}"[:200]
    os.write(printed, msgspec.json.encode(report) + b"\n" + json.dumps(results).encode())
    sys.stdout.flush()
