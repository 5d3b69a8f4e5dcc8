"""OpenStreetMap data → a city in a folder.

`read` (the file → nodes, ways, relations as they stand) → `frame` (which part of it, and the local frame) → `features`
(lines and polygons in metres, multipolygons assembled, cut to the frame) → one module a kind of thing: `buildings`
(with `tags` and `looks` for what their tags say or leave open), `water`, `ground`, `structures`, `trees` → `build`
(all of them and the road network into a store, cached by content; `summary` says what was built).

The same file, options and library versions give the same city: objects are taken in the order of their ids, and each
that leaves something to chance has a stream of its own from (seed, kind, id). What cannot be used is left out and
counted, never guessed at in silence; a file that gives no city at all is a `UsageError`.
"""
