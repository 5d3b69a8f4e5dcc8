"""Surface vessels: a 3-DOF hull (surge, sway, yaw) at 10 Hz, steered along a line of sight.

`engine` (the contract) → `boat` (one vessel: where it is bound, land ahead, station keeping) → `steering` (course and
speed) → `hull` (forces and motion). Heave, pitch and roll follow the waves of `lingjing.engines.sea`.
"""
