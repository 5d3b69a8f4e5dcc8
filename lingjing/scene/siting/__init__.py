"""Siting: a mission's places found in a real city (ADR 0047).

A shipped mission declares its places in the district that its scene makes up: a deck, a pipeline, a compound, a depot,
waypoints. Siting finds places of the same role in a city from a map and returns the mission with these places and the
scene `map`. All else stays: goals, budgets, rules, draws. The result is a pure function of mission and city.

The role of a place follows from declarations: the scene's options `bridge`, `pipeline`, `inside` and `homes`, the
mission's `inspection` of a route, and what each type is `on`.

Modules in control-flow order:

- `layout` reads the places of a mission and their roles.
- `city_view` gives doors, roofs, bridges, pipes and the connected roads of a city; `walking` the ground for dogs.
- `lines`, `grounds`, `routes` and `areas` find one role each and say what is missing.
- `rewriting` puts the found places into the mission.
- `sited` chooses among them and tries the result.
"""
