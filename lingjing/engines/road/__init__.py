"""Road vehicles and background traffic: SUMO behind the five-method contract.

In the order in which an episode meets them:

- `simulation` is the one door to libsumo: one simulation a process, started and closed here.
- `graph` is what the network's edges, lanes and links are, and which lane is nearest to a point.
- `routing` finds the quickest way on that graph around places to avoid; `waypoints` says where a route passes.
- `kinds` are the vehicles: sizes, masses, accelerations, what a load does to them.
- `kerb` is where vehicles park beside the road, and who comes by when one wants to pull out.
- `vehicle` is one vehicle of the mission: where it is, what it is doing, what it carries; `lateral_motion` shows its
  lane changes as motion.
- `verbs` turns commands into what a vehicle does, or refuses them.
- `traffic` keeps background vehicles driving, `congestion` lets queues stand where a target blocks the road.
- `foreign_bodies` sets the bodies of other engines into the simulation at each of its steps, `contact` sees who is hit.
- `options` is what the scene asks for.
- `engine` puts all of it behind `FleetEngine`.

Invariants: every number that decides something comes from the simulation, the mission's seed or a command; a fork of
the process is a whole copy; a vehicle of the mission never leaves the network and is never removed.
"""
