"""Episodes and suites: from a mission to scored, recorded runs.

`folders` claims where a run is kept → `episode` plays one (`run`, `Session`) → `fleet` plays several, here or in child
processes → `supervision` has them played in a child that a policy may ruin, and `descendants` ends what is left →
`report` says what came of them → `study` plays matched seeds over modes and policies and prints the table.
In: a `Mission`; out: an `EpisodeResult` whose trace holds all there is to know.

Who imports this is about to play: numerical libraries that are not loaded yet are pinned (`lingjing.numerics`).
"""

from lingjing.numerics import pin

pin()
