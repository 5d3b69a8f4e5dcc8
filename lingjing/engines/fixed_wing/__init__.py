"""Fixed-wing aircraft: a light aeroplane in JSBSim under an autopilot. The engine's name is `plane`.

An aircraft that starts in the air flies in a circle. An aircraft that starts on the ground or a roof is launched by a
catapult at its first destination. It flies straight to a destination and then circles around it. It stays in the air
until it hits something or its fuel is used up.

Modules:

- `aeroplane`: one aircraft, and the fleet of them.
- `guidance`: course, bank and climb rate towards a destination.
- `control`: the autopilot, from bank, climb and airspeed to stick and throttle, 50 Hz.
- `airframe`: JSBSim's Cessna 172 at 100 Hz.
"""
