"""Episodes: one, or several in parallel, from a mission to recorded runs with scores.

Concepts: *options* (`PlayOptions`) decide an episode. An *assigned policy* plays one agent. A *report*
(`EpisodeReport`) is the result. The trace in the run's folder holds the rest. In the order of a call:

- `options`         the options of an episode, from Python values or JSON
- `deep_check`      the places of a mission's instances in its built city, without an episode
- `placed_plan`     a plan of a placed instance, without an episode; `rendered_view` its rendered picture
- `siting`          the mission with its places found in a city from a map, cached
- `preparation`     draws the instance and checks every option
  ← `policies` (the policy of each agent), `policy_files` (policies in files), `python_files` (loads a file of a user),
  `option_sharing` (the options of each plug-in)
- `recorded_calls`  records or replays the chat-model calls of policies ← `spending`, the limits of their cost
- `folders`         creates the folder of a run
- `episode`         plays one episode (`run`, `Session`), with its policies in `policy_processes` or in threads
  ← `outages`, the check of a policy's report of an outage
- `asynchronous`    plays one episode as a coroutine
- `report`          the report of an episode, and of several seeds
- `parallel`        plays several episodes, here or forked from one process ← `sharing` (the data that they share)
- `selfcheck`       a tiny episode with a stored digest

An import of this package pins numerical libraries that are not loaded yet (`lingjing.numerics`).
"""

from lingjing.numerics import pin

pin()
