"""Store the road networks of the shipped missions' cities for the adversary `seed-guesser`.

`python tools/adversary_networks.py` places each shipped mission at its tiers and writes the networks of their cities
beside the adversary, by key, with the version of the program that made them. Run it after a change of a city's streets.
"""

from __future__ import annotations

import json
import lzma
from collections.abc import Callable
from pathlib import Path

from lingjing_agents.adversaries.truth import NETWORKS, TIERS

from lingjing.dsl.loading.load import load_mission
from lingjing.dsl.loading.shipped import find_mission, shipped_missions
from lingjing.play.placed_plan import place_mission
from lingjing.scene import network


def main() -> None:
    """Place the missions, and write the networks that their cities needed."""
    stored: dict[str, str] = {}
    make: Callable[..., network.Network] = network._cached

    def keep(key: str, *arguments: object) -> network.Network:
        made = make(key, *arguments)
        stored[key] = Path(made.path).read_text("utf-8")
        return made

    network._cached = keep
    for name in shipped_missions():
        mission = load_mission(find_mission(name))
        for tier in TIERS:
            if tier == 0 or mission.tiers:
                place_mission(mission, tier=tier)
    document = {"version": network._version(), "networks": dict(sorted(stored.items()))}
    NETWORKS.write_bytes(lzma.compress(json.dumps(document).encode(), preset=9))
    print(f"{NETWORKS}: {len(stored)} networks")


if __name__ == "__main__":
    main()
