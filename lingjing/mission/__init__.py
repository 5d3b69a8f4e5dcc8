"""The compiled mission: the typed intermediate representation between the mission language and everything that runs.

Concepts. A `Mission` is a compiled template: it still holds parameters, modes (variants such as team layouts) and
seeded draws. An `Instance` is one concrete episode of it: (mission, seed, mode, settings) with every value drawn. The
paper calls it the reset specification. An expression is a typed tree. The same tree is evaluated with several
semantics: exact values before the first tick, bounds that hold in every run, a run's facts, or plain words.

Modules in control-flow order:

- `units`, `diagnostics`: dimensions and spellings of units; user errors as data.
- `expression`, `model`: expression trees and the typed graph `Mission`.
- `values`, `operations`, `intervals`, `functions`: the values of expressions, and the one table of operators and
  functions. `fold`: the one traversal of expressions. Its semantics are `evaluate` (before the first tick), `certain`
  (bounds that hold in every run), `conditions.condition_needs` (events that a condition needs), the kernel's rules,
  and `condition_words` (conditions in plain words, with the bounds that they set).
- `expression_text`, `instance_text`: expressions and the rules of an instance in the language's own spelling.
- `interactions`: errors of interactions, and their permissions at the start. `kinds`: the features of scenes and
  engines, as data; `kinds_format`: the file format of these; `kinds_file`: the checked reader of a plug-in's file.
- `natures`: the behaviour of targets without interaction, and their status words.
- `document`: reads and writes `mission.json` and the generated JSON Schemas. `faults`: errors of a JSON value against
  its schema. `strict_schema`: schemas in the form that strict validators accept.
- `frames`, `jsontext`, `weather_words`, `elements`: coordinate frames of `resetScenario` documents, JSON with
  positions, weather words, two-line elements.
- `reset`: reads and writes `resetScenario` documents.
- `seeding`, `draws`: named random streams, and seeded draws from them. `salts`: draws that need a secret file.
  `requirements`: conditions that the draws of a seed must meet.
- `appearance`: colours, shapes and models of bodies.
- `vocabulary`: words that several packages must spell alike. `spec_schema`: JSON Schemas of action and message specs.
- `geometry2d`, `grid`, `spacing`: polygons, search cells cut from them, and points with a minimum distance. `geos`:
  buffers without shapely.
- `footprint`: the ground area of bodies at their start, and whether it is free.
- `clock`: the relation of tick and macro-step.
- `instance`: the concrete episode. `instantiate` makes it of its parts: `instance_entities`, `instance_agents` (with
  messages) and `instance_rules` (events, limits, texts). `trial`: errors that playing would
  report, found without playing.
- `tiers`: values of parameters that make a harder form of a mission. `alternatives`: a mission with its switches and
  conditional lines resolved.
- `settings`: parameter values as text. `schedule`: the declared world under the events that have occurred.
- `conditions`: one reading of all conditions: the quantities and needs of each. `feasibility`: proofs that a mission
  cannot be won. `tasks`: the members of each group that success requires.
- `wording`: placeholders in texts, and values in words. `languages`: the languages of texts, and catalogues of them.
- `graph`, `draw`: the mission as typed nodes and edges, and its pictures in SVG, Mermaid and DOT.

In: a file's text or a compiled `Mission`. Out: an `Instance`, in which everything but the rules is a plain value.
Invariants: all values are frozen; lengths are in SI units and angles in degrees; the same arguments give an equal
`Instance` in every process; no module imports a heavy dependency. (`seeding.generator` imports numpy when called.)
"""
