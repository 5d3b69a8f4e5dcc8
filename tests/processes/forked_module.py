"""A module that a fork server runs like `python -m`: `environment` prints its environment, `worlds` uses workers."""

import itertools
import json
import os
import random
import sys
import time
from pathlib import Path
from typing import Any


def client() -> Any:
    from lingjing.processes.fork_client import ForkServerClient

    return ForkServerClient(int(sys.argv[-1]))


def environment() -> None:
    import numpy as np

    print(
        json.dumps(
            {
                "arguments": sys.argv[2:-2],
                "path": sys.path,
                "folder": os.getcwd(),
                "mark": os.environ.get("MARK", ""),
                "threads_of_openmp": os.environ.get("OMP_NUM_THREADS", ""),
                "random": [random.random(), float(np.random.random())],  # noqa: NPY002 - the global stream,
                "input": sys.stdin.read(),
                "descriptors": len(os.listdir("/proc/self/fd")),
                "group": os.getpgid(0) == os.getpid(),
                "server_played": [name for name in ("cv2", "tests.kernel.world_toys") if name in sys.modules],
            }
        )
    )
    print("an aside", file=sys.stderr)
    sys.exit(7)


def worlds() -> None:
    """Play twice on the server's workers and once in this process; print the comparison and the process ids."""
    import tests.kernel.world_toys as toys
    from lingjing.testing.worlds import open_world
    from tests.kernel.test_world_process import TOYS, opened, pids, played

    fork_server = client()
    inline = opened("inline")
    expected, seen = played(inline, toys.trio()), []
    inline.close()
    for _ in range(2):
        world = open_world("process", plugins=TOYS, installed=False, fork_server=fork_server)
        same = played(world, toys.trio()) == expected
        twin = world.fork()
        again = twin.step(4, ()) is not None
        twin.close()
        workers = pids(world)
        lean = len(os.listdir(f"/proc/{workers[0]}/task")) == 1
        parents = [int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[1]) for pid in workers]
        world.close()
        seen.append({"same": same and again and lean, "workers": workers, "parents": parents})
    print(json.dumps(seen), flush=True)


def lingering() -> None:
    """Hold two workers in mid-episode, for others to kill."""
    import tests.kernel.world_toys as toys
    from lingjing.errors import InfrastructureError
    from lingjing.testing.worlds import open_world
    from tests.kernel.test_world_process import TOYS, pids, played

    world = open_world("process", plugins=TOYS, installed=False, fork_server=client())
    played(world, toys.trio())
    print(json.dumps(pids(world)), flush=True)
    try:
        for tick in itertools.count(4):
            world.step(tick, ())
            time.sleep(0.01)
    except InfrastructureError as error:
        print(error, flush=True)
        sys.exit(3)


def keeping() -> None:
    """Print the result that an earlier process has kept, and keep another one."""
    from lingjing.processes.kept_results import find_result

    print(json.dumps((find_result(b"key") or b"").decode()), flush=True)
    client().keep_result(b"key", sys.argv[2].encode())


if __name__ == "__main__":
    {"environment": environment, "worlds": worlds, "lingering": lingering, "keeping": keeping}[sys.argv[1]]()
