"""Satellites: orbits by SGP4, and the times at which the mission's region is in view.

A satellite flies by its two-line elements (`tle1`, `tle2`). A satellite without elements gets a sun-synchronous orbit
at 550 km that passes over the scene's origin during the episode. One such satellite passes at half time; several pass
at even intervals. Simulation time 0 is the first of these that exists: the scene's option `epoch`; the property `epoch`
of the first satellite that has one; the latest epoch among the elements; noon of 20 March 2026. Both `epoch`s are UTC
in ISO 8601, such as "2026-03-20T12:00:00Z".

A satellite looks at the middle of the mission's public regions, or at the scene's origin if there are none. Its camera
tilts along the track and not across it. The region is `in_view` from 30 degrees of elevation while it lies within half
the `swath` of the ground track. Position and velocity are in the scene's frame, extended as a plane: a satellite at the
horizon is far away and low. While the region is above the horizon, the nose of the body points at it.

Modules:

- `engine`: the engine contract.
- `passes`: the times at which the region is in view.
- `earth`: the rotation of the Earth and the frame of the scene.
- `orbit`: the interface to sgp4.
"""
