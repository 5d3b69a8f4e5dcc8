"""The mission: the one intermediate representation between every spelling and everything that runs.

Modules in the order a mission passes them:

- `units`, `functions`, `diagnostics`: dimensions and spellings of units, signatures of the built-ins, faults as data.
- `expression`, `model`: the typed graph `Mission`, a template that still holds parameters, modes and seeded draws.
- `document`: `mission.json` in and out, and the JSON Schemas generated from the code.
- `frames`, `jsontext`, `sky`: coordinate frames of `resetScenario` documents, JSON with places, words for weather.
- `reset_document`, `reset_elements`, `reset_fields`, `reset_template`: a document's shape, spellings,
  hidden fields and template; `reset_groups`, `reset_targets`, `reset`: what it places, into the template;
  `reset_notes`: what is kept and not understood; `reset_emit`: the way back.
- `seeding`, `draws`: named random streams, and what is drawn from them.
- `geometry2d`, `grid`, `spacing`: polygons, search cells cut from them, and places that keep their distance.
- `evaluate`: the value of an expression that is known before the first tick. `clock`: how tick and macro-step fit.
- `placing`, `roster`, `instantiate`: (mission, seed, mode, settings) to `instance.Instance`, the reset specification.
- `schedule`: the weather at a time, and who is there.
- `feasibility`: proofs that a mission cannot be won. `course`, `speaker`, `wording`: routes, who speaks, texts.
- `graph`, `draw`: the mission as typed nodes and edges, and pictures of that in SVG, Mermaid and DOT.

In: a file's text or a compiled `Mission`. Out: an `Instance`, in which everything but the rules is a plain value.
Invariants: all values are frozen; SI units and degrees; the same arguments give an equal `Instance` in every process;
nothing here imports numpy (but `seeding.generator`, when called) or anything else heavy.
"""
