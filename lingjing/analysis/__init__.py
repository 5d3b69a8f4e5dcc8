"""What an episode amounts to: pure functions of its trace, nothing else is read.

- `detection`   reports against the ground truth of the frames they speak of
- `completion`  which targets were completed, and when
- `repetition`  how often a target was asked for or entered again
- `incidents`   who crashed, fell, ran out of energy, when and where
- `metrics`     `metrics(trace) -> Metrics`: the paper's tables of metrics
- `story`       what a picture of the episode needs, gathered by entity and by tick
- `overview`    `draw_overview(trace, path)`: the picture; the only module here that needs matplotlib
"""
