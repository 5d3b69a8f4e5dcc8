"""The camera: a renderer of the city with all entities, which draws RGB, depth and ids in one pass.

The *id buffer* holds for each pixel the semantic class of a static surface, or the number of an entity. Exact boxes of
entities follow from it. A *tile* is a square of the city with its meshes. A *batch* is a set of instances of one mesh.
A *variant* is the town with the changes of all entities, without those of hidden ones, or without those of targets. A
large city is drawn in levels of detail: full tiles near the eye, blocks and a painted map beyond.

Input: the city once, and at each boundary the states of all entities and of background traffic. Output: `Frame`s.

Modules, in the order of data flow:

- `engine`: the engine contract; `options`: its options; `picture_keys`: a key of all inputs of a picture.
- `context`: the OpenGL context; `programs`: GLSL programs from `shaders/*.glsl`; `upload`: meshes on the GPU;
  `render_targets`: framebuffers.
- `meshes`, `models`: meshes of everything that is placed or moves; `effects`, `lamps`: fire, smoke, spray, debris and
  light.
- `moving_things`: states to batches; `instances`: rows of instances and their culling.
- `ground`: the ground of open country; `town_ground`: ground, waters and quays of a town; `far_country`: country and
  sea around it.
- `tile_mesh`: the meshes of a tile, from `building_meshes` (with the doors, signs and balconies of `facade_meshes`),
  `road_meshes` and `structure_meshes` in the format of `mesh_rows`; `mesh_cache`, `array_cache`: these meshes,
  textures and grids on disk.
- `skyline`: blocks and map of a city; `view`, `culling`: tiles and levels of detail of one picture, and the window of
  its shadow map.
- `cityscape`: the tiles on the GPU; `wall_order`: the order of walls; `mesh_chunks`: culling inside a tile;
  `prop_groups`, `reduced_meshes`: props, with simpler meshes for small ones.
- `noise`, `ocean`: textures and waves; `light`, `uniforms`: weather to uniform values; `water_pass`: sea and lakes;
  `draw`: one picture.
- `boxes`, `classes`: boxes and class ids from the id buffer; `contrast`: the visibility of targets; `redaction`:
  removal of hidden and invisible targets.

Invariants: a picture depends only on its inputs, whichever tiles are loaded. Only solid things write ids, never foam,
shadow, smoke or rain. Boxes come from the id buffer, never from projected geometry. The cost of a picture does not grow
with the size of the city.
"""
