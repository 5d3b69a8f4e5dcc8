"""The reference agents: policies that depend on Lingjing through `lingjing.plugins` alone.

Concepts. A *policy* is one object per agent and episode with two methods, `reset(brief)` and `act(observation, inbox)`.
Its decisions depend on these inputs and on `brief.seed`, never on a clock, except for a chat model's own. A *brief* is
the description of mission, agent and action space. No policy knows a mission by name: `capability` derives from the
brief what an agent can do.

Modules: `plugin` declares the policies and the models of their options. `perception` detects targets in pictures;
`ground_plane`, `paths` and `flight_levels` plan motion; `errands` are simple tasks of a single body. The policies are
`idle`, `chance` (random), `heuristic` (the rule baseline), `oracle` (privileged), `react` over `llm` (a chat model),
`reader` (a program in the place of that model),
`replay` (scripted), `sweep` (a lawn-mower search in the place of a model), `faulty` (the baselines with planted
faults) and `adversaries` (players that look for a way past the task). `scaffolds` are examples of
agent scaffolds for `react` that use the contract alone. `mission_writer` writes missions. `frame_detectors` answer
questions about single pictures outside of episodes.
"""
