"""Scene providers: what a mission names after `scene` → one `City` that every engine shares.

In the order in which an episode meets them:

- `city`        the values: `City`, its pieces (buildings, roads, waters, …) and `Tile`
- `bay`         a procedural sea bay: harbour point, beach, rocks and a pier in open water, things afloat
- `districts`   procedural towns by seed and options, one district or all of them as a wide city
- `osm`         OpenStreetMap data → a city in a folder (`lingjing scene build`; scene kind `map`)
- `network`     nodes and edges, or a map, → SUMO's road network in world metres, and its roads back as pieces
- `road_map`    the same as a graph, for policies that plan ways
- `cutting`, `store`, `tiles`   long pieces cut at the grid → a city in a folder of tiles → read near a place, lazily
- `atomic_folder` where writers write, so that a city or network appears whole or not at all
- `anchor`      entities onto the roads, roofs, … that they declare ← `footing`, `lines`, `places_alike`
- `displacement`   how far `anchor` has moved declared places: what is reported, and what is too far
- `terrain`     what a place is to a body: water, ground, what stands there and how high ← `outlines`, `blocks`
- `flight_floor`   the lowest points that flying bodies may be sent to
- `obstacles`   where legs can go; `shapes`, `props`, `sizes` what can be touched, and how large it is
- `roofs`       how high a city can be at many places at once
- `regions`     regions that only the city knows, such as those along a road
- `camera_geometry`   pixels, rays and points; headings; where a body's cameras sit
- `city_checks`       what every city must be
- `plan`        the city from above: flat shapes in painting order, and their painter
- `translation` pieces carried to where a scene's centre lies
- `surroundings` the city around what is played in, for viewers: shapes, and meshes in space

Invariants: a provider's result is a pure function of its `SceneSpec` (and the content of the map it names): the same
spec gives an equal city in every process, identified by `City.sha256`. Network and world coordinates are the same.
Readers go through `Tiles` and need not know whether a city is stored. Nothing here moves or imports a plug-in.
"""
