"""`heuristic`: the rule baseline, chosen by what an agent can do and never by a mission's name.

`policy` picks the rules. Who searches cells is a `searcher` (sweeps `coverage` waypoints, reports), helped by a
`coordinator` and by a `rescuer` who drives or sails to what was reported; what is looked for follows from the classes
in the brief (`kinds`): people (`detector`), fires (`flames`), gaps in decks (`gap`, along a `corridor`: `follower`).
Routes have a `route_inspector` (who sees `queues`), a `route_coordinator` and a `route_driver`; goods have `hauler`s
and a `planner`, who both make `tours` of what they see of the `town`. A `counter` counts people in `lines`. Walkers
are in `walk_*`, their eyes in `dog_*`, who leads them in `guide_*`: to the house of a picture by what `homes` look like
from above and the way that `walk_plan` makes. All keep what they know of targets in `sightings`. Only colours and
depths are looked at, never class masks.
"""
