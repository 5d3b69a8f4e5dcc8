"""The mission: the one intermediate representation between every spelling and everything that runs.

Modules in the order a mission passes them:

- `units`, `diagnostics`: dimensions and spellings of units, faults as data.
- `expression`, `model`: the typed graph `Mission`, a template that still holds parameters, modes and seeded draws.
- `values`, `operations`, `intervals`, `functions`: what expressions compute with, and the one table of operators and
  functions. `fold`: the one evaluator; its readings are `evaluate` (before the first tick), `certain` (in every run),
  `feasibility.condition_needs` (what must have happened), the kernel's rules and `condition_words` (conditions in plain
  words, and the bounds they set).
- `expression_text`: expressions in the language's own spelling; `instance_text`: those of an instance.
- `hidden_reads`: whether a condition reads what agents may not know.
- `interactions`: what is wrong with one, who may act from the start. `kinds`: what is known of scenes and engines, as
  data; `kinds_format`: the file that says it; `kinds_file`: a plug-in's, checked.
- `document`: `mission.json` in and out, and the JSON Schemas generated from the code; `faults`: what is wrong with a
  JSON value, by its schema; `strict_schema`: schemas as strict validators take them.
- `frames`, `jsontext`, `weather_words`, `elements`: coordinate frames of `resetScenario` documents, JSON with places,
  words for weather, two-line elements.
- `reset`: `resetScenario` documents in and out.
- `seeding`, `draws`: named random streams, and what is drawn from them.
- `appearance`: colours, shapes and looks that a type may have.
- `vocabulary`: words that several packages spell alike. `spec_schema`: JSON Schemas of action and message specs.
- `geometry2d`, `grid`, `spacing`: polygons, search cells cut from them, and places that keep their distance.
- `footprint`: the room that bodies take up where they begin, and whether they stand there.
- `clock`: how tick and macro-step fit.
- `instance_entities`, `instance_agents`, `instance_rules`, `prompt_filling`, `instantiate`: (mission, seed, mode,
  settings) to an `Instance` of `instance`, the reset specification: its entities, its agents and messages, its events
  and limits, its texts. `trial`: what playing would refuse, found without playing.
- `settings`: values of parameters as people write them. `schedule`: the weather at a time, and who is there.
- `feasibility`: proofs that a mission cannot be won. `tasks`: what it asks of whom.
- `wording`: holes in texts, and values in words.
- `graph`, `draw`: the mission as typed nodes and edges, and pictures of that in SVG, Mermaid and DOT.

In: a file's text or a compiled `Mission`. Out: an `Instance`, in which everything but the rules is a plain value.
Invariants: all values are frozen; SI units and degrees; the same arguments give an equal `Instance` in every process;
nothing here imports numpy (but `seeding.generator`, when called) or anything else heavy.
"""
