"""One module for each figure of the paper; each has a `FigureKind`, which the page asks for its parts.

- `main_table`     task success of every entrant in every column
- `communication`  star and broadcast on the same seeds
- `conversations`  who told whom what, in one episode of each mission
- `provenance`     cumulative stage success
- `perception`     detection, location and calibration errors
- `sweeps`         scaling and robustness
- `failures`       why episodes were lost
- `drift`          actions by tercile
- `signatures`     how searches went
- `ablations`      components of an agent
- `cost`           tokens and dollars
- `prompts`        prompts, and the search for one
- `appearance`     frames and their twins
- `last_mile`      the five stages of last-mile delivery
- `maps`           trails on the city's map
- `frames`         what agents saw
"""
