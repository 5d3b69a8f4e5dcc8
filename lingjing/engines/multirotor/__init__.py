"""Multirotors: JSBSim flies the airframe, a cascaded controller flies JSBSim.

`drone` (one vehicle, and the fleet of them by `lingjing.engines.aircraft`) → `verbs` (command to destinations) →
`control` (position to attitude and thrust, 50 Hz) → `airframe` (JSBSim, 100 Hz), with `power` (what flying costs the
battery). `aircraft/` holds the airframe's model.

The world is flat: JSBSim's local north, east and down are taken as the world's axes at every place, and positions are
the trapezoidal integral of its velocity. Nothing else in the project reads JSBSim's latitude and longitude.
"""
