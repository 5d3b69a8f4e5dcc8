"""Fixed-wing aircraft: JSBSim flies a light aeroplane, three loops fly JSBSim. The engine's name is `plane`.

`aeroplane` (one aircraft, and the fleet of them by `lingjing.engines.aircraft`) → `guidance` (a destination to a
course and a climb: straight there, then a circle around it) → `control` (course, climb and airspeed to stick and
throttle, 50 Hz) → `airframe` (the library's Cessna 172 at 100 Hz).

An aircraft that the mission puts into the air flies from the start, in a circle; one that stands on the ground or a
roof is shot off a catapult by its first destination. It stays in the air until it hits something or runs dry.
"""
