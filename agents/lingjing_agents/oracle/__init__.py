"""`oracle`: a policy with access to the ground truth. It shows that a mission can be won, and how fast.

`policy` gives each agent the abilities that its resources and messages allow. At each tick every `ability` may send
messages, and the first ability with a command determines the command. All read `privileged_state` and send through
`composing`. The abilities are in `reporting` (targets in pictures), `aircraft` (flights above targets, along `routes`),
`vehicles` (road vehicles and vessels to targets) with `detours` (around road blocks), `pursuit` (goals beyond required
interactions and reports: amounts, distances, regions, status words, transport) with `goal_state`, `stops` and
`approaches`, `dogs` (paths around obstacles,
guidance for dogs without cameras), `deliveries` (goods), `hub` (relayed messages and orders) and `errands` (a picture,
a flight to a given place). `thoughts` says at each tick what an agent wants and why. No module knows a mission by name.
"""

from lingjing_agents.oracle.policy import OraclePolicy

__all__ = ["OraclePolicy"]
