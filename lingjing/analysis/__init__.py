"""Evaluation of one episode: metrics, diagnosis and pictures. All functions depend on the trace only.

Concepts:

- A *report* is a message in which an agent claims to have detected a target in a frame. A report is *matched* if the
  mission's matching rule accepts it for a target. Otherwise it is *false*, if the mission has such a rule.
- A *target* is *completed* when the event happens that the mission's success requires of it.
- An *action* is a physical command that a policy decided on. An *assignment* is a message that gives targets to an
  asset. An *incident* is a collision, a fall, a drowning or an empty energy store.
- The *failure family* of a lost episode is the kind of its earliest breakdown, as the paper defines it.

Modules, from the computation of single quantities to the presentation of an episode:

- `memo`: `cache_by_trace`, which caches results with their trace
- `messages`: the messages that the bus admitted
- `agent_notes`: the notes in the agents' thoughts
- `detection`: comparison of reports with the ground truth of their frames
- `small_boxes`: boxes of few pixels, tolerances and chance levels
- `box_conventions`: boxes that would match under another convention
- `completion`: completion of targets
- `relations`: occurrences of the five coordination relations, added to a trace while it is written
- `repetition`: repeated assignments of targets and repeated entries into their regions
- `idleness`: idle steps of agents
- `behaviour`: adherence, repetition, out of bounds and forgotten subgoals, also by tercile
- `search_marks`: redundant revisits, and communication at discovery
- `attention`: comparison of a model's attention maps with true boxes
- `attention_extraction`: attention maps from the output of a `transformers` model
- `last_mile`: the stages S1 to S5 of last-mile delivery
- `incidents`: incidents with time and place
- `registries`: the kernel's registry at every boundary, computed from the records
- `failure_records`, `navigation_failures`, `families`: the failure family of a lost episode, with its evidence
- `clauses`: the unmet parts of a condition, with their values
- `ending`: `why(trace)`, the explanation of an episode's end
- `metrics`: `metrics(trace) -> Metrics`, the paper's tables of metrics
- `shares`: the confidence interval of a share
- `history`: the data of a trace by entity and by tick, for drawing
- `played_city`: the city of an episode, built again; `trace_exports`: a trace as files of other programs
- `page_pictures`: the map with tracks and the best frame of each camera, for pages
- `fonts`: fonts that cover the letters of a text
- `overview`: `draw_overview(trace, path)`, one picture of an episode

Only `overview`, `page_pictures` and `fonts` need matplotlib.
"""
