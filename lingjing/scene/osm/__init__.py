"""OpenStreetMap data → a city in a folder.

An OpenStreetMap file holds *nodes* (places), *ways* (lines through nodes) and *relations* (groups of ways), all with
*tags* (`building=house`). The *frame* is the part of the map that becomes the city, with its local coordinates.
*Features* are the map's objects as lines and polygons in metres.

The modules in control-flow order:

- `source` recognises the format of a file; `xml_format` or `pbf_format` parses it; `read` returns normalised
  `map_data`.
- `frame` chooses the part of the map; `features` makes shapes in metres and assembles multipolygons.
- One module for each kind of thing: `buildings`, `streets`, `water`, `ground`, `structures`, `footbridges`, `trees`,
  `furniture`.
- For buildings: `tags`, `uses` and `heights` read what tags state; `places`, `storeys` and `neighbours` estimate
  heights that they do not state; `looks` gives facades, roofs and colours; `stacking` resolves parts that overlap;
  `passages` lets streets through; `doors` gives entrances.
- For streets: `access` and `speed` read what tags permit; `elevation` gives bridges and tunnels.
- `build` writes all of it into a store, cached by content; `summary` describes the result.
- `provider` is the scene kind `map`.

The same file, options and library versions give the same city. Objects are processed in the order of their ids, and
each random choice has a stream of its own from (seed, kind, id). Unusable objects are left out and counted, never
replaced silently by a guess. A file that gives no city at all is a `UsageError`.
"""
