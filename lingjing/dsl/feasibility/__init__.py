"""Why a mission without errors cannot be won, cannot be played, or not here, as diagnostics at its declarations.

- `infeasible`: what `lingjing.mission.feasibility` proves.
- `refused`: what instantiating and building it would refuse.
- `absent`: scenes and engines that it names and nobody here offers.
"""
