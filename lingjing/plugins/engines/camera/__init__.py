"""The camera: one rendered city with all entities, RGB, depth and ids in one pass, exact boxes from the ids.

`context` opens OpenGL → `noise`, `ocean` (waves), `meshes` → `models` (the catalogue), `ground` (City → static
meshes) make what is drawn → `instances` places and culls it → `shaders`, `targets`, `draw` turn a pose into buffers
→ `boxes`, `classes` read them → `engine` answers the kernel. In: the city once, the states of all entities at each
boundary. Out: `Frame`s. Invariants: pictures depend on nothing but their inputs; ids are written by solid things
only (no foam, shadow or ripple); boxes come from the id buffer, never from projected geometry.
"""
