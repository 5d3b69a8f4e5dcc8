"""Multirotors: a quadrotor in JSBSim under a cascaded controller.

The world is flat: JSBSim's local north, east and down are the world's axes at every place. A position is the
trapezoidal integral of JSBSim's velocity. JSBSim's latitude and longitude are not used.

Modules:

- `drone`: one vehicle, and the fleet of them.
- `verbs`: the points to fly to for each command.
- `control`: the position controller, from position to attitude and thrust, 50 Hz.
- `airframe`: JSBSim at 100 Hz; `aircraft/` holds its model.
- `coarse_airframe`: the point mass of coarse motion.
- `power`: electric power of the flight.
"""
