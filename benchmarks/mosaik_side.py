"""Mosaik's side of `kernel.py`; runs in `.venv-bench`: ticks per second of N trivial simulators in one process.

Usage: mosaik_side.py ENGINES TICKS. Every simulator owns one entity, reads all others' positions of the tick before
(time-shifted connections: the same fixed-step Jacobi coupling) and moves. Prints ticks per second of CPU.
"""

import sys
import time

import mosaik
import mosaik_api_v3
from loguru import logger

META = {
    "api_version": "3.0",
    "type": "time-based",
    "models": {"Body": {"public": True, "params": [], "attrs": ["position", "seen"]}},
}


class MosaikToy(mosaik_api_v3.Simulator):
    """A body that moves a metre per tick and reads the positions of the others."""

    def __init__(self):
        super().__init__(META)
        self.position = 0.0
        self.seen = 0.0

    def init(self, sid, time_resolution=1.0, **options):
        return self.meta

    def create(self, num, model, **options):
        return [{"eid": "body", "type": model}]

    def step(self, now, inputs, max_advance):
        self.seen = sum(inputs.get("body", {}).get("seen", {}).values())
        self.position += 1.0
        return now + 1

    def get_data(self, outputs):
        return {"body": {"position": self.position}}


def main():
    engines, ticks = int(sys.argv[1]), int(sys.argv[2])
    logger.remove()
    world = mosaik.World({"Toy": {"python": "__main__:MosaikToy"}}, skip_greetings=True)
    bodies = [world.start("Toy").Body() for _ in range(engines)]
    for source in bodies:
        for target in bodies:
            if source is not target:
                world.connect(source, target, ("position", "seen"), time_shifted=True, initial_data={"position": 0.0})
    started = time.process_time()
    world.run(until=ticks, print_progress=False)
    print(ticks / (time.process_time() - started))


main()
