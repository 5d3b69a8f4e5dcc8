"""The built-in engines, plug-ins like anybody's; `builtin` declares them. `docs/engines.md` is the user's page.

Packages, one for each kind of motion or seeing:

- `multirotor`, `fixed_wing` (engine `plane`)   `aircraft` in JSBSim (`flight_dynamics`) and `gust`s
- `quadruped`    the Go2 on its legs in MuJoCo
- `road`         SUMO: vehicles, background traffic, queues
- `vessel`       3-DOF hulls on the waves of `sea`
- `satellite`    SGP4 passes
- `city`         targets, interactions, goods, queues of people, radio
- `camera`       the one rendered city with everybody in it

Shared by them, from the contract inwards:

- `fleet`        the five methods over bodies that step together ← `requests` (admission, receipts), `step_clock`
- `aircraft`     phases, falls, collisions and the engine of a fleet of aircraft; `battery` what walks and flies on
- `bodies`, `neighbours`, `close_pairs`   sizes of mirrors, which of them are touched, who is close to whom
- `terrain` ← `blocks`, `outlines`   what a place of the city is to a body: water, ground, what stands there

Invariants: an engine knows others only as mirrors; chance comes from the seed it is given; MuJoCo, libsumo, JSBSim and
sgp4 are each imported by one module, in the process that runs the engine.
"""
