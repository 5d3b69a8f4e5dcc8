"""What an episode amounts to: pure functions of its trace, nothing else is read.

- `memo`        `once_per_trace`: what several figures ask of a trace is computed once
- `detection`   reports against the ground truth of the frames they speak of
- `completion`  which targets were completed, and when
- `messages`    the messages that the bus admitted, each once
- `relations`   the occurrences of the five coordination relations, added to a trace while it is written
- `idleness`    the share of agent steps with nothing assigned and nothing done
- `repetition`  how often a target was asked for or entered again
- `behaviour`   adherence, repetition, out of bounds, forgotten subgoals, by tercile
- `search_marks` redundant revisits, communication at discovery
- `attention`   maps of where a model looked against true boxes
- `attention_extraction` such maps out of what an open model of `transformers` returned
- `last_mile`   S1 to S5 of last-mile delivery, from typed reports of ends and way
- `incidents`   who crashed, fell, ran out of energy, when and where
- `registries`  the kernel's registry at every boundary, from the records alone
- `families`    the failure family of a lost episode, with the records that show it
- `clauses`     what a condition lacks, with the values it had
- `ending`      `why(trace)`: why it ended as it did
- `metrics`     `metrics(trace) -> Metrics`: the paper's tables of metrics
- `shares`      the confidence interval of a share
- `history`     what a picture of the episode needs, gathered by entity and by tick
- `played_city` the city of an episode, built again, and whom to name for its map
- `page_pictures` the map with the trails and the best picture of each camera, for pages
- `fonts`       a font for whatever letters a text has
- `overview`    `draw_overview(trace, path)`: the picture; it and `fonts` alone here need matplotlib
"""
