"""`heuristic`: the rule baseline, chosen by what an agent can do and never by a mission's name.

`policy` picks the rules. Who searches cells is a `searcher` (sweeps `coverage` waypoints, reports), helped by a
`coordinator` and by a `rescuer` who drives or sails to what was reported; what is looked for follows from the classes
in the brief (`kinds`): people (`detector`), fires (`flames`), gaps in decks (`gap`, along a `corridor`: `follower`).
Routes have a `route_inspector` (who sees `queues`), a `route_coordinator` and a `route_driver`; goods have `hauler`s
and a `planner`, who both make `tours` of what they see of the `town`. A `counter` counts people in `lines`. Who
commands a walking body is a `walker`, who leads one from the air a `guide`, who knows buildings from above by `homes`.
Shares of a search are in `sweep`, what was looked at in `coverage_map`. All keep what they know of targets in
`sightings`, public events in `events`. Only colours and depths are looked at, never class masks.
"""
