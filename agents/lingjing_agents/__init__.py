"""The reference agents: policies that reach Lingjing through `lingjing.plugins` alone.

`plugin` declares them and the models of their options → `capability` says what a brief lets an agent do (so that no
policy knows a mission by name). `perception` says what pictures show, `ground_plane`, `paths` and `flight_levels` where
to go, `errands` what a body does alone. The policies: `chance` (random), `heuristic` (the rule baseline), `oracle`
(privileged), `react` over `llm` (a chat model), `replay` (scripted), `faulty` (the baselines with planted faults);
`frame_detectors` are asked about pictures outside of episodes. A policy is one object per agent and episode with two
methods, `reset(brief)` and `act(observation, inbox)`; its outcome depends on these inputs and on `brief.seed`, never on
a clock (but for a chat model's own).
"""
