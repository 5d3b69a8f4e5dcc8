"""The built-in engines.

An *engine* moves the bodies of one kind, or renders pictures. It is a plug-in with the five methods of
`lingjing.plugins.engine`, like an engine of a third party. Engines advance in lockstep between synchronisation
boundaries. At each boundary an engine receives the states of all other engines' bodies; such a state is a *mirror*.
`docs/engines.md` is the page for users; ADR 0036 says which engines of the paper they stand for.

`lingjing.builtin` declares all engines. Each package holds one engine:

- `multirotor`: rotor aircraft in JSBSim.
- `fixed_wing` (the engine `plane`): light aeroplanes in JSBSim.
- `quadruped`: the Unitree Go2 with its legs in MuJoCo.
- `road`: SUMO with vehicles, background traffic and queues.
- `vessel`: hulls with three degrees of freedom on the waves of `sea`.
- `satellite`: passes computed with SGP4.
- `city`: targets, interactions, goods, queues of people and radio links.
- `camera`: the renderer of the city with all bodies.
- `remote`: bodies of engines in other programs, over the paper's wire protocol.

Shared modules:

- `aircraft`: phases, falls and collisions of aircraft, and the engine of a fleet of them.
- `flight_dynamics`: the interface to JSBSim; `gust`: wind at one aircraft; `battery`: stored energy.
- `bodies`, `neighbours`: sizes of mirrored bodies and contact with them; `close_pairs`: bodies near each other.
- `motion_options`: the option `motion`, full or coarse (ADR 0061).
- `sea`: waves, wind and current as functions of weather, place and time.

Invariants: an engine reads other engines' bodies only through mirrors. Random numbers come from the seed that the
engine receives. MuJoCo, libsumo, JSBSim and sgp4 are each imported by one module, in the process that runs the engine.
"""
