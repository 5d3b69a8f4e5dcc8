"""The plug-in contract: the modules that a plug-in imports, and the host that finds plug-ins.

A *plug-in* is a module with hooks that return *declarations*: a name, a factory, a model of options. The *host*
collects them. The *kinds* of declarations are policy, scaffold, backbone, engine, evaluator, scene and detector. Each
kind has a Protocol, its values, and checks of conformance. `docs/plugins.md` lists the kinds and their pages.

- `contract`      the version of the contract, and the modules that belong to it
- `hookspecs`     the hooks; `host` finds plug-ins, `loading` builds policies, `building` scenes, `making` holds the
  default of the hooks that make objects, `lookup` finds scaffolds and backbones for policies
- `foreign_errors`   an exception of a plug-in in one line, with the file and line of the plug-in's code; `hook_faults`
  the faults of hooks
- `options`       the models of options that plug-ins declare, and the reading of options that users give
- `engine`, `policy`, `evaluator`   the Protocols and their values; `chat_model` declares a model, `backbone` is the
  Protocol of a model, `calls` the record of a policy's model calls
- `scaffold`      the replaceable parts of an agent over a chat model; `scaffold_parts` names them in errors
- `asking`        model calls of a policy of one's own, and a server of models for frameworks ← `policy_calls` (the
  bill), `model_access` (the Protocol behind both)
- `writers`       writers of missions: chat models that continue a conversation about a text
- `decisions`     the JSON Schema of an agent's decisions, for policies that another program answers for
- `fleet`         the five methods over moving bodies ← `requests` (admission, receipts), `step_clock` (fixed steps)
- `tasks`         the tasks of a mission, for policies that may see its rules
- `prompts`       the prompts of a policy and their revision; `languages` the catalogues of texts for agents
- `frame_detector` detects a target in a picture
- `stock`         the goods on board of an entity, which a mission declares as `state`
- `bodies`        measures of entities; `terrain` the ground and its buildings; `roads` the public roads
- `geometry`      camera rays and headings
- `conformance`   tests for all kinds

Nothing here imports the kernel or a built-in engine, or names a shipped type or mission.
"""

__all__ = [
    "asking", "backbone", "bodies", "building", "calls", "chat_model", "conformance", "contract", "decisions", "engine",
    "evaluator", "fleet", "foreign_errors", "frame_detector", "geometry", "hook_faults", "hookspecs", "host",
    "languages", "loading", "lookup", "making", "model_access", "options", "policy", "policy_calls", "prompts",
    "requests", "roads", "scaffold", "scaffold_parts", "step_clock", "stock", "tasks", "terrain",
]  # fmt: skip
