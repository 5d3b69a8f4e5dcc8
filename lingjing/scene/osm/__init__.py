"""OpenStreetMap data → a city in a folder.

`read` (the file → nodes, ways and relations as a normalised `map_data`: `source` recognises the file, `xml_format` or
`pbf_format` parses it) → `frame` (which part of it, and the local frame) → `features` (lines and polygons in metres,
multipolygons assembled) → one module a kind of thing: `buildings` (with `tags`, `uses` and `heights` for what their
tags state, `places`, `storeys` and `neighbours` for heights that they do not, `looks` for facades and colours,
`stacking` for parts that stand in each other), `streets` (with `access` and `speed` for what tags permit, `elevation`
for bridges and tunnels) for the traffic network, `water`, `ground`, `structures`, `footbridges`, `trees` → `build` (all
of them into a store, cached by content; `summary` says what was built). `provider` is the scene kind `map`.

The same file, options and library versions give the same city: objects are taken in the order of their ids, and each
that leaves something to chance has a stream of its own from (seed, kind, id). What cannot be used is left out and
counted, never guessed at in silence; a file that gives no city at all is a `UsageError`.
"""
