"""`heuristic`: the rule baseline, chosen by what an agent can do and never by a mission's name.

`policy` picks the rules: `searcher` (flies a camera: sweeps `coverage` waypoints, looks with `detector`, reports),
`rescuer` (drives a vessel to reported positions, one at a time), `coordinator` (controls nothing: assigns cells and
rescues). All keep what they know of people in `sightings`. Only colour pixels are looked at, never class masks.
"""
