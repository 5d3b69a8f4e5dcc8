"""`heuristic`: the rule baseline. Its rules are selected by an agent's abilities, never by a mission's name.

`policy` selects the `role_rules` that fit an agent, by its verbs and the message records that it may send:

- search of cells from the air: `aerial_searcher` (with `search_plan` and `picture_lattice`), ordered by
  `search_coordinator`; `rescuer` goes to reported targets; `sightings` are the believed targets
- inspection of bridges: `bridge_inspector`
- routes: inspected by `route_inspector`, replanned by `route_coordinator`, driven by `route_driver`
- deliveries: `delivery_driver`, ordered by `delivery_coordinator`, on the basis of `delivery_view` and `order_book`
- errands: `errand_rules` (a picture, a flight to a given place)
- counting of people in line: `line_counter`
- walking bodies: `dogs` for the agents that command one, `guidance` for those that guide one

`target_types` derives the targets and their detectors from the classes of reports; `events` counts public events.
`learned` is the same policy with the detectors of `perception.learned` in place of the colour rules, class by class.

In: observations and inboxes. Out: decisions of one agent. Only colours and depths are used, never class masks.
"""
