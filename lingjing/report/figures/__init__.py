"""One module for each figure of the paper. Each has a `FigureKind`; its `make` gives the parts.

- `main_table`     task success of every entrant in every column
- `communication`  star and broadcast on the same seeds
- `conversations`  messages between agents, in one episode of each mission
- `provenance`     cumulative stage success
- `perception`     errors of detection, location and calibration
- `sweeps`         scaling and robustness
- `failures`       families of failures of lost episodes
- `drift`          actions by third of an episode
- `signatures`     coverage, speed and redundancy of searches
- `ablations`      components of an agent
- `cost`           tokens and dollars
- `prompts`        prompts, and the search for one
- `appearance`     frames and their twins
- `last_mile`      the five stages of last-mile delivery
- `maps`           trails on the city's map
- `frames`         frames of the agents' cameras
"""
