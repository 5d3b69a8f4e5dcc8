"""Plays two short episodes and prints their results. A test starts it with the settings of several processors.

`numerics_child.py WORLD [unpinned]`: a dog, a van and a UAV with fixed commands, then a heuristic that reads pictures.
"""

import json
import sys
import tempfile
from pathlib import Path

from lingjing import numerics

if "unpinned" in sys.argv:
    numerics.pins = lambda flags=None: {}
    numerics.worker_environment = dict

from lingjing import Mission, Session
from lingjing import read as read_trace
from lingjing.play import selfcheck
from lingjing.testing import mission_file, shortened


def short(folder: Path) -> Mission:
    """Return six ticks of the sea rescue with small pictures."""
    text = mission_file("ssr").read_text(encoding="utf-8")
    for size, small in (("1920 by 1080", "480 by 270"), ("1280 by 720", "320 by 180")):
        assert size in text
        text = text.replace(size, small)
    file = folder / "ssr.ljs"
    file.write_text(text, encoding="utf-8")
    return shortened(file, 6)


def main() -> None:
    with tempfile.TemporaryDirectory() as name, Session() as session:
        folder, how = Path(name), {"overview": False, "world": sys.argv[1]}
        played = [session.run(selfcheck.MISSION, policy=selfcheck.Scripted, seed=7, out=folder / "a", **how)]
        if "short" not in sys.argv:
            played.append(session.run(short(folder), policy="heuristic", seed=5, out=folder / "b", **how))
        print(
            json.dumps(
                {
                    "reasons": [result.reason for result in played],
                    "digests": [result.digest for result in played],
                    "frames": [result.frames_digest for result in played],
                    "withdrawn": [list(result.withdrawn) for result in played],
                    "processes": [read_trace(result.trace).outcome.processes for result in played],
                }
            )
        )


main()
