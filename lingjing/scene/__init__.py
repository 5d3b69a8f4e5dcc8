"""Scene providers: build the static world of a mission, one `City` that every engine shares.

A *scene* is what a mission names after the word `scene`: a bay, a district, a map. A *provider* turns its `SceneSpec`
into a `City`. A city consists of *pieces* (buildings, roads, waters, …), all in one frame: east, north and elevation in
metres. A large city is a *store*: a folder that holds the pieces in square *tiles*, which are read on demand. The
entities of the mission are not part of the city; `anchor` places them on it.

The modules, in the order in which an episode uses them:

- `city`        the values: `City`, its pieces (buildings, roads, waters, …) and `Tile`
- `bay`         a procedural sea bay: harbour point, beach, rocks and a pier in open water, floating objects
- `districts`   procedural towns by seed and options: one district, or all of them as a large city
- `osm`         OpenStreetMap data → a city in a folder (`lingjing scene build`; scene kind `map`)
- `network`     nodes and edges, or a map → SUMO's road network in world metres; and that network → road pieces
- `road_map`    the same network as a graph, for policies that plan routes
- `cutting`, `store`, `tiles`   long pieces cut at the grid → a city in a folder of tiles → tiles near a place
- `atomic_folder` temporary folders for writers, so that a city or network appears complete or not at all
- `anchor`      moves entities onto the roads, roofs, … that they declare ← `footing`, `lines`, `places_alike`
- `siting`      the places of a shipped mission, found in a city from a map
- `displacement`   the distance by which `anchor` moved declared places: reports and limits
- `terrain`     water, ground and obstacles at a place, with their elevations ← `outlines`, `blocks`
- `flight_floor`   the lowest points to which flying bodies may be sent
- `own_models`  models of a user's own (`look = "file.glb"`) ← `glb_file`: checks of their files
- `free_models` models of others from a package, with their credits, as such files ← `gltf_file`
- `obstacles`   ground that legged robots can walk; `shapes`, `sizes`: bodies to collide with and their sizes
- `roofs`       upper bounds of a city's height at many places at once
- `sight`       free straight lines through a city
- `ground_coverage`   the ground that pictures have shown, by cell
- `regions`     regions that only the city can resolve, such as those along a road
- `camera_geometry`   pixels, rays and points; headings; camera mounts of a body
- `picture_weather`   the weather of one picture
- `city_checks`       the checks that every city passes
- `plan`        the city from above: flat shapes in painting order, and their painter
- `exports`     a city as glTF, GeoJSON, SUMO's network or MuJoCo's model
- `translation` pieces translated to the centre of a scene
- `surroundings` the city around a mission, for viewers: shapes, and meshes in space

Invariants: a provider's result is a pure function of its `SceneSpec` (and of the content of the map it names). The same
spec gives an equal city in every process, identified by `City.sha256`. Network and world coordinates are the same.
Readers use `Tiles`, which works for cities in memory and in folders. No module here moves anything or imports a
plug-in.
"""
