"""One episode, or several beside each other: from a mission to scored, recorded runs.

`options` say how one is to be played (`PlayOptions`) → `preparation` draws the instance and tells every fault of them,
with `policies` for who plays whom, `policy_files` for policies in files (`python_files` loads any) and `option_sharing`
for who gets which option → `recorded_calls` records what policies ask chat models, or replays it, and `spending` limits
what that costs → `folders` claims where a run is kept → `episode` plays one (`run`, `Session`), with its policies in
`policy_processes` or in threads, whose reports of an outage `outages` checks → `report` says what came of it
(`EpisodeReport`). `parallel` plays several, here or forked from one process, which `sharing` builds cities in.
`selfcheck` is a tiny episode with a stored digest.
In: `PlayOptions`; out: an `EpisodeReport`, and a trace that holds all there is to know.

Who imports this is about to play: numerical libraries that are not loaded yet are pinned (`lingjing.numerics`).
"""

from lingjing.numerics import pin

pin()
