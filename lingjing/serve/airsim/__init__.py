"""AirSim's API over an ordinary episode, so that scripts written for AirSim fly in a city of this project (ADR 0050).

Concepts. A *call* is a request of a client. All calls that have arrived are answered at the next boundary of a mission
with a short tick (50 ms). A *flight task* is a command that takes mission time (`takeoff`, `moveToPosition`, …); its
call is answered when the task ends. A *pilot* flies one vehicle: it has at most one task, and at each boundary turns it
into one command, a velocity set-point (`lingjing.engines.multirotor.verbs.STEER`).

Modules in the order of control:

- `missions`   the mission of `--scene`, and the changes of any mission's instance: tick, budget, verbs
- `protocol`   frames of MessagePack-RPC; the only module that imports msgpack
- `server`     connections of clients and the queue of their calls
- `arguments`  reads the arguments of calls
- `frames`     AirSim's coordinates: north, east, down, and quaternions
- `flight`     flight tasks and pilots
- `driving`    drivers of cars
- `vehicles`   the vehicles of the episode: kinematics and sensors, computed from the engines' states
- `distortion` the distortion of lenses
- `skies`      the weather and the sun of pictures
- `pictures`   pictures as AirSim encodes them
- `methods`    the methods that are served ← `flight_methods`, `state_methods`, `picture_methods`, `object_methods`,
  `sky_methods`, `car_methods`, `world_methods`
  ← `context`, the episode as they see it
- `session`    the source of decisions of the episode: answers calls, flies the vehicles, keeps the pace
- `episodes`   episodes one after another: `reset` ends one and begins the next

In: a mission and an address. Out: a trace like that of `lingjing run`. Each call is in the trace: in the thought of an
agent, at the boundary at which it was answered.

Invariants: one thread, that of the episode, answers calls and decides. Threads of connections only read and write
frames. A client's frame, however broken, ends at most its own connection.
"""
