"""The command line `lingjing VERB …`.

A *verb* is one module of this package with `add_options(parser)` and `handler(args) -> int`, which returns the exit
code. A verb with *actions* (`lingjing bench table`) declares one handler for each action. The module's docstring is
the description in `--help`.

`main` finds the verb and imports its module alone. `parser` reads the arguments. `process` holds the standard streams,
the signals and the end of the process. `files` reads missions and writes files. `console` draws on terminals.

- `validate`, `compile`, `fmt`, `explain`, `lsp`   mission text: its errors, graph, layout; the meaning of an error code
- `test`, `generate`                               the expectations of missions, and composed missions that meet theirs
- `graph` ← `conditions`, `docs` ← `missionpage`   a mission as a picture, its conditions, and as a page
- `scene`                                          a city built from a map, described, drawn, exported
- `run` ← `arguments` (parsing of option values), `progress` (the live line), `watch` (the episode in the terminal),
  `scorecard` (the numbers of one episode), `results` (printed results of one or many episodes)
- `bench` ← `attribution` (planted faults), `adversaries`, `validity`    a suite of many episodes, its rows and tables
- `verify`, `replay`, `why`, `metrics`, `trace`    a trace: integrity, determinism, reason, metrics, files for others
- `fork`, `blame`, `value` ← `branches`            branches of a trace: interventions, blame, value of messages
- `view`, `film`                                   a trace in the browser, and as a film
- `serve`, `serve_engines`                         an episode for clients of AirSim's API, or with foreign engines
- `engine`                                         our engines for a foreign backend
- `report`                                         the paper's figures from many episodes
- `shrink`                                         the smallest mission that fails as a trace did
- `calls`                                          the recorded model calls of an episode
- `models`                                         a check of a chat model with one request a column
- `prompts`                                        prompts of policies, and their revision from failed traces
- `frames`                                         labelled sets of frames for detectors, and a probe of detectors
- `plugins` ← `installed`, `new` ← `newpackage`, `newmission`    installed plug-ins, and files to start a new one from
- `completion`                                     completion of commands in shells
- `doctor` ← `libraries`                           a check of the machine
"""
