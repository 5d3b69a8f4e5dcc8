"""Episodes and suites: from a mission to scored, recorded runs.

`folders` claims where a run is kept → `episode` plays one (`run`, `Session`) → `study` plays matched seeds over modes
and policies and prints the table. In: a `Mission`; out: an `EpisodeResult` whose trace holds all there is to know.
"""
