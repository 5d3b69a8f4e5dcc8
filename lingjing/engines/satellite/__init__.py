"""Satellites: SGP4 says where they are, the scene's horizon says what they see.

`engine` (the contract) → `passes` (when the region is in view) → `earth` (Earth's rotation, the scene's horizon) →
`orbit` (the one place that imports sgp4).

A satellite flies by its two-line elements (`tle1`, `tle2`). One without elements gets an orbit of its own, 550 km high
and sun-synchronous, that passes over the scene's origin in the course of the episode: a lone one at half time, several
spread evenly. Simulation time 0 is, in this order: the scene's option `epoch`, the first satellite's property `epoch`
(both UTC in ISO 8601, such as "2026-03-20T12:00:00Z"), the youngest epoch among the elements, noon of 20 March 2026.

What it looks at is the middle of the mission's regions (never a hidden one), else the scene's origin. Its camera tilts
along the track and not across: the region is `in_view` from 30 degrees of elevation up while it lies within half of the
`swath` of the ground track. Position and velocity are in the scene's frame, extended as a plane: a satellite at the
horizon is far away and low. While the region is above the horizon the body's nose points at it.
"""
