"""The camera: one rendered city with all entities, RGB, depth and ids in one pass, exact boxes from the ids.

`context` opens OpenGL → `noise`, `ocean` (waves), `meshes` → `models` (the catalogue), `effects` (fire, smoke, spray,
debris) and `lamps` make what moves → `moving_things` (states → batches) → `instances` places and culls it.

What stands: open country is `ground` (City → height fields, shore map). A town is `town_ground` (its ground, waters,
quays), `skyline` (what is seen of it from afar) and, tile by tile, `tile_mesh`, made by `building_meshes`,
`road_meshes` (roads and areas) and `structure_meshes` (bridges, pipes, solids) of `mesh_rows`; `surroundings` is the
country and the sea around it. `culling` picks the tiles of a picture and the window of its shadow map, `view` how
finely each is drawn, `mesh_cache` keeps their meshes on disk, `cityscape` holds them on the GPU, `wall_order` orders
their walls, `reduced_meshes` are what is small in them, `prop_groups` gathers their props by mesh.

`light` (weather → light), `uniforms`, `programs` (of the sources in `shaders/*.glsl`), `upload`, `targets`,
`water_pass` (sea and lakes), `draw` turn a pose into buffers → `boxes`, `classes` read them, `contrast` measures how
visible a target is and `withheld` takes out what is hidden or too faint → `engine` answers the kernel; `options` is
what it can be told, `picture_keys` what a picture depends on. In: the city once, the states of all entities and of
background traffic at each boundary. Out: `Frame`s. Invariants: pictures depend on nothing but their inputs, whichever
tiles are held; ids are written by solid things only (no foam, shadow, smoke or rain); boxes come from the id buffer,
never from projected geometry; what a picture costs does not grow with the city.
"""
