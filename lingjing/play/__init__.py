"""One episode, or several beside each other: from a mission to scored, recorded runs.

`folders` claims where a run is kept → `episode` plays one (`run`, `Session`) → `parallel` plays several, here or in
child processes → `supervision` has them played in a child that a policy may ruin, and `descendants` ends what is left →
`report` says what came of them. `selfcheck` is a tiny episode with a stored digest.
In: a `Mission`; out: an `EpisodeResult` whose trace holds all there is to know.

Who imports this is about to play: numerical libraries that are not loaded yet are pinned (`lingjing.numerics`).
"""

from lingjing.numerics import pin

pin()
