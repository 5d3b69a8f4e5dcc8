"""`oracle`: plays with the truth, to show that a mission can be won and how fast.

`policy` gives each agent the abilities that its resources and messages allow; each tick every `ability` may speak and
the first that has a command gives it. All look at `privileged_state` and send by `composing`. Abilities: `reporting`
(what pictures show), `aircraft` (above targets, along `routes`), `vehicles` (road vehicles and vessels to targets) with
`detours` (around what blocks the roads), `dogs` (around what stands in the way, and steps for dogs that do not see),
`deliveries` (goods), `hub` (what a hub passes on and orders), `errands` (a picture, a flight to the place that is
shown). Nothing here knows a mission by name.
"""

from lingjing_agents.oracle.policy import OraclePolicy

__all__ = ["OraclePolicy"]
