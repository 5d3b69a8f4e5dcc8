"""Surface vessels: hulls with three degrees of freedom (surge, sway, yaw) at 10 Hz.

A vessel steers along the line from its start to its destination and stops before land. Heave, pitch and roll follow the
waves of `lingjing.engines.sea`.

Modules:

- `engine`: the engine contract.
- `boat`: one vessel, its destination, land ahead and station keeping.
- `steering`: guidance and control of course and speed.
- `hull`: forces and motion.
"""
