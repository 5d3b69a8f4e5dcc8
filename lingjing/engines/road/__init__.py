"""Road vehicles and background traffic, simulated by SUMO behind the engine contract.

A *network* consists of edges (one direction of a street) with lanes, and of links between them. SUMO drives all
vehicles. The mission's vehicles take commands. *Background traffic* drives between random edges. A *queue* of standing
vehicles marks each target that blocks a road. Bodies of other engines appear in SUMO as *stand-ins*, for which its
drivers brake.

Modules, in the order in which an episode uses them:

- `simulation`: the interface to libsumo; one simulation in a process.
- `graph`: edges, lanes and links of the network, and the lanes near a point.
- `routing`: the fastest way around places to avoid; `waypoints`: points on a route.
- `kinds`: sizes, masses and accelerations of vehicles, and the effect of a load.
- `driving_conditions`: the effect of weather on drivers and tyres.
- `kerb`: parking places beside the road, and the vehicles that pass them.
- `vehicle`: one vehicle of the mission; `lateral_motion`: gradual lane changes.
- `verbs`: the effect of commands.
- `traffic`: background vehicles; `congestion`: queues at targets that block a road.
- `street_life`: pedestrians on sidewalks and crossings, and visible traffic lights.
- `foreign_bodies`: stand-ins for bodies of other engines; `contact`: collisions.
- `options`: the scene's options.
- `engine`: the engine contract.

Invariants: each value that affects an outcome comes from the simulation, the mission's seed or a command. A fork of the
process is a complete copy. A vehicle of the mission never leaves the network and is never removed.
"""
