"""The city engine: targets, interactions with them, goods, queues of people and radio links.

A *target* is an entity of the mission that agents act on: a fire, a leak, a person in the water, a queue. An
*interaction* is an action on a target. The kernel unlocks it, and the engine carries it out when a permitted actor has
been within reach long enough (ADR 0002). *Goods* are declared stocks that an interaction moves between a target and an
actor. The engine reads only declared properties, never the mission's names of types.

Modules:

- `engine`: the engine contract, and the actors within reach of a target.
- `target`: the state of one target, and its nature (`lingjing.mission.natures`).
- `target_body`: the motion of a target: fixed, adrift or by itself.
- `roaming`: the way of a target that flees, wanders or follows.
- `arrivals`: queues of people that grow and shrink.
- `goods`: the stocks of all entities and transfers between them.
- `radio`: the pairs of assets without a radio link.
"""
