"""`heuristic`: the rule baseline, chosen by what an agent can do and never by a mission's name.

`policy` picks the `role_rules` that fit an agent, by its verbs and by the message records it may send:

- cells are searched from the air by `aerial_searcher` (← `search_plan` ← `picture_lattice`, `coverage_map`), in the
  order of `search_coordinator`; `rescuer` drives or sails to what is reported; `sightings` are what they believe
- `bridge_inspector` follows a bridge's `centreline`
- routes are inspected by `route_inspector`, replanned by `route_coordinator` and driven by `route_driver`
- goods are brought by `delivery_driver`, in the order of `delivery_coordinator`, by what both see (`delivery_view`)
- `errand_rules`: a picture is taken where the mission is won by pictures, a place flown to where one is shown
- `line_counter` counts people who stand in line
- `dogs`: rules of agents that command a walking body; `guidance`: of those who lead one

`target_types` says what is looked for, by the classes that reports may name, and how `perception` finds it; `events`
counts public events. `learned` is the same policy with the detectors of `perception.learned` in the place of the colour
rules, class by class. In: observations and inboxes. Out: decisions of one agent. Only colours and depths are looked at,
never class masks.
"""
