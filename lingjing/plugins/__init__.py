"""Everything a plug-in author needs: contracts, values, hooks, geometry and the conformance kit.

- `contract`      the version of the contract, and the modules that belong to it
- `hookspecs`     what a plug-in may offer; `host` finds it, `loading` builds policies, `building` scenes
- `options`       the models of options that plug-ins declare, and the reading of what people write
- `engine`, `policy`, `evaluator`   the Protocols and their values; `chat_model` how a model is declared, `calls` what a
  policy that asks models is given beside its options
- `decisions`     the JSON Schema of an agent's decisions, for policies whose answers come from a foreign program
- `fleet`         the five methods over moving bodies ← `requests` (admission, receipts), `step_clock` (fixed steps)
- `tasks`         what a mission asks for, for policies that may see its rules
- `prompts`       the prompts of a policy, and how a better one is asked for; `frame_detector` what says whether a
  picture shows a target
- `stock`         what is on board of an entity, of what a mission declares as `state`
- `bodies`        measures of entities; `terrain` the ground and what stands on it; `roads` the public roads
- `geometry`      camera rays and headings
- `conformance`   tests for engines, policies, types, evaluators, scenes and files of kinds

Nothing here knows the kernel, a built-in engine, a shipped type or a mission.
"""

__all__ = [
    "bodies", "building", "calls", "chat_model", "conformance", "contract", "decisions", "engine", "evaluator", "fleet",
    "frame_detector", "geometry", "hookspecs", "host", "loading", "options", "policy", "prompts", "requests", "roads",
    "step_clock", "stock", "tasks", "terrain",
]  # fmt: skip
