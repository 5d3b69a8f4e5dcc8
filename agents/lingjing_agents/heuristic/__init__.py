"""`heuristic`: the rule baseline, chosen by what an agent can do and never by a mission's name.

`policy` picks the rules. Who searches cells is a `searcher` (sweeps `coverage` waypoints, reports), helped by a
`coordinator` and by a `rescuer` who drives or sails to what was reported; what is looked for follows from the classes
in the brief (`kinds`): people (`detector`), fires (`flames`), gaps in decks (`gap`, along a `corridor`: `follower`).
Routes have a `route_inspector` (who sees `queues`), a `route_coordinator` and a `route_driver`; goods have `hauler`s
and a `planner`, who both make `tours` of what they see of the `town`. A `counter` counts people in `lines`. Walkers
choose their rules in `walk_rules`: `walk_navigator` (finds the house of a picture), `walk_searcher` (looks for fires,
kept in `walk_fires`), `walk_executor` (sees nothing and is led). They move by `walk_legs` over `walk_map`, along
`walk_plan` and `walk_way`, and look by `walk_views`, `dog_facade`, `dog_flames`, `dog_walls`. `guide_pilot` leads them:
`guide_leak` finds the leak, `guide_ground` what stands in the way, `guide_home` the house by what `homes` look like
from above. Shares of a search are in `sweep`, what was looked at in `coverage_map`. All keep what they know of targets
in `sightings`, public events in `events`. Only colours and depths are looked at, never class masks.
"""
