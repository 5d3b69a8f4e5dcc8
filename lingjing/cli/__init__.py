"""The command line: one module a verb, each with `add_options(parser)` and `handler(args) -> int`.

`main` picks the verb and imports its module alone, `parser` reads the arguments, `process` is the command's own process
(streams, signals, exit codes), `files` reads missions and writes texts, `console` draws. A verb with actions declares a
handler for each of them.

- `validate`, `compile`, `fmt`, `explain`, `lsp`   a text: its errors, its graph, its layout, what a code means
- `graph`, `docs` ← `missionpage`                  a mission as a picture, as a page
- `scene`                                          a map → a city
- `run` ← `arguments` (what options mean), `progress` (the live line), `watch` (the episode in the terminal),
  `scorecard` (the numbers of one episode), `results` (what is printed of one or many)
- `bench` ← `attribution` (planted faults)          a suite of many episodes: its rows, its tables
- `verify`, `replay`, `why`, `metrics`             a trace: is it what was written, does it happen again, why and what
- `fork`, `blame`, `value` ← `branches`            a trace: what would have had to be different, what was worth saying
- `view`, `film`                                   a trace to look at: in the browser, as a film
- `report`                                         many episodes as the paper's figures
- `shrink`                                         the smallest mission that fails as a trace did
- `calls`                                          what an episode's policies asked chat models
- `prompts`                                        a policy's prompts; a better one from failed traces
- `frames`                                         sets of traces' frames for detectors; a probe of detectors
- `plugins` ← `installed`, `new` ← `newengine`     what is installed, what is begun
- `doctor` ← `libraries`                           what the machine lacks
"""
