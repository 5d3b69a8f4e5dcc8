"""Diagnostics about missions without errors that cannot be won, or cannot be played, or not on this machine.

- `infeasibility`: proofs of `lingjing.mission.feasibility`.
- `playability`: errors of instantiating and building the mission.
- `providers`: scenes, engines and maps that the mission names and that are not installed.
"""
