"""`oracle`: plays with the truth, to show that a mission can be won and how fast.

`policy` gives each agent the abilities that its resources and messages allow; each tick every `ability` may speak and
the first that has a command gives it. `truth` is what they all look at. Abilities: `looking` (pictures and reports),
`flying` (above targets, along routes), `sailing`/`driving` (moving bodies to targets), `walking` (dogs around what
stands in the way, by `paths`), `dispatching` (goods, by `tours`), `guiding` (steps for those who do not see), `leading`
(what a hub does), `talking` (composing messages). Nothing here knows a mission by name.
"""

from lingjing_agents.oracle.policy import OraclePolicy

__all__ = ["OraclePolicy"]
